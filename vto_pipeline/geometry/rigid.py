"""Moving a mesh, or cameras, as a whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.camera import CameraSet
from vto_pipeline.model.mesh import TriangleMesh


def transform_mesh(mesh: TriangleMesh, target_from_mesh: FloatArray) -> TriangleMesh:
    """The mesh in another frame.

    Args:
        mesh: A mesh [m].
        target_from_mesh: Rigid or similarity transform, shape (4, 4).
    """
    return replace(mesh, vertices=mesh.vertices @ target_from_mesh[:3, :3].T + target_from_mesh[:3, 3])


def transform_cameras(cameras: CameraSet, target_from_world: FloatArray) -> CameraSet:
    """The cameras in another frame; a similarity moves them and leaves their axes at unit length.

    Args:
        cameras: Posed photos.
        target_from_world: Rigid or similarity transform, shape (4, 4).
    """
    scale = np.cbrt(np.linalg.det(target_from_world[:3, :3]))
    moved = target_from_world @ cameras.world_from_cam
    moved[:, :3, :3] /= scale
    return replace(cameras, world_from_cam=moved)
