"""Tangential motion of vertices: the template's rows move, the surface stays."""

from __future__ import annotations

import numpy as np

from vto_pipeline.geometry.closest import barycentric, closest_points
from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

_ROUND = 0.5
"""Where an edge's ends lie on a circle, half the way to their tangents is the circle, to second order."""


def slide_along_surface(vertices: FloatArray, faces: IntArray, shift: FloatArray) -> FloatArray:
    """Return the vertices moved along their own surface, shape (V, 3).

    They are put where the shifted ones are nearest to the surface, rounded as its normals say (Phong tessellation,
    Boubekeur and Alexa 2008): on the flat faces a convex body would lose girth at every slide_along_surface.

    Args:
        vertices: [m], shape (V, 3).
        faces: Shape (F, 3).
        shift: Where to [m], shape (V, 3); small against the body's roundness.
    """
    face, flat, _ = closest_points(vertices + shift, vertices, faces)
    corners = vertices[faces[face]]
    normals = vertex_normals(TriangleMesh(vertices, faces))[faces[face]]
    shares = barycentric(flat, corners)
    above = ((flat[:, None] - corners) * normals).sum(axis=2, keepdims=True)
    # the mean of the point's places on the corners' tangent planes
    rounded: FloatArray = flat - _ROUND * np.einsum("nk,nkd->nd", shares, above * normals)
    return rounded
