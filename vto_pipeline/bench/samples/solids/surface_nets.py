"""Zero level of a function as a well-shaped triangle mesh (naive surface nets, Gibson 1998).

Connectivity follows from signs on a grid alone, so rounding differences between processors cannot change it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

Field = Callable[[FloatArray], FloatArray]

_FLIPS = 10  # rounds; a handful is usual
BLOCK = 4  # fine cells per coarse cell
EDGES = [(corner, corner | 1 << axis) for axis in range(3) for corner in range(8) if not corner >> axis & 1]


def zero_surface(field: Field, low: FloatArray, high: FloatArray, cell: float, *, relaxations: int = 4) -> TriangleMesh:
    """Mesh where `field` is zero, outside positive.

    Args:
        field: Points (N, 3) [m] -> signed distance (N,) [m]; roughly a distance within a few cells of the surface.
        low, high: Corners of the box searched [m], shape (3,).
        cell: Grid spacing, about the edge length of the mesh [m].
        relaxations: Rounds of tangential smoothing, each followed by a projection onto the surface.

    Returns:
        A closed mesh (if the surface stays inside the box), vertices on the zero level to about a micrometre.
    """
    values = _flip_checkerboards(_sample(field, low, high, cell))
    vertices, quads = _nets(values, low, cell)
    vertices = newton_project(field, vertices, cell)
    for _ in range(relaxations):
        vertices = newton_project(field, _smooth(vertices, quads), cell)
    return TriangleMesh(newton_project(field, vertices, cell), _triangles(vertices, quads))


def forward_gradient(field: Field, points: FloatArray, step: float = 1e-5) -> tuple[FloatArray, FloatArray]:
    """Values (N,) and their forward differences (N, 3)."""
    values = field(points)
    columns = [(field(points + step * axis) - values) / step for axis in np.eye(3)]
    return values, np.stack(columns, axis=1)


def newton_project(field: Field, points: FloatArray, longest: float) -> FloatArray:
    """One Newton step along the gradient onto the zero level, at most `longest` [m]."""
    values, slope = forward_gradient(field, points)
    step = values[:, None] * slope / np.maximum(np.square(slope).sum(axis=1), 1e-6)[:, None]
    length = np.linalg.norm(step, axis=1, keepdims=True)
    return points - step * np.minimum(1.0, longest / np.maximum(length, 1e-12))


def _sample(field: Field, low: FloatArray, high: FloatArray, cell: float) -> FloatArray:
    """Values on the grid, shape (X, Y, Z): exact near the surface, the nearest coarse value elsewhere."""
    counts = np.ceil((high - low) / (cell * BLOCK)).astype(int)
    coarse_points = np.stack(np.meshgrid(*[np.arange(n + 1) for n in counts], indexing="ij"), axis=-1)
    coarse = field(low + coarse_points.reshape(-1, 3) * (cell * BLOCK)).reshape(counts + 1)
    fine = np.repeat(np.repeat(np.repeat(coarse, BLOCK, 0), BLOCK, 1), BLOCK, 2)
    near = np.argwhere(np.abs(fine) < 1.8 * BLOCK * cell)
    fine[tuple(near.T)] = field(low + near * cell)
    return fine


def _flip_checkerboards(values: FloatArray) -> FloatArray:
    """Flip the faintest corner of every checkerboard face, at which four triangles would share an edge.

    Where that goes to and fro between faces, what is outside is filled instead, which comes to an end.
    """
    values = values.copy()
    flips, turns = 1, 0
    while flips:
        flips, turns = 0, turns + 1
        for axis in range(3):
            grid = np.moveaxis(values, axis, 0)
            a, b, c, d = grid[:, :-1, :-1], grid[:, 1:, :-1], grid[:, 1:, 1:], grid[:, :-1, 1:]
            inside = a < 0.0
            mixed = np.argwhere((inside == (c < 0.0)) & (inside != (b < 0.0)) & (inside != (d < 0.0)))
            for i, j, k in mixed:  # a handful
                face = grid[i, j : j + 2, k : k + 2]
                size = np.abs(face) if turns <= _FLIPS else np.where(face < 0.0, np.inf, face)
                faint = np.unravel_index(size.argmin(), face.shape)
                face[faint] = -face[faint] if face[faint] != 0.0 else -1e-12
            flips += len(mixed)
    return values


def _nets(values: FloatArray, low: FloatArray, cell: float) -> tuple[FloatArray, IntArray]:
    """One vertex per cell that the surface crosses (N, 3), and one quad per crossed grid edge (Q, 4)."""
    inside = values < 0.0
    shape = np.array(values.shape) - 1
    count = np.zeros(shape, dtype=np.int8)
    corners = [np.array([c & 1, c >> 1 & 1, c >> 2 & 1]) for c in range(8)]
    for offset in corners:
        count += inside[tuple(slice(o, o + n) for o, n in zip(offset, shape, strict=True))]
    cells = np.argwhere((count > 0) & (count < 8))
    index = np.full(shape, -1, dtype=np.int64)
    index[tuple(cells.T)] = np.arange(len(cells))

    total = np.zeros((len(cells), 3))
    crossings = np.zeros(len(cells))
    for first, second in EDGES:
        a = values[tuple((cells + corners[first]).T)]
        b = values[tuple((cells + corners[second]).T)]
        crossed = (a < 0.0) != (b < 0.0)
        share = np.where(crossed, a / np.where(crossed, a - b, 1.0), 0.0)
        point = corners[first] + share[:, None] * (corners[second] - corners[first])
        total += np.where(crossed[:, None], point, 0.0)
        crossings += crossed
    vertices = low + cell * (cells + total / crossings[:, None])

    quads = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        step_u, step_v = np.eye(3, dtype=int)[u], np.eye(3, dtype=int)[v]
        ahead = np.roll(inside, -1, axis=axis)
        crossed = inside != ahead
        crossed[tuple(slice(-1, None) if a == axis else slice(None) for a in range(3))] = False
        start = np.argwhere(crossed)
        start = start[(start[:, u] > 0) & (start[:, v] > 0) & (start[:, u] < shape[u]) & (start[:, v] < shape[v])]
        ring = np.stack(
            [index[tuple((start - i * step_u - j * step_v).T)] for i, j in ((1, 1), (0, 1), (0, 0), (1, 0))], axis=1
        )
        leaving = inside[tuple(start.T)]
        quads.append(np.where(leaving[:, None], ring, ring[:, ::-1]))
    return vertices, np.concatenate(quads)


def _smooth(vertices: FloatArray, quads: IntArray) -> FloatArray:
    """Move every vertex half-way to the mean of its neighbours."""
    first, second = quads.ravel(), np.roll(quads, -1, axis=1).ravel()
    total = np.zeros_like(vertices)
    for axis in range(3):
        total[:, axis] = np.bincount(first, vertices[second, axis], len(vertices))
        total[:, axis] += np.bincount(second, vertices[first, axis], len(vertices))
    degree = np.bincount(first, minlength=len(vertices)) + np.bincount(second, minlength=len(vertices))
    return 0.5 * vertices + 0.5 * total / degree[:, None]


def _triangles(vertices: FloatArray, quads: IntArray) -> IntArray:
    """Split each quad along its shorter diagonal."""
    corner = vertices[quads]
    first = np.linalg.norm(corner[:, 0] - corner[:, 2], axis=1)
    second = np.linalg.norm(corner[:, 1] - corner[:, 3], axis=1)
    along_first = quads[:, [0, 1, 2, 0, 2, 3]]
    along_second = quads[:, [0, 1, 3, 1, 2, 3]]
    return np.where((first <= second)[:, None], along_first, along_second).reshape(-1, 3).astype(np.int32)
