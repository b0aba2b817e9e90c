"""Moving a mesh as a whole."""

from __future__ import annotations

from dataclasses import replace

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh


def transform_mesh(mesh: TriangleMesh, target_from_mesh: FloatArray) -> TriangleMesh:
    """The mesh in another frame.

    Args:
        mesh: A mesh [m].
        target_from_mesh: Rigid or similarity transform, shape (4, 4).
    """
    return replace(mesh, vertices=mesh.vertices @ target_from_mesh[:3, :3].T + target_from_mesh[:3, 3])
