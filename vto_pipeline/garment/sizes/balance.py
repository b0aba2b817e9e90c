"""Moves of all corners, from those of the anchors, such that seams keep the ratio of their two sides.

Corners between two anchors move in proportion to how far along the outline they lie. Then all corners are moved on by
as little as the seams allow: a problem of least weighted squares with one condition a seam, by Newton's method.
Caps of sleeves and necks of hoods give way first, as they are fitted to armhole and neck.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from vto_pipeline.garment.sizes.anchors import Moves
from vto_pipeline.garment.sizes.morph import moved_edge
from vto_pipeline.garment.sizes.outline import Outline
from vto_pipeline.io.patterns.loops import edges_length
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.pattern import Side, Stitch

_STIFF, _FITTED = 100.0, 1.0  # what a move costs of a corner, squared
_ROUNDS = 12
_ENOUGH_M = 1e-8
_NUDGE_M = 1e-6
_LEAST = 1e-9  # of the largest singular value: conditions that others imply count as none


def proportional(one: Outline, anchors: Moves) -> FloatArray:
    """Return the moves of all corners of a panel, in its frame [m], shape (E, 2).

    Both sides of a dart count as no way along the outline, so that a dart moves as a whole.
    """
    edges = one.panel.edges
    lengths = [0.0 if role == "dart" else edges_length([e]) for role, e in zip(one.roles, edges, strict=True)]
    along = np.cumsum([0.0, *lengths])
    known = sorted(anchors)
    at = np.array([along[k] for k in known])
    moves = np.array([anchors[k] for k in known])
    return np.stack([np.interp(along[:-1], at, moves[:, axis], period=along[-1]) for axis in range(2)], axis=1)


def balanced(
    named: Mapping[str, Outline], stitches: Sequence[Stitch], moves: Mapping[str, FloatArray]
) -> dict[str, FloatArray]:
    """Return moves near the given ones under which both sides of each seam grow by the same share.

    Args:
        named: All panels.
        stitches: The seams.
        moves: Of the corners of each panel, in its frame [m], shape (E, 2).
    """
    names = list(named)
    start = np.cumsum([0, *(moves[name].size for name in names)])
    first = dict(zip(names, start[:-1].tolist(), strict=True))
    aim = np.concatenate([moves[name].ravel() for name in names])
    cost = np.concatenate([_costs(named[name]).ravel() for name in names])
    ratios = [_length(named, s.first, None) / _length(named, s.second, None) for s in stitches]

    def split(flat: FloatArray) -> dict[str, FloatArray]:
        return {name: flat[first[name] : first[name] + moves[name].size].reshape(-1, 2) for name in names}

    found = aim
    for _ in range(_ROUNDS):
        now = split(found)
        gap = np.array(
            [
                _length(named, s.first, now) - ratio * _length(named, s.second, now)
                for s, ratio in zip(stitches, ratios, strict=True)
            ]
        )
        if np.abs(gap).max(initial=0.0) < _ENOUGH_M:
            break
        slope = np.zeros((len(stitches), len(aim)))
        for row, (stitch, ratio) in enumerate(zip(stitches, ratios, strict=True)):
            for chain, factor in ((stitch.first, 1.0), (stitch.second, -ratio)):
                for side in chain:
                    _add_slope(slope[row], named[side.panel], side.edge, now[side.panel], first[side.panel], factor)
        eased = slope / cost
        pull, *_ = np.linalg.lstsq(eased @ slope.T, slope @ (aim - found) + gap, rcond=_LEAST)
        found = aim - eased.T @ pull
    return split(found)


def _costs(one: Outline) -> FloatArray:
    costs = np.full(one.corners.shape, _STIFF)
    if one.part == "hood":
        costs[:] = _FITTED
    if one.part == "sleeve":  # only across: the length of the sleeve stays as asked for
        costs[one.corners_between("cap", "seam"), 0] = _FITTED
    return costs


def _length(named: Mapping[str, Outline], chain: Sequence[Side], moves: Mapping[str, FloatArray] | None) -> float:
    if moves is None:
        return edges_length([named[side.panel].panel.edges[side.edge] for side in chain])
    return sum(_edge_length(named[side.panel], side.edge, moves[side.panel]) for side in chain)


def _edge_length(one: Outline, edge: int, moves: FloatArray) -> float:
    ends = moves[[edge, (edge + 1) % len(moves)]] @ one.frame
    return edges_length([moved_edge(one.panel.edges[edge], ends[0], ends[1])])


def _add_slope(row: FloatArray, one: Outline, edge: int, moves: FloatArray, first: int, factor: float) -> None:
    """Add how the length of an edge changes with the moves of its two corners."""
    for corner in (edge, (edge + 1) % len(moves)):
        for axis in range(2):
            lengths = []
            for nudge in (_NUDGE_M, -_NUDGE_M):
                nudged = moves.copy()
                nudged[corner, axis] += nudge
                lengths.append(_edge_length(one, edge, nudged))
            row[first + 2 * corner + axis] += factor * (lengths[0] - lengths[1]) / (2.0 * _NUDGE_M)
