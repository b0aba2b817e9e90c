"""An avatar's measuring loops as ribbons on its skin."""

from __future__ import annotations

import numpy as np

from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.mesh import TriangleMesh

_HALF_WIDTH_M = 0.0025
_ABOVE_SKIN_M = 0.002


def loop_ribbons(avatar: Avatar) -> TriangleMesh:
    """Return all named loops of the posed body as flat bands that lie on it."""
    normals = vertex_normals(avatar.mesh)
    vertices, faces, first = [], [], 0
    for loop in avatar.loops.values():
        on_skin = avatar.vertices[loop] + _ABOVE_SKIN_M * normals[loop]
        along = np.roll(on_skin, -1, axis=0) - np.roll(on_skin, 1, axis=0)
        across = np.cross(normals[loop], along)
        across *= _HALF_WIDTH_M / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
        count = len(loop)
        here = first + np.arange(count)
        there = first + (np.arange(count) + 1) % count
        vertices += [on_skin - across, on_skin + across]
        # normal x along = across: this way round, the band faces outwards
        faces += [np.column_stack([here, there, there + count]), np.column_stack([here, there + count, here + count])]
        first += 2 * count
    return TriangleMesh(np.concatenate(vertices), np.concatenate(faces).astype(np.int32))
