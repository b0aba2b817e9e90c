"""Crossings of a drape by ipctk, which is none of ours."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh


def crossings(cloth: TriangleMesh, body: TriangleMesh) -> int:
    """Return how many edges of cloth or body go through triangles of the other; one more where the cloth meets itself.

    Args:
        cloth, body: As they are draped [m].
    """
    import ipctk

    points = np.asfortranarray(cloth.vertices)
    itself = ipctk.has_intersections(ipctk.CollisionMesh(points, ipctk.edges(cloth.faces), cloth.faces), points)
    return _through(cloth, body) + _through(body, cloth) + int(itself)


def _through(one: TriangleMesh, other: TriangleMesh) -> int:
    """Return how many edges of one mesh go through triangles of another."""
    import ipctk

    ends, corners = one.vertices[ipctk.edges(one.faces)], other.vertices[other.faces]
    lengths = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
    middles = corners.mean(axis=1)
    reach = np.linalg.norm(corners - middles[:, None], axis=2).max()
    tree = cKDTree(middles)
    near = tree.query_ball_point(ends.mean(axis=1), 0.5 * lengths + reach)
    return sum(_pierces(edge, corners[faces]) for edge, faces in zip(ends, near, strict=True) if faces)


def _pierces(edge: FloatArray, triangles: FloatArray) -> bool:
    """Return whether an edge (2, 3) goes through one of triangles (N, 3, 3)."""
    import ipctk

    apart = (edge.min(axis=0) > triangles.max(axis=1)) | (edge.max(axis=0) < triangles.min(axis=1))
    return any(ipctk.is_edge_intersecting_triangle(*edge, *one) for one in triangles[~apart.any(axis=1)])
