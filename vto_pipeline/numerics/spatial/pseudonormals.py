"""Pseudonormals of faces, edges and vertices, whose sign separates inside from outside.

Bærentzen & Aanæs 2005, "Signed distance computation using the angle weighted pseudonormal": the sign of (x - p) · n is
right when p is the nearest point of a closed surface and n the pseudonormal of the feature p lies on.
"""

from __future__ import annotations

from math import acos
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.numerics.distance import EDGE, FACE
from vto_pipeline.numerics.vector import add, cross, dot, load, scale, store, sub, unit


class Pseudonormals(NamedTuple):
    """Not of unit length; zero on the rim of an open surface, where there is no inside.

    Args:
        face_edges: Edge from corner k to k+1 of each face, shape (F, 3).
        rim_edges, rim_vertices: Which lie on the rim, shapes (E,) and (V,), bool.
        faces, edges, vertices: Normals, shapes (F, 3), (E, 3), (V, 3).
    """

    face_edges: NDArray[np.int32]
    rim_edges: NDArray[np.bool_]
    rim_vertices: NDArray[np.bool_]
    faces: NDArray[np.float64]
    edges: NDArray[np.float64]
    vertices: NDArray[np.float64]


def pseudonormals(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> Pseudonormals:
    """Return the pseudonormals of a surface; vertices of shape (V, 3), faces (F, 3)."""
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2), axis=2).reshape(-1, 2).astype(np.int64)
    key, edge, count = np.unique(ends[:, 0] * len(vertices) + ends[:, 1], return_inverse=True, return_counts=True)
    rim = count == 1
    rim_vertices = np.zeros(len(vertices), np.bool_)
    rim_vertices[np.concatenate(np.divmod(key[rim], len(vertices)))] = True
    normals = Pseudonormals(
        edge.reshape(-1, 3).astype(np.int32),
        rim,
        rim_vertices,
        np.empty((len(faces), 3)),
        np.empty((len(key), 3)),
        np.empty((len(vertices), 3)),
    )
    update_pseudonormals(normals, vertices, faces)
    return normals


@njit(cache=True)
def update_pseudonormals(normals, vertices, faces):
    """Recompute the normals for moved vertices, in place."""
    normals.edges[:] = 0.0
    normals.vertices[:] = 0.0
    slivers = 0
    for f in range(len(faces)):
        a, b, c = load(vertices, faces[f, 0]), load(vertices, faces[f, 1]), load(vertices, faces[f, 2])
        n = unit(cross(sub(b, a), sub(c, a)))
        slivers += n == (0.0, 0.0, 0.0)
        _accumulate(normals, vertices, faces, f, n)
    if slivers > 0:
        for f in range(len(faces)):
            if load(normals.faces, f) == (0.0, 0.0, 0.0):  # where others meet in a line it is the seam: as they face
                around = (0.0, 0.0, 0.0)
                for k in range(3):
                    around = add(around, load(normals.edges, normals.face_edges[f, k]))
                _accumulate(normals, vertices, faces, f, unit(around))
    for e in range(len(normals.edges)):
        if normals.rim_edges[e]:
            store(normals.edges, e, (0.0, 0.0, 0.0))
    for v in range(len(normals.vertices)):
        if normals.rim_vertices[v]:
            store(normals.vertices, v, (0.0, 0.0, 0.0))


@njit(cache=True)
def _accumulate(normals, vertices, faces, f, n):
    """Note the normal of a face, and add it to those of its edges and, by their angles, of its vertices."""
    store(normals.faces, f, n)
    for k in range(3):
        e, v = normals.face_edges[f, k], faces[f, k]
        store(normals.edges, e, add(load(normals.edges, e), n))
        out = unit(sub(load(vertices, faces[f, (k + 1) % 3]), load(vertices, v)))
        back = unit(sub(load(vertices, faces[f, (k + 2) % 3]), load(vertices, v)))
        angle = acos(min(1.0, max(-1.0, dot(out, back))))
        store(normals.vertices, v, add(load(normals.vertices, v), scale(angle, n)))


@njit(cache=True)
def feature_normal(normals, faces, triangle, feature):
    """Return the pseudonormal of a feature (as in `distance`) of a triangle."""
    if feature == FACE:
        return load(normals.faces, triangle)
    if feature >= EDGE:
        return load(normals.edges, normals.face_edges[triangle, feature - EDGE])
    return load(normals.vertices, faces[triangle, feature])
