"""One offset for each patch of a surface, so that patches match well and neighbours stay together."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

STEP_COST = 0.05
"""Of neighbours that differ by one offset, in correlations."""
MOST_COST = 0.6
"""However far they differ: a fold or a rim."""
SWEEPS = 40
CHUNK = 512
"""Nodes that one thread works on at a time."""


@njit(cache=True, parallel=True)
def smooth_choice(costs, start, neighbour, back):  # type: ignore[no-untyped-def]  # typed by Numba
    """Choose labels of least cost and least truncated distance between neighbours.

    Min-sum belief propagation with linear-time messages (Felzenszwalb and Huttenlocher 2006); the graph has loops, so
    that the least is not certain.

    Args:
        costs: Of each label, shape (P, L), float32.
        start: Of each node's neighbours in the list, shape (P + 1,).
        neighbour: Of each node in turn, shape (E,).
        back: The same edge the other way round, shape (E,).

    Returns:
        Labels with a fraction from the parabola through the least belief and those beside it, shape (P,).
    """
    nodes, labels = costs.shape
    message = np.zeros((len(neighbour), labels), np.float32)
    coming = np.zeros((len(neighbour), labels), np.float32)
    for _ in range(SWEEPS):
        for chunk in prange(-(-nodes // CHUNK)):
            _send(chunk * CHUNK, min((chunk + 1) * CHUNK, nodes), costs, start, back, message, coming)
        message, coming = coming, message
    chosen, total = np.empty(nodes), np.empty(labels, np.float32)
    for p in range(nodes):
        total[:] = costs[p]
        for e in range(start[p], start[p + 1]):
            total += message[back[e]]
        chosen[p] = peak(total, np.argmin(total))
    return chosen


@njit(cache=True, nogil=True)
def _send(first, end, costs, start, back, message, coming):  # type: ignore[no-untyped-def]  # typed by Numba
    """Set the messages that some nodes send next, from those that came last."""
    labels = costs.shape[1]
    total, sent = np.empty(labels, np.float32), np.empty(labels, np.float32)
    for p in range(first, end):
        total[:] = costs[p]
        for e in range(start[p], start[p + 1]):
            total += message[back[e]]
        for e in range(start[p], start[p + 1]):
            sent[:] = total - message[back[e]]
            least = sent.min()
            for k in range(1, labels):
                sent[k] = min(sent[k], sent[k - 1] + np.float32(STEP_COST))
            for k in range(labels - 2, -1, -1):
                sent[k] = min(sent[k], sent[k + 1] + np.float32(STEP_COST))
            for k in range(labels):
                coming[e, k] = min(sent[k], least + np.float32(MOST_COST)) - least


@njit(cache=True, nogil=True)
def peak(values, index):  # type: ignore[no-untyped-def]  # typed by Numba
    """Place of the extreme of the parabola through a value and its two neighbours, within half a step of it."""
    if index == 0 or index == len(values) - 1:
        return float(index)
    before, at, after = values[index - 1], values[index], values[index + 1]
    bend = before - 2.0 * at + after
    if bend == 0.0:
        return float(index)
    return index + min(max(0.5 * (before - after) / bend, -0.5), 0.5)
