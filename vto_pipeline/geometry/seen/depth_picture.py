"""How far away a surface is, pixel by pixel."""

from __future__ import annotations

import numpy as np

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.rasterise import rasterise_depth


def depth_picture(mesh: TriangleMesh, camera: Intrinsics, cam_from_world: FloatArray) -> FloatArray:
    """Return the depth of the nearest surface of each pixel [m], shape (H, W); infinite where there is none.

    Args:
        mesh: The surface [m].
        camera: Whose distortion is not regarded.
        cam_from_world: Rigid transform [m], shape (4, 4).
    """
    local = mesh.vertices @ cam_from_world[:3, :3].T + cam_from_world[:3, 3]
    ahead = local[:, 2] > 1e-6
    z = np.where(ahead, local[:, 2], 1.0)
    placed = np.column_stack(
        [camera.fx * local[:, 0] / z + camera.cx, camera.fy * local[:, 1] / z + camera.cy, np.where(ahead, z, 0.0)]
    )
    return np.asarray(rasterise_depth(placed, mesh.faces, camera.width, camera.height))
