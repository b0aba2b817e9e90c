"""All places of a body that support a point, not only the nearest: the flanks of a hollow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

_SAME = 1e-9  # m: what differs by less is one distance


def flanks(
    body: TriangleMesh, points: FloatArray, inside: NDArray[np.bool_], within: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Return the directions in which a body's surface may push points: those in which its distance has a minimum.

    Args:
        body: Triangles oriented outward.
        points: [m], shape (N, 3).
        inside: Which points are inside the body, shape (N,).
        within: What is farther away does not push each of them [m], shape (N,).

    Returns:
        Which point, shape (K,), in order; and a unit vector outward, shape (K, 3). A place at which several triangles
        meet may be told by each of them.
    """
    import trimesh

    corners = body.vertices[body.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    solid = np.linalg.norm(normal, axis=1) > 0.0
    corners, normal = corners[solid], normal[solid]
    owner, face = _in_reach(corners, points, within)
    place = np.asarray(trimesh.triangles.closest_point(corners[face], points[owner])).reshape(-1, 3)
    away = points[owner] - place
    distance = np.linalg.norm(away, axis=1)
    near = (distance <= within[owner]) & (distance > 0.0)
    owner, face, place, away, distance = owner[near], face[near], place[near], away[near], distance[near]

    one, other = _of_one_point(owner)
    lower = distance[other] < distance[one] - _SAME
    one, other = one[lower], other[lower]
    beside = np.asarray(trimesh.triangles.closest_point(corners[face[other]], place[one])).reshape(-1, 3)
    descends = np.zeros(len(owner), np.bool_)  # where its place ends a triangle, beyond which the surface comes nearer
    descends[one[np.linalg.norm(beside - place[one], axis=1) < _SAME]] = True

    outward = away / distance[:, None] * np.where(inside[owner], -1.0, 1.0)[:, None]
    fronts = np.sum(outward * normal[face], axis=1) > 0.0  # else it is seen through the body
    chosen = fronts & ~descends
    return owner[chosen], outward[chosen]


def _in_reach(corners: FloatArray, points: FloatArray, within: FloatArray) -> tuple[IntArray, IntArray]:
    """Return pairs of points, in order, and of triangles that may be this near, both of shape (K,)."""
    middle = corners.mean(axis=1)
    radius = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    size = np.ceil(np.log2(radius))
    found = []
    for octave in np.unique(size):  # else one long triangle would bring every other near to everything
        (faces,) = np.nonzero(size == octave)
        about = cKDTree(middle[faces]).query_ball_point(points, within + 2.0**octave)
        owner = np.repeat(np.arange(len(points)), [len(one) for one in about])
        face = faces[np.concatenate([*about, []]).astype(np.int64)]
        apart = np.linalg.norm(points[owner] - middle[face], axis=1)
        near = apart <= within[owner] + radius[face]
        found.append(np.column_stack([owner[near], face[near]]))
    pairs = np.vstack([np.zeros((0, 2), np.int64), *found])
    pairs = pairs[np.lexsort(pairs.T[::-1])].astype(np.int32)
    return pairs[:, 0], pairs[:, 1]


def _of_one_point(owner: IntArray) -> tuple[IntArray, IntArray]:
    """Return all ordered pairs of entries of the same owner, shape (K,) each; owners in order."""
    first = np.searchsorted(owner, owner, "left")
    count = np.searchsorted(owner, owner, "right") - first
    one = np.repeat(np.arange(len(owner)), count)
    other = np.arange(len(one)) - np.repeat(np.cumsum(count) - count - first, count)
    return one.astype(np.int32), other.astype(np.int32)
