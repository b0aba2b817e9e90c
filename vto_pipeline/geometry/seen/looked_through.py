"""How many cameras look through a place to a surface behind it: the place is empty."""

from __future__ import annotations

from typing import Any

import numpy as np

from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.camera import CameraSet
from vto_pipeline.model.mesh import TriangleMesh


def cameras_through(points: FloatArray, surface: TriangleMesh, cameras: CameraSet, behind: float) -> IntArray:
    """Count the cameras that see a surface through each point, shape (N,).

    A surface that turns its back to a camera was not seen by it: something hid it that is missing in the surface.

    Args:
        points: In the surface's frame [m], shape (N, 3).
        surface: All that was seen, oriented outward [m].
        cameras: That saw it. Their distortion is not regarded.
        behind: The surface must be farther off by so much [m].
    """
    import open3d as o3d

    core: Any = o3d.core  # its stubs know no NumPy array
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(core.Tensor(surface.vertices.astype(np.float32)), core.Tensor(surface.faces.astype(np.uint32)))
    count: IntArray = np.zeros(len(points), dtype=np.int32)
    for lens, pose in zip(cameras.intrinsics, cameras.world_from_cam, strict=True):
        way = points - pose[:3, 3]
        away = np.linalg.norm(way, axis=1)
        x, y, z = (way @ pose[:3, :3]).T
        ahead = z > 0.0
        depth = np.where(ahead, z, 1.0)
        column, row = lens.fx * x / depth + lens.cx, lens.fy * y / depth + lens.cy
        shown = ahead & (column >= 0) & (column <= lens.width - 1) & (row >= 0) & (row <= lens.height - 1)
        way /= np.maximum(away, 1e-12)[:, None]
        start = np.broadcast_to(pose[:3, 3], way.shape)
        hit = scene.cast_rays(core.Tensor(np.column_stack([start, way]).astype(np.float32)))
        reached = hit["t_hit"].numpy()
        faces_it = np.einsum("nd,nd->n", hit["primitive_normals"].numpy(), way) < 0.0
        count += shown & np.isfinite(reached) & (reached > away + behind) & faces_it
    return count
