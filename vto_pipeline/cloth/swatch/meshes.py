"""Flat strips and discs, on a grid or with triangles that follow no direction."""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy.spatial import Delaunay, cKDTree

from vto_pipeline.model.arrays import FloatArray, IntArray

MeshKind = Literal["grid", "irregular"]

_ROUNDS = 3  # of Lloyd's smoothing
_SPACING = 0.72  # least distance of the random points, as a share of the wanted edge
_TRIES = 30  # candidates per wanted point


def strip(
    kind: MeshKind, start: float, end: float, width: float, edge: float, seed: int = 0
) -> tuple[FloatArray, IntArray]:
    """Return points (x, y) [m], shape (V, 2), and triangles of start ≤ x ≤ end, 0 ≤ y ≤ width, edges of about `edge`.

    There are points on the line x = 0, where a strip is held.
    """
    if kind == "grid":
        return _grid(start, end, width, edge)
    across = np.linspace(0.0, width, max(1, round(width / edge)) + 1)
    before = np.linspace(start, 0.0, round(-start / edge) + 1)[:-1] if start < 0.0 else np.empty(0)
    along = np.concatenate([before, np.linspace(0.0, end, round(end / edge) + 1)])
    sides = [np.column_stack([along, np.full_like(along, y)]) for y in (0.0, width)]
    ends = [np.column_stack([np.full_like(across[1:-1], x), across[1:-1]]) for x in {start, 0.0, end}]
    rim = np.vstack(sides + ends)
    rim = rim[np.lexsort((rim[:, 1], rim[:, 0]))]
    rng = np.random.default_rng(seed)
    wanted = int((end - start) * width / edge**2)
    darts = rng.uniform((start, 0.0), (end, width), (_TRIES * wanted + 1, 2))
    return _smoothed(rim, _apart(rim, darts, _SPACING * edge))


def disc(kind: MeshKind, radius: float, edge: float, inner: float, seed: int = 0) -> tuple[FloatArray, IntArray]:
    """Return points and triangles of a disc about the origin, with points on an inner circle too.

    "grid" is rings of points, each turned against the next; "irregular" is random.
    """

    def ring(r: float, turn: float = 0.0) -> FloatArray:
        count = max(6, round(2.0 * np.pi * r / edge))
        angle = 2.0 * np.pi * (np.arange(count) + turn) / count
        return r * np.column_stack([np.cos(angle), np.sin(angle)])

    if kind == "grid":
        radii = np.concatenate(
            [
                np.linspace(0.0, inner, round(inner / edge) + 1)[1:],
                np.linspace(inner, radius, round((radius - inner) / edge) + 1)[1:],
            ]
        )
        points = np.vstack([np.zeros((1, 2))] + [ring(r, 0.5 * (k % 2)) for k, r in enumerate(radii)])
        return points, _triangles(points)
    rim = np.vstack([ring(inner), ring(radius)])
    rng = np.random.default_rng(seed)
    wanted = int(np.pi * radius**2 / edge**2)
    r, angle = radius * np.sqrt(rng.random(_TRIES * wanted)), 2.0 * np.pi * rng.random(_TRIES * wanted)
    return _smoothed(rim, _apart(rim, np.column_stack([r * np.cos(angle), r * np.sin(angle)]), _SPACING * edge))


def _grid(start: float, end: float, width: float, edge: float) -> tuple[FloatArray, IntArray]:
    """Squares whose diagonals alternate."""
    columns, rows = round((end - start) / edge), max(1, round(width / edge))
    x, y = np.meshgrid(np.linspace(start, end, columns + 1), np.linspace(0.0, width, rows + 1), indexing="ij")
    i, j = (g.ravel() for g in np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij"))
    a = i * (rows + 1) + j
    b, c, d = a + rows + 1, a + rows + 2, a + 1
    odd = ((i + j) % 2 == 1)[:, None]
    one = np.where(odd, np.column_stack([a, b, d]), np.column_stack([a, b, c]))
    two = np.where(odd, np.column_stack([b, c, d]), np.column_stack([a, c, d]))
    return np.column_stack([x.ravel(), y.ravel()]), np.vstack([one, two]).astype(np.int32)


def _apart(rim: FloatArray, darts: FloatArray, distance: float) -> FloatArray:
    """Return the darts that keep this distance from the rim and from all earlier ones that stay."""
    far = cKDTree(rim).query(darts)[0] >= distance
    darts = darts[far]
    taken = np.zeros(len(darts), dtype=bool)
    near = cKDTree(darts).query_ball_point(darts, distance)
    for i, others in enumerate(near):
        taken[i] = not taken[others].any()
    return darts[taken]


def _smoothed(rim: FloatArray, inner: FloatArray) -> tuple[FloatArray, IntArray]:
    points = np.vstack([rim, inner])
    for _ in range(_ROUNDS):
        faces = _triangles(points)
        corners = points[faces]
        area, middle = _areas(corners), corners.mean(axis=1)
        weight, moved = np.zeros(len(points)), np.zeros_like(points)
        np.add.at(weight, faces, area[:, None])
        np.add.at(moved, faces, (area[:, None] * middle)[:, None])
        points[len(rim) :] = (moved / weight[:, None])[len(rim) :]
    return points, _triangles(points)


def _triangles(points: FloatArray) -> IntArray:
    faces = Delaunay(points).simplices
    corners = points[faces]
    area = _areas(corners)
    faces = np.where((area < 0.0)[:, None], faces[:, ::-1], faces)
    return faces[np.abs(area) > 1e-6 * np.abs(area).max()].astype(np.int32)


def _areas(corners: FloatArray) -> FloatArray:
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.asarray(0.5 * (one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]))
