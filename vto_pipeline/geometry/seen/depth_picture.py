"""How far away a surface is, pixel by pixel."""

from __future__ import annotations

import numpy as np

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.rasterise import projected, rasterise_depth

NEAREST = 1e-6
"""What is no farther ahead than this is not before the camera [m]."""


def depth_picture(mesh: TriangleMesh, camera: Intrinsics, cam_from_world: FloatArray) -> FloatArray:
    """Return the depth of the nearest surface of each pixel [m], shape (H, W); infinite where there is none.

    Args:
        mesh: The surface [m].
        camera: Whose distortion is not regarded.
        cam_from_world: Rigid transform [m], shape (4, 4).
    """
    placed = pixels_of(mesh, camera, cam_from_world)
    return np.asarray(rasterise_depth(placed, mesh.faces, camera.width, camera.height))


def pixels_of(mesh: TriangleMesh, camera: Intrinsics, cam_from_world: FloatArray) -> FloatArray:
    """Return column, row and depth [m] of each vertex, shape (V, 3); zeros for those not before the camera.

    Args:
        mesh, camera, cam_from_world: As for `depth_picture`.
    """
    lens = (camera.fx, camera.fy, camera.cx, camera.cy)
    return np.asarray(projected(mesh.vertices, np.ascontiguousarray(cam_from_world), lens, NEAREST))
