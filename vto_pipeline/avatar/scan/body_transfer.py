"""Motion of a body mesh of any topology, driven by the avatar registered to it.

So the last keyframe is the mesh itself, to the bit, and no switch from a registration to the true surface is needed.
"""

from __future__ import annotations

import numpy as np

from vto_pipeline.geometry.closest import barycentric, closest_points
from vto_pipeline.geometry.topology import face_normals
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.mesh import TriangleMesh


def transfer_motion(mesh: TriangleMesh, motion: MovingBody) -> MovingBody:
    """Return the motion of a mesh that ends as it is.

    Each vertex keeps its place on the nearest triangle of the motion's end and its offset in that triangle's frame.
    Offsets are what the registration missed: small, so that they are turned but not scaled.

    Args:
        mesh: Where the motion ends [m].
        motion: Of an avatar registered to it.
    """
    end = motion.keyframes[-1]
    face, closest, _ = closest_points(mesh.vertices, end, motion.faces)
    corners = motion.faces[face]
    shares = barycentric(closest, end[corners])
    offset = mesh.vertices - closest
    to_frame = np.einsum("nij,ni->nj", _frames(end, motion.faces)[face], offset)
    frames = np.stack(
        [
            np.einsum("nk,nkd->nd", shares, vertices[corners])
            + np.einsum("nij,nj->ni", _frames(vertices, motion.faces)[face], to_frame)
            for vertices in motion.keyframes
        ]
    )
    frames[-1] = mesh.vertices
    return MovingBody(frames, mesh.faces)


def _frames(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return along the first edge, across it, and normal, as columns, for each triangle, shape (F, 3, 3)."""
    normal = face_normals(TriangleMesh(vertices, faces))
    along = vertices[faces[:, 1]] - vertices[faces[:, 0]]
    along = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    return np.stack([along, np.cross(normal, along), normal], axis=2)
