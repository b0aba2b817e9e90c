"""Boxes in the cells of a uniform grid, kept in a hash table: the other way to find those that overlap.

Every box is entered in each cell it covers (Teschner et al. 2003, "Optimized Spatial Hashing"). A pair that meets in
several cells counts in one only: the cell of the larger of the two low corners, coordinate by coordinate.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from vto_pipeline.numerics.boxes import load_box, overlap, simplex_boxes, swept_boxes
from vto_pipeline.numerics.pair_lists import collect

_CELL = 1.5  # over the mean length of the boxes; measured
_CELLS_EACH = 32  # entries per box; with more, the cells are made larger
_SIDE = 2**20  # cells along an axis at most
_CHUNK = 64  # triangles a thread takes at a time
_ROOM = 16  # pairs a triangle is expected to find at most
_SERIAL_BELOW = 2000  # triangles; starting the threads costs as much as they save


class SpatialHash(NamedTuple):
    """Boxes of triangles in the cells they cover.

    Args:
        origin: Low corner of the grid [m], shape (3,).
        cell: Length of its cells [m].
        low, high: First and last cell of each triangle along each axis, shape (F, 3).
        starts: First entry of each place of the table, and their number, shape (2^k + 1,).
        entries: Triangle, and cell packed into one number, shape (M, 2).
        triangles: Box of each triangle as in `boxes` [m], shape (F, 6).
    """

    origin: NDArray[np.float64]
    cell: float
    low: NDArray[np.int64]
    high: NDArray[np.int64]
    starts: NDArray[np.int64]
    entries: NDArray[np.int64]
    triangles: NDArray[np.float64]


def hashed(
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    faces: NDArray[np.int32],
    radius: NDArray[np.float64],
) -> SpatialHash:
    """Return the triangles on their straight way in a new table; arguments as of `bvh.refit_swept`."""
    triangles = simplex_boxes(swept_boxes(start, end, radius), faces)
    origin, top = triangles[:, :3].min(axis=0), triangles[:, 3:].max(axis=0)
    size = triangles[:, 3:] - triangles[:, :3]
    cell = max(_CELL * float(size.max(axis=1).mean()), float((top - origin).max()) / _SIDE, 1e-300)
    while True:
        low, high = _cells(triangles[:, :3], origin, cell), _cells(triangles[:, 3:], origin, cell)
        if (high - low + 1.0).prod(axis=1).sum() <= _CELLS_EACH * len(faces):
            break
        cell *= 2.0
    places = 1 << int(2 * len(faces) - 1).bit_length()
    starts, entries = _fill(low, high, places)
    return SpatialHash(origin, cell, low, high, starts, entries, triangles)


def self_pairs(table: SpatialHash) -> NDArray[np.int32]:
    """Return the pairs of triangles whose closed boxes overlap, each once, in no order that means anything: (N, 2)."""
    return _pairs(table.low, table.high, table.triangles, table, True)


def cross_pairs(table: SpatialHash, other: SpatialHash) -> NDArray[np.int32]:
    """Return the pairs (triangle of the one, of the other) whose closed boxes overlap, shape (N, 2)."""
    boxes = table.triangles
    low, high = _cells(boxes[:, :3], other.origin, other.cell), _cells(boxes[:, 3:], other.origin, other.cell)
    return _pairs(low, high, boxes, other, False)


def _cells(corners: NDArray[np.float64], origin: NDArray[np.float64], cell: float) -> NDArray[np.int64]:
    """Return the cells of these corners; those outside of the grid are put into its outermost layer."""
    return np.clip((corners - origin) / cell, 0, _SIDE).astype(np.int64)


def _pairs(
    low: NDArray[np.int64], high: NDArray[np.int64], boxes: NDArray[np.float64], table: SpatialHash, same: bool
) -> NDArray[np.int32]:
    search = _search_serial if len(boxes) < _SERIAL_BELOW else _search_parallel
    kept = (table.low, table.starts, table.entries, table.triangles)
    return collect(
        lambda starts, found, counts: search(low, high, boxes, *kept, same, starts, found, counts),
        (len(boxes) + _CHUNK - 1) // _CHUNK,
        _CHUNK * _ROOM,
    )


@njit(cache=True, error_model="numpy")
def _fill(low, high, places):
    """Return the starts and entries of the table."""
    starts = np.zeros(places + 1, np.int64)
    for i in range(len(low)):
        for x in range(low[i, 0], high[i, 0] + 1):
            for y in range(low[i, 1], high[i, 1] + 1):
                for z in range(low[i, 2], high[i, 2] + 1):
                    starts[_place(x, y, z, places) + 1] += 1
    for place in range(places):
        starts[place + 1] += starts[place]
    entries = np.empty((starts[places], 2), np.int64)
    filled = starts[:-1].copy()
    for i in range(len(low)):
        for x in range(low[i, 0], high[i, 0] + 1):
            for y in range(low[i, 1], high[i, 1] + 1):
                for z in range(low[i, 2], high[i, 2] + 1):
                    place = _place(x, y, z, places)
                    entries[filled[place], 0], entries[filled[place], 1] = i, _packed(x, y, z)
                    filled[place] += 1
    return starts, entries


@njit(cache=True, error_model="numpy", forceinline=True)
def _place(x, y, z, places):
    return (x * 73856093 ^ y * 19349663 ^ z * 83492791) & (places - 1)


@njit(cache=True, error_model="numpy", forceinline=True)
def _packed(x, y, z):
    return (x << 42) | (y << 21) | z


@njit(cache=True, error_model="numpy", parallel=True)
def _search_parallel(low, high, boxes, other_low, places, entries, other_boxes, same, starts, found, counts):
    for chunk in prange(len(counts)):
        first, last = _CHUNK * chunk, min(_CHUNK * (chunk + 1), len(boxes))
        room = found[starts[chunk] : starts[chunk + 1]]
        counts[chunk] = _search(low, high, boxes, other_low, places, entries, other_boxes, same, first, last, room)


@njit(cache=True, error_model="numpy")
def _search_serial(low, high, boxes, other_low, places, entries, other_boxes, same, starts, found, counts):
    for chunk in range(len(counts)):
        first, last = _CHUNK * chunk, min(_CHUNK * (chunk + 1), len(boxes))
        room = found[starts[chunk] : starts[chunk + 1]]
        counts[chunk] = _search(low, high, boxes, other_low, places, entries, other_boxes, same, first, last, room)


@njit(cache=True, error_model="numpy")
def _search(low, high, boxes, other_low, places, entries, other_boxes, same, first, last, found):
    """Write the pairs of some triangles, as far as there is room, and return how many there are."""
    count = 0
    for i in range(first, last):
        box = load_box(boxes, i)
        for x in range(low[i, 0], high[i, 0] + 1):
            for y in range(low[i, 1], high[i, 1] + 1):
                for z in range(low[i, 2], high[i, 2] + 1):
                    here, place = _packed(x, y, z), _place(x, y, z, len(places) - 1)
                    for entry in range(places[place], places[place + 1]):
                        j = entries[entry, 0]
                        if entries[entry, 1] != here or (same and j <= i) or not overlap(box, other_boxes, j):
                            continue
                        if (
                            max(low[i, 0], other_low[j, 0]) == x
                            and max(low[i, 1], other_low[j, 1]) == y
                            and max(low[i, 2], other_low[j, 2]) == z
                        ):
                            if count < len(found):
                                found[count, 0], found[count, 1] = i, j
                            count += 1
    return count
