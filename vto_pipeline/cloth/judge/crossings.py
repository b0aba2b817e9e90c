"""Which triangles pass through each other, by a test that shares nothing with the solver's.

The solver asks on which side of a plane points lie (`geometry.intersections`). The judge looks for a direction along
which two triangles lie apart: there is one exactly when they do not meet (the separating axis theorem; Gottschalk, Lin
& Manocha 1996, "OBBTree"). Floating point decides where the gap, or the overlap along every axis, is larger than its
own error; the rest is decided in whole numbers. Touching counts. Faces that share one vertex are held against each
other by the edges opposite to it, faces that share two are not: they only meet where they are folded flat together.
"""

from __future__ import annotations

from itertools import chain, combinations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

_ERROR = 1e-13  # of the product of the lengths that go into a projection: several times what its roundings add up to
_APART, _UNSURE, _MEET = -1, 0, 1


def self_crossings(mesh: TriangleMesh) -> IntArray:
    """Return the pairs of faces of one mesh that meet otherwise than in shared vertices, sorted, shape (K, 2)."""
    return _crossing(mesh.vertices, mesh.faces, _overlapping(mesh.vertices[mesh.faces], len(mesh.faces)))


def crossings_between(one: TriangleMesh, other: TriangleMesh) -> IntArray:
    """Return the pairs (face of one, face of other) that meet, sorted, shape (K, 2)."""
    vertices = np.vstack([one.vertices, other.vertices])
    faces = np.vstack([one.faces, other.faces + len(one.vertices)])
    pairs = _crossing(vertices, faces, _overlapping(vertices[faces], len(one.faces)))
    return np.asarray(pairs - [0, len(one.faces)], np.int32)


def _overlapping(corners: FloatArray, of_one: int) -> NDArray[np.int64]:
    """Return the pairs of triangles whose boxes overlap, the lower index first, shape (K, 2).

    Args:
        corners: [m], shape (F, 3, 3).
        of_one: How many of them are of the first mesh, to be held against the others; against each other where all are.
    """
    low, high = corners.min(axis=1), corners.max(axis=1)
    axis = int(np.argmax(np.ptp(low, axis=0)))  # along the longest way the fewest overlap
    order = np.argsort(low[:, axis], kind="stable")
    first = order < of_one if of_one < len(corners) else np.zeros(0, np.bool_)
    return np.sort(order[_sweep(low[order], high[order], axis, first)], axis=1)


@njit(cache=True)
def _sweep(low, high, axis, first):  # type: ignore[no-untyped-def]
    """Return the pairs of boxes that overlap; where told which are of the first mesh, only of one of each.

    Args:
        low, high: Corners of the boxes, sorted by the lower one's place along the axis, shape (F, 3).
        axis: Along which to sweep.
        first: Which are of the first mesh, shape (F,), or empty.
    """
    pairs = np.empty((len(low) + 16, 2), np.int64)
    count = 0
    for i in range(len(low)):
        for j in range(i + 1, len(low)):
            if low[j, axis] > high[i, axis]:
                break
            if len(first) > 0 and first[i] == first[j]:
                continue
            apart = False
            for k in range(3):
                apart |= low[j, k] > high[i, k] or low[i, k] > high[j, k]
            if apart:
                continue
            if count == len(pairs):
                pairs = np.concatenate((pairs, np.empty_like(pairs)))
            pairs[count, 0], pairs[count, 1] = i, j
            count += 1
    return pairs[:count]


def _crossing(vertices: FloatArray, faces: IntArray, pairs: NDArray[np.int64]) -> IntArray:
    """Return those of the pairs of faces that meet, sorted."""
    one, two = faces[pairs[:, 0]], faces[pairs[:, 1]]
    same = one[:, :, None] == two[:, None, :]
    shared = same.sum(axis=(1, 2))
    meet = np.zeros(len(pairs), np.bool_)
    (apart,) = np.nonzero(shared == 0)
    meet[apart] = _meet(vertices[one[apart]], vertices[two[apart]])
    (hinged,) = np.nonzero(shared == 1)
    at_one, at_two = np.divmod(same[hinged].reshape(-1, 9).argmax(axis=1), 3)
    for face, other, at in ((one[hinged], two[hinged], at_one), (two[hinged], one[hinged], at_two)):
        opposite = np.take_along_axis(face, (at[:, None] + [1, 2]) % 3, axis=1)
        meet[hinged] |= _meet(vertices[opposite], vertices[other])
    found = pairs[meet]
    return np.asarray(found[np.lexsort((found[:, 1], found[:, 0]))], np.int32)


