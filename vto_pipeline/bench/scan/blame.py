"""What a scanned garment's error is made of: what was filled, what was seen wrong, what no photo could show."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vto_pipeline.bench.bench import Value
from vto_pipeline.bench.demo import SAMPLES
from vto_pipeline.geometry.rigid import transform_cameras
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_loops, concatenate
from vto_pipeline.io.captures.cameras import read_cameras, read_placement
from vto_pipeline.io.meshes import read_own_mesh
from vto_pipeline.io.runs.garments import read_observed
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.camera import CameraSet
from vto_pipeline.model.mesh import TriangleMesh

WRONG = 0.0015
"""A surface farther from the other is wrong, or missing [m]."""
ABSENT = 0.005
"""A place farther from the scan is not in it at all; nearer, it was scanned wrong [m]."""
BESIDE_RIM = 0.01
"""What was seen so near to an opening's rim is counted by itself [m]."""
ENOUGH = 3
"""Photos that a place needs: two to measure it, and one to confirm it."""
LEAST_COSINE = 0.17
"""A photo at a steeper slant than 80 degrees shows nothing of a place."""
SKIN = 0.003
"""A surface so little behind another is not hidden by it: layers touch [m]."""


def blame(run: Path, truth: TriangleMesh, form: TriangleMesh) -> dict[str, Value]:
    """Return what `wrong_shares` and `missing_shares` find of a finished run, as far as its files tell.

    Args:
        run: Folder of a scan.
        truth: The garment that was scanned, as an open shell.
        form: What it was on, in the same frame.
    """
    out = run / "out"
    garment = read_own_mesh(out / "garment.ply")
    found = dict(wrong_shares(garment, read_observed(out / "observed.npz"), truth))
    cameras = cameras_beside_form(run)
    return found if cameras is None else found | missing_shares(garment, truth, form, cameras)


def cameras_beside_form(run: Path) -> CameraSet | None:
    """Return the cameras of a finished run's photos in the frame of the form; None where its files do not tell them."""
    cameras, placement = run / "out" / "cameras.json", run / "out" / "garment_placement.json"
    if not (cameras.is_file() and placement.is_file()):
        return None
    return transform_cameras(read_cameras(cameras), read_placement(placement))


def wrong_shares(garment: TriangleMesh, observed: NDArray[np.bool_], truth: TriangleMesh) -> dict[str, Value]:
    """Return how much of a garment is wrong, in per cent of its area: filled, seen beside a rim, and seen elsewhere.

    Args:
        garment: In the frame of the truth [m].
        observed: Which of its vertices a sensor saw, shape (V,).
        truth: Open shell [m].
    """
    points, _, face = sample_surface(garment, SAMPLES, seed=0)
    wrong = SurfaceDistance(truth).nearest(points).distance > WRONG
    filled = ~np.asarray(observed[garment.faces].all(axis=1))[face]
    rim = np.zeros(len(points), dtype=bool)
    loops = boundary_loops(garment)
    if loops:
        near, _ = cKDTree(garment.vertices[np.concatenate(loops)]).query(points, distance_upper_bound=BESIDE_RIM)
        rim = np.isfinite(near)
    parts = {"filled": filled, "rim": rim & ~filled, "seen": ~rim & ~filled}
    return {f"wrong_{name}_percent": 100.0 * float((wrong & part).mean()) for name, part in parts.items()}


def missing_shares(
    garment: TriangleMesh, truth: TriangleMesh, form: TriangleMesh, cameras: CameraSet
) -> dict[str, Value]:
    """Return how much of the truth is missing, in per cent of its area: what too few photos show, and the rest; and
    how much of the rest is absent, not only wrong.

    Args:
        garment: In the frame of the truth [m].
        truth: Open shell, oriented outward [m].
        form: What it was on [m].
        cameras: Of the photos, in that frame.
    """
    points, normals, _ = sample_surface(truth, SAMPLES, seed=0)
    away = SurfaceDistance(garment).nearest(points).distance
    shown = photos_that_show(points, normals, concatenate([truth, form]), cameras) >= ENOUGH
    parts = {
        "missing_hidden": ~shown & (away > WRONG),
        "missing_shown": shown & (away > WRONG),
        "absent_shown": shown & (away > ABSENT),
    }
    return {f"{name}_percent": 100.0 * float(part.mean()) for name, part in parts.items()}


def photos_that_show(points: FloatArray, normals: FloatArray, scene: TriangleMesh, cameras: CameraSet) -> IntArray:
    """Count the photos that show each point from its outer side, shape (P,).

    Args:
        points: On the scene [m], shape (P, 3).
        normals: Outward, unit, shape (P, 3).
        scene: All that may stand in the way [m].
        cameras: Whose distortion is not regarded.
    """
    import open3d as o3d

    core: Any = o3d.core  # its stubs know no NumPy array
    rays = o3d.t.geometry.RaycastingScene()
    rays.add_triangles(core.Tensor(scene.vertices.astype(np.float32)), core.Tensor(scene.faces.astype(np.uint32)))
    count: IntArray = np.zeros(len(points), np.int32)
    for lens, pose in zip(cameras.intrinsics, cameras.world_from_cam, strict=True):
        eye = pose[:3, 3]
        way = points - eye
        away = np.linalg.norm(way, axis=1)
        local = way @ pose[:3, :3]
        ahead = local[:, 2] > 0
        z = np.where(ahead, local[:, 2], 1.0)
        u, v = lens.fx * local[:, 0] / z + lens.cx, lens.fy * local[:, 1] / z + lens.cy
        inside = ahead & (u >= 0) & (v >= 0) & (u <= lens.width - 1) & (v <= lens.height - 1)
        cast = np.column_stack([np.broadcast_to(eye, way.shape), way / away[:, None]]).astype(np.float32)
        free = rays.cast_rays(core.Tensor(cast))["t_hit"].numpy() > away - SKIN
        count += inside & free & ((way * normals).sum(axis=1) < -LEAST_COSINE * away)
    return count
