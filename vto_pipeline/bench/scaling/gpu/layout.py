"""Arrays as a graphics processor reads them best: rows of a matrix by domains and slices, constraints by colours."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.numerics.linear.block_matrix import BlockMatrix
from vto_pipeline.numerics.linear.coloured_blocks import _colour_blocks

THREADS = 768
"""Of a block of threads: whole domains of any size in `SIZES`, for three rows a vertex."""
SIZES = (1, 8, 32)
"""Vertices of a domain."""
_SLICE = 32  # scalar rows that lie side by side
_FULL = 0.875  # of a domain, on average: parts come out uneven


class Layout(NamedTuple):
    """A matrix of 3 x 3 blocks by scalar rows, some of them for nothing, R in all.

    Args:
        place: Row of blocks of each vertex, shape (N,).
        slices: First entry of each slice of 32 rows, and their number, shape (R / 32 + 1,).
        columns: First of the three columns of each entry, shape (entries, 32).
        values: Shape (entries, 3, 32).
        domains: The matrix without what couples domains, shape (D, W, W); R = D W.
    """

    place: IntArray
    slices: IntArray
    columns: IntArray
    values: FloatArray
    domains: FloatArray


def lay_out(matrix: BlockMatrix, size: int) -> Layout:
    """Return a matrix by domains of at most `size` vertices, one of `SIZES`; rows for nothing are an identity."""
    count = len(matrix.diagonal)
    place, used = domains(matrix, size)
    step = THREADS // 3
    total = -(-used // step) * step
    unused = np.setdiff1d(np.arange(total), place)
    rows = np.concatenate([place[np.repeat(np.arange(count), np.diff(matrix.starts))], unused])
    columns = np.concatenate([place[matrix.columns], unused])
    blocks = np.concatenate([matrix.blocks, np.broadcast_to(np.eye(3), (len(unused), 3, 3))])
    order = np.lexsort((columns, rows))
    rows, columns, blocks = rows[order], columns[order], blocks[order]
    width = np.bincount(rows, minlength=total)
    wide = np.repeat(width, 3).reshape(-1, _SLICE).max(axis=1)
    slices = np.concatenate([[0], np.cumsum(wide)])
    within = np.arange(len(rows)) - np.repeat(np.cumsum(width) - width, width)
    laid, values = np.zeros((slices[-1], _SLICE), np.int32), np.zeros((slices[-1], 3, _SLICE))
    for axis in range(3):
        scalar = 3 * rows + axis
        entry, lane = slices[scalar // _SLICE] + within, scalar % _SLICE
        laid[entry, lane] = 3 * columns
        values[entry, :, lane] = blocks[:, axis]
    same = rows // size == columns // size
    dense = np.zeros((total // size, size, 3, size, 3))
    dense[rows[same] // size, rows[same] % size, :, columns[same] % size, :] = blocks[same]
    return Layout(
        place.astype(np.int32),
        slices.astype(np.int32),
        laid,
        values,
        dense.reshape(total // size, 3 * size, 3 * size),
    )


def domains(matrix: BlockMatrix, size: int) -> tuple[IntArray, int]:
    """Return a place for each row, so that neighbours share a domain of `size` places, and the number of places.

    Parts by METIS; a row alone needs no domain, but lies near its neighbours all the same.
    """
    import pymetis

    count, most = len(matrix.diagonal), max(size, SIZES[-1] if size == 1 else size)
    parts = max(1, round(count / (_FULL * most)))
    graph = pymetis.CSRAdjacency(*_without_diagonal(matrix))
    _, found = pymetis.part_graph(parts, adjacency=graph) if parts > 1 else (0, np.zeros(count))
    part = np.asarray(found, np.int64)
    order = np.argsort(part, kind="stable")
    if size == 1:
        place = np.empty(count, np.int32)
        place[order] = np.arange(count)
        return place, count
    rank = np.arange(count) - np.searchsorted(part[order], part[order])
    key = part[order] * (count + 1) + rank // size  # a part that is too large becomes several domains
    domain = np.unique(key, return_inverse=True)[1]
    place = np.empty(count, np.int32)
    place[order] = size * domain + rank % size
    return place, int(size * (domain.max() + 1))


def _without_diagonal(matrix: BlockMatrix) -> tuple[IntArray, IntArray]:
    rows = np.repeat(np.arange(len(matrix.diagonal)), np.diff(matrix.starts))
    kept = rows != matrix.columns
    starts = np.concatenate([[0], np.cumsum(np.bincount(rows[kept], minlength=len(matrix.diagonal)))])
    return starts.astype(np.int32), matrix.columns[kept].astype(np.int32)


def one_by_one(data: Any, vertices: int) -> Any:
    """Return the same constraints in colours of single constraints, not of blocks: no two of a colour share a vertex.

    Args:
        data: Of a kind; see `cloth.constraints.kind`.
        vertices: How many the cloth has.
    """
    count = len(data.vertices)
    colour = _colour_blocks(data.vertices, np.arange(count), vertices)
    order = np.argsort(colour, kind="stable")
    arranged = {
        name: np.ascontiguousarray(value[order])
        for name, value in data._asdict().items()
        if isinstance(value, np.ndarray) and name not in ("starts", "colours") and len(value) == count
    }
    colours = np.concatenate([[0], np.cumsum(np.bincount(colour))])
    return data._replace(**arranged, starts=np.arange(count + 1), colours=colours)
