"""Clouds like a laser scanner's: several stations merged, small noise, holes where nothing was seen."""

from __future__ import annotations

import numpy as np

from vto_pipeline.bench.samples.captures.render import PICTURE, RenderScene, pixel_rays
from vto_pipeline.bench.samples.captures.viewpoints import on_ring
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.mesh import PointCloud

SIGMA = 0.0003  # along the beam [m]
FAN = Intrinsics(900, 900, 900.0, 900.0, 449.5, 449.5)  # beams of one station
GRAZING = 0.2  # cosine of incidence below which nothing comes back


def scan_stations(
    scene: RenderScene, stations: FloatArray, holes: list[tuple[FloatArray, float]], count: int, seed: int
) -> PointCloud:
    """Scan a scene.

    Args:
        scene: What is scanned; the floor and pictures on it are left out.
        stations: Poses of the scanner, shape (S, 4, 4).
        holes: Centre [m] and diameter [m] of places without points.
        count: Points kept.
        seed: Of the noise and of the choice.

    Returns:
        `count` points spread evenly, without normals.
    """
    rng = np.random.default_rng(seed)
    points = np.concatenate([_one_station(scene, pose, rng) for pose in stations])
    for center, diameter in holes:
        points = points[np.linalg.norm(points - center, axis=1) > 0.5 * diameter]
    points = points[rng.permutation(len(points))]
    cell = 0.5 * np.sqrt(_area(scene) / count)
    _, first = np.unique(np.floor(points / cell).astype(np.int64), axis=0, return_index=True)
    chosen = np.sort(rng.permutation(np.sort(first))[:count])
    return PointCloud(points[chosen])


def around_stations(
    count: int, distance: float, heights: tuple[float, ...], elevations_deg: tuple[float, ...]
) -> FloatArray:
    """Stations on a ring for each height looked at, shape (S, 4, 4)."""
    poses = []
    for height, elevation in zip(heights, elevations_deg, strict=True):
        for turn in np.arange(count) * 360.0 / count + 3.0 * elevation:
            poses.append(on_ring(distance, elevation, turn, np.array([0.0, height, 0.0])))
    return np.array(poses)


def _one_station(scene: RenderScene, pose: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Points seen from one pose, shape (N, 3)."""
    rays = pixel_rays(FAN, pose)
    hit = {name: value.numpy() for name, value in scene.rays.cast_rays(rays).items()}
    found = np.isfinite(hit["t_hit"])
    beams = rays[found].astype(np.float64)
    reach = np.linalg.norm(beams[:, 3:], axis=1)
    direction = beams[:, 3:] / reach[:, None]
    solid = scene.paints[hit["geometry_ids"][found]] < PICTURE
    solid &= np.abs((hit["primitive_normals"][found] * direction).sum(axis=1)) > GRAZING
    distance = hit["t_hit"][found] * reach + rng.normal(0.0, SIGMA, len(reach))
    points: FloatArray = (beams[:, :3] + distance[:, None] * direction)[solid]
    return points


def _area(scene: RenderScene) -> float:
    """Area of all scanned triangles [m²]."""
    kept = np.repeat(scene.paints < PICTURE, np.diff(scene.face_start))
    a, b, c = (scene.vertices[scene.faces[kept, i]] for i in range(3))
    return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
