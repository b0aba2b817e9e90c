"""Refine a patch that spans a loop to triangles of one size; its rim stays as it is.

Liepa 2003, "Filling holes in meshes", section 4: splits alternate with flips to Delaunay's condition. Without flips the
pieces of long thin triangles would be as thin, and without end; with them the number of triangles follows the area.
At the end, vertices move to the middle of their neighbours where that makes the worst of their triangles better
(Freitag 1997, "On combining Laplacian and optimization-based mesh smoothing techniques").
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.geometry.remeshing.fold import triangle_normal
from vto_pipeline.geometry.topology import opposite_half_edges
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

_TOO_LONG, _TOO_NEAR = 4.0 / 3.0, 0.5
"""Longer edges are split, unless the middle is nearer to a corner across than this; both in wanted edge lengths."""
_ROUNDS = 100
"""Of splits and flips; an edge is halved in each, so a few more than the logarithm of the longest do."""
_SWEEPS = 100
"""Of flips; on a plane the last one finds nothing to flip, over a fold they may go round in circles."""
_RELAXED = 5
"""Rounds of smoothing and flips at the end."""
_SHARP = 0.5
"""No flip makes a sharper fold than this cosine, where there was none."""


def refine(patch: TriangleMesh, edge: float, forbidden: NDArray[np.bool_]) -> TriangleMesh:
    """Return the patch in triangles of about one edge length; its vertices come first and stay where they are.

    Args:
        patch: An oriented manifold piece of surface with all its vertices on its boundary.
        edge: Wanted edge length [m]; shorter edges of the rim stay.
        forbidden: Pairs of its vertices that no new edge may join, symmetric, shape (V, V).
    """
    vertices, faces, twin = patch.vertices, patch.faces.copy(), opposite_half_edges(patch)
    fixed = len(vertices)
    for _ in range(_ROUNDS):
        _flip(vertices, faces, twin, forbidden)
        vertices, faces, twin, added = _split(vertices, faces, twin, fixed, edge)
        if added == 0:
            break
    vertices = vertices.copy()
    for _ in range(_RELAXED):
        _smooth(vertices, faces, twin, fixed)
        _flip(vertices, faces, twin, forbidden)
    return TriangleMesh(vertices, faces)


def _split(
    vertices: FloatArray, faces: IntArray, twin: IntArray, fixed: int, edge: float
) -> tuple[FloatArray, IntArray, IntArray, int]:
    """Halve the longest edges, at most one of each face, and return how many."""
    half = np.flatnonzero(twin > np.arange(len(twin))).astype(np.int32)
    corner = faces.reshape(-1)
    start, end = corner[half], corner[_next(half)]
    length = np.linalg.norm(vertices[end] - vertices[start], axis=1)
    middle = 0.5 * (vertices[start] + vertices[end])
    across = [np.linalg.norm(vertices[corner[_next(_next(side))]] - middle, axis=1) for side in (half, twin[half])]
    good = np.flatnonzero((length > _TOO_LONG * edge) & (np.minimum(*across) > _TOO_NEAR * edge))
    longest_first = half[good[np.argsort(-length[good], kind="stable")]]
    chosen = _apart(longest_first, twin)
    count = len(chosen)
    if count == 0:
        return vertices, faces, twin, 0
    middle = 0.5 * (vertices[corner[chosen]] + vertices[corner[_next(chosen)]])
    faces, twin = _halve(faces, twin, chosen, len(vertices))
    return np.vstack([vertices, middle]), faces, twin, count


def _next(half: IntArray) -> IntArray:
    return 3 * (half // 3) + (half + 1) % 3


@njit(cache=True)
def _apart(half, twin):  # type: ignore[no-untyped-def]
    """Return those of the half-edges that share no face with one before, shape (N,)."""
    touched = np.zeros(len(twin) // 3, np.bool_)
    kept = np.zeros(len(half), np.bool_)
    for n in range(len(half)):
        f, g = half[n] // 3, twin[half[n]] // 3
        if not touched[f] and not touched[g]:
            touched[f] = touched[g] = kept[n] = True
    return half[kept]


@njit(cache=True)
def _pair(twin, half, other):  # type: ignore[no-untyped-def]
    twin[half] = other
    if other >= 0:
        twin[other] = half


@njit(cache=True)
def _halve(faces, twin, chosen, old):  # type: ignore[no-untyped-def]
    """Halve inner edges, no two of one face; the new vertices are numbered from `old` on."""
    count = len(faces)
    new_faces = np.empty((count + 2 * len(chosen), 3), np.int32)
    new_twin = np.empty(3 * len(new_faces), np.int32)
    new_faces[:count], new_twin[: 3 * count] = faces, twin
    for n in range(len(chosen)):
        one, middle = chosen[n], old + n
        other = new_twin[one]
        f, i, g, j = one // 3, one % 3, other // 3, other % 3
        a, b, c, d = faces[f, i], faces[f, (i + 1) % 3], faces[f, (i + 2) % 3], faces[g, (j + 2) % 3]
        bc, ca = new_twin[3 * f + (i + 1) % 3], new_twin[3 * f + (i + 2) % 3]
        ad, db = new_twin[3 * g + (j + 1) % 3], new_twin[3 * g + (j + 2) % 3]
        h, k = count + 2 * n, count + 2 * n + 1
        new_faces[f, 0], new_faces[f, 1], new_faces[f, 2] = a, middle, c
        new_faces[h, 0], new_faces[h, 1], new_faces[h, 2] = middle, b, c
        new_faces[g, 0], new_faces[g, 1], new_faces[g, 2] = middle, a, d
        new_faces[k, 0], new_faces[k, 1], new_faces[k, 2] = b, middle, d
        _pair(new_twin, 3 * f, 3 * g)
        _pair(new_twin, 3 * f + 1, 3 * h + 2)
        _pair(new_twin, 3 * f + 2, ca)
        _pair(new_twin, 3 * h, 3 * k)
        _pair(new_twin, 3 * h + 1, bc)
        _pair(new_twin, 3 * g + 1, ad)
        _pair(new_twin, 3 * g + 2, 3 * k + 1)
        _pair(new_twin, 3 * k + 2, db)
    return new_faces, new_twin


@njit(cache=True)
def _flip(vertices, faces, twin, forbidden):  # type: ignore[no-untyped-def]
    """Flip inner edges whose opposite angles add up to more than half a turn."""
    fixed = len(forbidden)
    for _ in range(_SWEEPS):
        flipped = 0
        for one in range(len(twin)):
            other = twin[one]
            if other < one:
                continue
            f, i, g, j = one // 3, one % 3, other // 3, other % 3
            a, b, c, d = faces[f, i], faces[f, (i + 1) % 3], faces[f, (i + 2) % 3], faces[g, (j + 2) % 3]
            if _cotangent(vertices, c, a, b) + _cotangent(vertices, d, a, b) >= -1e-9 or c == d:
                continue
            if (c < fixed and d < fixed and forbidden[c, d]) or _joined(faces, twin, 3 * f + (i + 2) % 3, d):
                continue
            if _cosine(vertices, a, d, c, b) < min(_SHARP, _cosine(vertices, c, a, b, d)):
                continue
            beyond_bc, beyond_ca = twin[3 * f + (i + 1) % 3], twin[3 * f + (i + 2) % 3]
            beyond_ad, beyond_db = twin[3 * g + (j + 1) % 3], twin[3 * g + (j + 2) % 3]
            faces[f, 0], faces[f, 1], faces[f, 2] = a, d, c
            faces[g, 0], faces[g, 1], faces[g, 2] = d, b, c
            _pair(twin, 3 * f, beyond_ad)
            _pair(twin, 3 * f + 1, 3 * g + 2)
            _pair(twin, 3 * f + 2, beyond_ca)
            _pair(twin, 3 * g, beyond_db)
            _pair(twin, 3 * g + 1, beyond_bc)
            flipped += 1
        if flipped == 0:
            break


@njit(cache=True)
def _cotangent(vertices, at, one, other):  # type: ignore[no-untyped-def]
    """Return the cotangent of the angle at a vertex."""
    ux, uy, uz = vertices[one] - vertices[at]
    vx, vy, vz = vertices[other] - vertices[at]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return (ux * vx + uy * vy + uz * vz) / max(np.sqrt(x * x + y * y + z * z), 1e-300)


@njit(cache=True)
def _cosine(vertices, p, a, b, q):  # type: ignore[no-untyped-def]
    """Return the cosine between the normals of the faces (p, a, b) and (q, b, a)."""
    x, y, z, _ = triangle_normal(vertices, p, a, b)
    u, v, w, _ = triangle_normal(vertices, q, b, a)
    return x * u + y * v + z * w


@njit(cache=True)
def _joined(faces, twin, start, vertex):  # type: ignore[no-untyped-def]
    """Return whether the vertex where a half-edge starts has an edge to another vertex: go round it both ways."""
    for forwards in (True, False):
        half = start
        while True:
            f, k = half // 3, half % 3
            if faces[f, (k + 1) % 3] == vertex or faces[f, (k + 2) % 3] == vertex:
                return True
            if forwards:
                half = twin[3 * f + (k + 2) % 3]  # the next half-edge that starts here
            elif twin[half] < 0:
                break
            else:
                half = 3 * (twin[half] // 3) + (twin[half] % 3 + 1) % 3
            if half < 0 or half == start:
                break
        if half == start:
            break
    return False


@njit(cache=True)
def _smooth(vertices, faces, twin, fixed):  # type: ignore[no-untyped-def]
    """Move each new vertex to the middle of its neighbours where the worst of its triangles gets better by that."""
    leaving = np.empty(len(vertices), np.int64)
    for half in range(len(twin)):
        leaving[faces[half // 3, half % 3]] = half
    old, middle = np.empty(3), np.empty(3)
    for vertex in range(fixed, len(vertices)):
        middle[:], count, half = 0.0, 0, leaving[vertex]
        while True:
            middle += vertices[faces[half // 3, (half + 1) % 3]]
            count += 1
            half = twin[3 * (half // 3) + (half % 3 + 2) % 3]
            if half == leaving[vertex]:
                break
        before = _worst_around(vertices, faces, twin, leaving[vertex])
        old[:] = vertices[vertex]
        vertices[vertex] = middle / count
        if _worst_around(vertices, faces, twin, leaving[vertex]) <= before:
            vertices[vertex] = old


@njit(cache=True)
def _worst_around(vertices, faces, twin, first):  # type: ignore[no-untyped-def]
    """Return the worst shape of the faces around the vertex where a half-edge starts: 1 for equilateral, below zero
    for a face turned against the mean of all, which does not depend on where the vertex is."""
    total = np.zeros(3)
    half = first
    while True:
        i, k, j = faces[half // 3]
        x, y, z, area = triangle_normal(vertices, i, k, j)
        total[0] += area * x
        total[1] += area * y
        total[2] += area * z
        half = twin[3 * (half // 3) + (half % 3 + 2) % 3]
        if half == first:
            break
    length = max(np.sqrt((total**2).sum()), 1e-300)
    worst = np.inf
    while True:
        i, k, j = faces[half // 3]
        x, y, z, area = triangle_normal(vertices, i, k, j)
        turned = area * (x * total[0] + y * total[1] + z * total[2]) / length
        u, v, w = vertices[k] - vertices[i], vertices[j] - vertices[k], vertices[i] - vertices[j]
        worst = min(worst, 4.0 * np.sqrt(3.0) * turned / max((u**2 + v**2 + w**2).sum(), 1e-300))
        half = twin[3 * (half // 3) + (half % 3 + 2) % 3]
        if half == first:
            return worst
