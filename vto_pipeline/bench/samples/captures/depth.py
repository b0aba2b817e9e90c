"""Depth frames with the faults of a real structured-light camera."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image
from scipy.ndimage import maximum_filter, minimum_filter

from vto_pipeline.bench.samples.captures.photos import exposed
from vto_pipeline.bench.samples.captures.render import PICTURE, RenderScene, pixel_rays, render
from vto_pipeline.bench.samples.captures.viewpoints import on_ring
from vto_pipeline.io.documents import write_json
from vto_pipeline.io.files import replacing
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.camera import Intrinsics

SCALE = 1000.0  # stored units per metre
BASELINE = 0.075  # between projector and camera [m]
SUBPIXEL = 8.0  # disparity steps per pixel
LATERAL = 0.4  # standard deviation of where a pixel looks [px]
EDGE = 0.02  # a depth step this large between neighbours is an edge [m]
LOST_AT_EDGE, FLYING, LOST_ANYWHERE = 0.30, 0.12, 0.003  # shares of pixels
GRAZING = (0.12, 0.35)  # cosine of incidence: all readings lost below the first, none above the second
FLIGHT = 0.015  # how far behind the silhouette a flying pixel lands on average [m]
QUALITY = 78


def axial_sigma(depth: FloatArray) -> FloatArray:
    """Standard deviation of a reading [m]: 1.2 mm + 1.9 mm (z - 0.4)², z in m (Nguyen, Izadi, Lovell 2012, eq. 2)."""
    return 0.0012 + 0.0019 * np.square(depth - 0.4)


def quantized(depth: FloatArray, focal: float) -> FloatArray:
    """Depth as it comes from a disparity known to 1 / SUBPIXEL px: steps of z² / (f b SUBPIXEL) (Khoshelham 2012)."""
    return focal * BASELINE * SUBPIXEL / np.rint(focal * BASELINE * SUBPIXEL / depth)


def noisy_depth(depth: FloatArray, incidence: FloatArray, focal: float, rng: np.random.Generator) -> FloatArray:
    """What the camera reports.

    Args:
        depth: True depth along the axis [m], inf where there is nothing in range, shape (H, W).
        incidence: Cosine between surface normal and ray, shape (H, W).
        focal: [px].
        rng: Source of the noise.

    Returns:
        Depth [m], 0 where there is no reading, shape (H, W).
    """
    seen = np.isfinite(depth)
    true = np.where(seen, depth, 1.0)
    reading = quantized(true + axial_sigma(true) * rng.normal(size=depth.shape), focal)

    nearest, farthest = minimum_filter(depth, 3), maximum_filter(depth, 3)
    edge = seen & (farthest - np.where(np.isfinite(nearest), nearest, 0.0) > EDGE)
    fate = rng.random(depth.shape)
    behind = np.where(np.isfinite(farthest), farthest - true, np.inf)
    flight = np.minimum(rng.exponential(FLIGHT, depth.shape), behind)
    reading = np.where(edge & (fate < FLYING), reading + flight, reading)
    lost = edge & (fate > 1.0 - LOST_AT_EDGE)
    lost |= rng.random(depth.shape) < LOST_ANYWHERE
    lost |= rng.random(depth.shape) > (incidence - GRAZING[0]) / (GRAZING[1] - GRAZING[0])
    return np.where(seen & ~lost, reading, 0.0)


def depth_frame(
    scene: RenderScene, camera: Intrinsics, world_from_cam: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """One frame with its faults, shape (H, W) [m]. The floor and its board give no reading."""
    rays = pixel_rays(camera, world_from_cam)
    jitter = rng.normal(0.0, LATERAL, (*rays.shape[:2], 2)) / [camera.fx, camera.fy]
    rays[..., 3:] += (jitter @ world_from_cam[:3, :2].T).astype(np.float32)
    hit = {name: value.numpy() for name, value in scene.rays.cast_rays(rays).items()}
    shape = np.where(np.isfinite(hit["t_hit"]), hit["geometry_ids"], 0)
    solid = np.isfinite(hit["t_hit"]) & (scene.paints[shape] < PICTURE)
    depth = np.where(solid, hit["t_hit"].astype(np.float64), np.inf)
    direction = rays[..., 3:] / np.linalg.norm(rays[..., 3:], axis=-1, keepdims=True)
    incidence = np.abs((hit["primitive_normals"] * direction).sum(axis=-1))
    return noisy_depth(depth, incidence, camera.fx, rng)


def around(
    count: int, turn_deg: float, distance: float, height: float, elevations_deg: tuple[float, float]
) -> FloatArray:
    """Poses of a walk around the axis: the elevation swings twice between two values, the hand shakes; (N, 4, 4)."""
    rng = np.random.default_rng(count)
    share = np.arange(count) / (count - 1)
    low, high = elevations_deg
    elevation = 0.5 * (low + high) - 0.5 * (high - low) * np.cos(4.0 * np.pi * share)
    poses = []
    for part, up in zip(share, elevation, strict=True):
        target = np.array([0.0, height, 0.0]) + rng.normal(0.0, 0.006, 3)
        poses.append(on_ring(distance * (1.0 + rng.normal(0.0, 0.006)), up, turn_deg * part, target))
    return np.array(poses)


def write_depth_frames(folder: Path, scene: RenderScene, camera: Intrinsics, poses: FloatArray, seed: int) -> None:
    """Write depth/*.png, color/*.jpg and intrinsics.json."""
    for index, pose in enumerate(poses):
        rng = np.random.default_rng([seed, index])
        stored = np.rint(SCALE * depth_frame(scene, camera, pose, rng)).astype(np.uint16)
        with replacing(folder / "depth" / f"{index:06d}.png") as beside:
            Image.fromarray(stored).save(beside, compress_level=9)
        with replacing(folder / "color" / f"{index:06d}.jpg") as beside:
            Image.fromarray(exposed(render(scene, camera, pose), seed + index)).save(beside, quality=QUALITY)
    lens = {name: getattr(camera, name) for name in ("width", "height", "fx", "fy", "cx", "cy")}
    write_json(folder / "intrinsics.json", {**lens, "depth_scale": SCALE})
