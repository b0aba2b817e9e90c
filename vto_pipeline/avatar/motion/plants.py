"""When a foot stands still on the floor: speed and height, each with hysteresis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.model.arrays import FloatArray

_ENTER_M_S, _LEAVE_M_S = 0.20, 0.40
_ENTER_M, _LEAVE_M = 0.035, 0.06
_SHORTEST_S = 0.1
_TREMBLE_M = 0.03
"""A short rise ends no plant if the foot comes down within this."""

_SPAN_S = 0.03
"""Over which speeds are taken: captured places are noisy."""


def find_plants(places: FloatArray, frame_time: float) -> NDArray[np.bool_]:
    """Return when each point is planted, shape (T, N).

    A point is planted from when it is slow and low until it is fast or high; times shorter than 0.1 s do not count,
    neither on the floor nor just above it.
    After Kovar, Schreiner & Gleicher 2002, "Footskate cleanup for motion capture editing".

    Args:
        places: World places, +Y up, y = 0 the floor [m], shape (T, N, 3).
        frame_time: [s].
    """
    frames = len(places)
    speed = speeds(places, frame_time)
    height = places[..., 1]
    enter = (speed < _ENTER_M_S) & (height < _ENTER_M)
    stay = (speed < _LEAVE_M_S) & (height < _LEAVE_M)
    planted = np.zeros(enter.shape, dtype=bool)
    for n in range(places.shape[1]):
        for first, end in runs(stay[:, n]):
            entered = np.flatnonzero(enter[first:end, n])
            if len(entered):
                planted[first + entered[0] : end, n] = True
        for first, end in runs(~planted[:, n]):  # a short rise is a tremble
            if first > 0 and end < frames and (end - first) * frame_time < _SHORTEST_S:
                moved = float(np.linalg.norm(places[end, n] - places[first - 1, n]))
                planted[first:end, n] = moved < _TREMBLE_M and height[first:end, n].max() < _LEAVE_M
        for first, end in runs(planted[:, n]):
            if frames > 1 and (end - first) * frame_time < _SHORTEST_S:
                planted[first:end, n] = False
    return planted


def speeds(places: FloatArray, frame_time: float) -> FloatArray:
    """Return speeds over a few hundredths of a second [m/s], shape (T, N); 0 for a single frame."""
    reach = max(1, round(_SPAN_S / 2 / frame_time))
    frames = np.arange(len(places))
    ahead, behind = np.minimum(frames + reach, len(places) - 1), np.maximum(frames - reach, 0)
    seconds = np.maximum(ahead - behind, 1) * frame_time
    moved: FloatArray = np.linalg.norm(places[ahead] - places[behind], axis=-1) / seconds[:, None]
    return moved


def runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the beginning and end (exclusive) of each run of true values."""
    edges = np.diff(np.concatenate([[0], mask.astype(np.int8), [0]]))
    return list(zip(np.flatnonzero(edges == 1).tolist(), np.flatnonzero(edges == -1).tolist(), strict=True))
