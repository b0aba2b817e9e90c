"""Intersecting triangles of two surfaces, or of one surface with itself.

Two triangles meet exactly when an edge of one meets the other; the test is exact in sign (`predicates`) and closed, so
touching counts. An edge is never held against a triangle with which it shares a vertex: two faces that share one vertex
are still tested by the edges opposite to it. Weld first: coincident vertices with different indices count as touching.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from vto_pipeline.geometry.predicates import orient2d, orient3d
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.spatial import bvh, bvh_pairs
from vto_pipeline.numerics.vector import load


def intersecting_faces(one: TriangleMesh, other: TriangleMesh) -> IntArray:
    """Return the pairs (face of one, face of other) that meet, sorted, shape (K, 2)."""
    vertices = np.vstack([one.vertices, other.vertices])
    faces = np.vstack([one.faces, other.faces + np.int32(len(one.vertices))])
    count = len(one.faces)
    near = bvh_pairs.cross_pairs(bvh.build(vertices, faces[:count]), bvh.build(vertices, faces[count:]))
    shift = np.array([0, count], np.int32)
    return _meeting(vertices, faces, near + shift) - shift


def self_intersections(mesh: TriangleMesh) -> IntArray:
    """Return the pairs of faces of one mesh that meet otherwise than in their shared vertices, sorted, shape (K, 2)."""
    vertices, faces = mesh.vertices.copy(), mesh.faces.copy()  # writeable: one compiled kernel serves both callers
    return _meeting(vertices, faces, np.sort(bvh_pairs.self_pairs(bvh.build(vertices, faces)), axis=1))


def meeting_vertices(pairs: IntArray, faces: IntArray, count: int) -> NDArray[np.bool_]:
    """Return which of this many vertices belong to faces in these pairs, shape (count,)."""
    found = np.zeros(count, np.bool_)
    found[faces[pairs.reshape(-1)]] = True
    return found


def _meeting(vertices: FloatArray, faces: IntArray, pairs: IntArray) -> IntArray:
    """Return those of the pairs that meet, sorted."""
    pairs = pairs[_triangles_meet(vertices, faces, pairs)]
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


@njit(cache=True, parallel=True)
def _triangles_meet(vertices, faces, pairs):  # type: ignore[no-untyped-def]
    """Return whether each pair of faces meets, shape (K,)."""
    meet = np.zeros(len(pairs), np.bool_)
    for i in prange(len(pairs)):
        one, other = load(faces, pairs[i, 0]), load(faces, pairs[i, 1])
        apart = _is_beside(vertices, one, other) or _is_beside(vertices, other, one)
        meet[i] = not apart and (_edges_meet(vertices, one, other) or _edges_meet(vertices, other, one))
    return meet


@njit(cache=True)
def _is_beside(vertices, one, other):  # type: ignore[no-untyped-def]
    """Return whether what a face does not share with another lies on one side of its plane: so most pairs are apart."""
    a, b, c = load(vertices, other[0]), load(vertices, other[1]), load(vertices, other[2])
    side = 0
    for k in range(3):
        if one[k] == other[0] or one[k] == other[1] or one[k] == other[2]:
            continue
        here = orient3d(a, b, c, load(vertices, one[k]))
        if here == 0 or here * side < 0:
            return False
        side = here
    return True


@njit(cache=True)
def _edges_meet(vertices, edges_of, face):  # type: ignore[no-untyped-def]
    """Return whether an edge of the one face meets the other face."""
    a, b, c = load(vertices, face[0]), load(vertices, face[1]), load(vertices, face[2])
    for k in range(3):
        p, q = edges_of[k], edges_of[(k + 1) % 3]
        shared = False
        for m in range(3):
            if face[m] == p or face[m] == q:
                shared = True
        if not shared and segment_meets_triangle(load(vertices, p), load(vertices, q), a, b, c):
            return True
    return False


@njit(cache=True)
def segment_meets_triangle(p, q, a, b, c):  # type: ignore[no-untyped-def]
    """Return whether the closed segment pq and the closed triangle abc have a point in common."""
    side_p, side_q = orient3d(a, b, c, p), orient3d(a, b, c, q)
    if side_p * side_q > 0:
        return False
    if side_p == 0 and side_q == 0:
        return _meet_in_plane(p, q, a, b, c)
    s0, s1, s2 = orient3d(p, q, a, b), orient3d(p, q, b, c), orient3d(p, q, c, a)
    return (s0 >= 0 and s1 >= 0 and s2 >= 0) or (s0 <= 0 and s1 <= 0 and s2 <= 0)


@njit(cache=True)
def _meet_in_plane(p, q, a, b, c):  # type: ignore[no-untyped-def]
    """Return whether segment and triangle of one plane meet, seen along the axis nearest to the plane's normal."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    nx, ny, nz = abs(uy * vz - uz * vy), abs(uz * vx - ux * vz), abs(ux * vy - uy * vx)
    i, j = 0, 1
    if nx >= ny and nx >= nz:
        i, j = 1, 2
    elif ny >= nz:
        i, j = 2, 0
    inside = True
    turn = orient2d(a[i], a[j], b[i], b[j], c[i], c[j])
    for s, e in ((a, b), (b, c), (c, a)):
        if orient2d(s[i], s[j], e[i], e[j], p[i], p[j]) * turn < 0:
            inside = False
        if _segments_meet(p[i], p[j], q[i], q[j], s[i], s[j], e[i], e[j]):
            return True
    return inside and turn != 0


@njit(cache=True)
def _segments_meet(px, py, qx, qy, rx, ry, sx, sy):  # type: ignore[no-untyped-def]
    """Return whether two closed segments of the plane meet."""
    if max(px, qx) < min(rx, sx) or max(rx, sx) < min(px, qx) or max(py, qy) < min(ry, sy) or max(ry, sy) < min(py, qy):
        return False
    across = orient2d(px, py, qx, qy, rx, ry) * orient2d(px, py, qx, qy, sx, sy) <= 0
    return across and orient2d(rx, ry, sx, sy, px, py) * orient2d(rx, ry, sx, sy, qx, qy) <= 0
