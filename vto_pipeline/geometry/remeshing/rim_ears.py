"""Triangles with two sides on a rim, as flat as it is: the side that is not is flipped."""

from __future__ import annotations

import numpy as np

from vto_pipeline.geometry.topology import opposite_half_edges
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh


def flip_ears(mesh: TriangleMesh) -> TriangleMesh:
    """Return the mesh without ears that are sharper than what a flip makes of them and the triangle beside them.

    Three vertices in a row on a rim may be a triangle of their own. On a straight rim that has hardly any area: its tip
    weighs nothing, and what bends across its long side has hardly a lever. Rims keep their vertices.

    Args:
        mesh: Manifold and oriented.
    """
    opposite = opposite_half_edges(mesh).reshape(-1, 3)
    faces, changed = mesh.faces.copy(), np.zeros(len(mesh.faces), np.bool_)
    for f in np.flatnonzero((opposite >= 0).sum(axis=1) == 1).tolist():
        k = int(opposite[f].argmax())
        g, m = divmod(int(opposite[f, k]), 3)
        if changed[f] or changed[g]:
            continue
        a, b, tip = np.roll(mesh.faces[f], -k)
        c = mesh.faces[g, (m + 2) % 3]
        before, after = mesh.faces[[f, g]], np.array([[tip, a, c], [tip, c, b]], faces.dtype)
        if _least_sine(mesh.vertices, after) > _least_sine(mesh.vertices, before):
            faces[[f, g]] = after
            changed[[f, g]] = True
    return TriangleMesh(mesh.vertices, faces) if changed.any() else mesh


def _least_sine(vertices: FloatArray, faces: IntArray) -> float:
    """Return the least sine of an angle of these faces."""
    corners = vertices[faces]
    side = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return float((area * side.min(axis=1) / np.maximum(side.prod(axis=1), np.finfo(float).tiny)).min())