def _meet(one: FloatArray, two: FloatArray) -> NDArray[np.bool_]:
    """Return whether segments or triangles and triangles have a point in common, shape (K,).

    Args:
        one: Corners [m], shape (K, 2, 3) or (K, 3, 3).
        two: Corners [m], shape (K, 3, 3).
    """
    sure = _by_floats(one, two)
    found = sure == _MEET
    for k in np.flatnonzero(sure == _UNSURE):
        found[k] = not _apart(one[k], two[k])
    return np.asarray(found)


@njit(cache=True)
def _by_floats(one, two):  # type: ignore[no-untyped-def]
    """Return _MEET or _APART where floating point is sure, else _UNSURE, shape (K,)."""
    found = np.empty(len(one), np.int8)
    for k in range(len(one)):
        found[k] = _decide(one[k] - one[k, 0], two[k] - one[k, 0])
    return found


@njit(cache=True)
def _decide(one, two):  # type: ignore[no-untyped-def]
    """Return what floating point is sure of about two simplices: shapes (2 or 3, 3) and (3, 3), near the origin."""
    count = 6 if len(one) == 3 else 4
    edges = np.empty((count, 3))
    for k in range(3):
        edges[k] = two[(k + 1) % 3] - two[k]
    for k in range(count - 3):
        edges[3 + k] = one[(k + 1) % len(one)] - one[k]
    far = max(np.abs(one).max(), np.abs(two).max())
    longest = np.abs(edges).max()
    meet = True
    for i in range(count):
        for j in range(i):
            gap = _gap(one, two, np.cross(edges[j], edges[i]))
            if gap > _ERROR * longest**2 * far:
                return _APART
            meet &= gap < -_ERROR * longest**2 * far
    if meet:
        return _MEET
    normal = np.cross(edges[0], edges[1])
    for i in range(count):  # in one plane, or nearly, the gap is across their edges
        if _gap(one, two, np.cross(normal, edges[i])) > _ERROR * longest**3 * far:
            return _APART
    return _UNSURE


@njit(cache=True)
def _gap(one, two, axis):  # type: ignore[no-untyped-def]
    """Return how far apart two sets of points are along an axis; minus by how much they overlap."""
    here_low = there_low = np.inf
    here_high = there_high = -np.inf
    for k in range(len(one)):
        here = one[k, 0] * axis[0] + one[k, 1] * axis[1] + one[k, 2] * axis[2]
        here_low, here_high = min(here_low, here), max(here_high, here)
    for k in range(len(two)):
        there = two[k, 0] * axis[0] + two[k, 1] * axis[1] + two[k, 2] * axis[2]
        there_low, there_high = min(there_low, there), max(there_high, there)
    return max(there_low - here_high, here_low - there_high)


Exact = tuple[int, int, int]


def _apart(one: FloatArray, two: FloatArray) -> bool:
    """Return whether two simplices lie apart, without rounding.

    Along crosses of their edges and of the way between them, and along those turned within their planes: some of these
    part them even where both lie in one plane, on one line, or are one point.
    """
    points = _in_whole_numbers(np.vstack([one, two]))
    ours, theirs = points[: len(one)], points[len(one) :]
    ways = [_minus(b, a) for corners in (ours, theirs) for a, b in combinations(corners, 2)]
    ways.append(_minus(theirs[0], ours[0]))
    crosses = [_cross(u, v) for u, v in combinations(ways, 2)]
    turned = (_cross(n, u) for n in crosses for u in ways)
    for axis in chain(crosses, ways, turned):
        here, there = ([_dot(corner, axis) for corner in corners] for corners in (ours, theirs))
        if max(here) < min(there) or max(there) < min(here):
            return True
    return False


def _in_whole_numbers(points: FloatArray) -> list[Exact]:
    """Return points times the least power of two that makes whole numbers of all of them: no part is rounded."""
    ratios = [[float(part).as_integer_ratio() for part in point] for point in points]
    times = max(below for point in ratios for _, below in point)
    return [(x * (times // a), y * (times // b), z * (times // c)) for (x, a), (y, b), (z, c) in ratios]


def _minus(a: Exact, b: Exact) -> Exact:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _cross(a: Exact, b: Exact) -> Exact:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _dot(a: Exact, b: Exact) -> int:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
