"""From a front and a side picture to girths: error and interval, against stature alone."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.avatar.from_silhouettes import SilhouettesConfig, fit_silhouettes
from vto_pipeline.avatar.measure import measure
from vto_pipeline.avatar.population import complete
from vto_pipeline.avatar.pose import named_pose
from vto_pipeline.bench.bench import Measured, Row, Watch
from vto_pipeline.bench.body.people import ASKED, drawn
from vto_pipeline.bench.timing import Timing
from vto_pipeline.model.arrays import ByteArray
from vto_pipeline.model.body import Measurements
from vto_pipeline.model.frames import Silhouettes
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

GIRTHS = ("chest_girth", "waist_girth", "hip_girth")
_HEIGHT, _WIDTH = 800, 600
_LENS_HEIGHT_M = 1.0
_BACKDROP, _BODY, _NOISE = 205.0, 95.0, 4.0


def silhouette_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """Random people of either sex before a plain backdrop."""
    count = 1 if quick else 20
    for sex in ("female",) if quick else ("female", "male"):
        yield watch.row(
            f"{sex}, two outlines",
            "silhouettes",
            {"people": count},
            _HEIGHT * _WIDTH,
            lambda sex=sex: _people(sex, count),  # type: ignore[misc]
        )


def photograph(body: TriangleMesh, yaw: float, distance: float, seed: int) -> ByteArray:
    """Return a grey picture through a pinhole at a height of one metre, shape (H, W, 3).

    Args:
        body: Standing on y = 0 about the origin.
        yaw: How far it has turned from facing the camera [rad].
        distance: Of the camera from its axis [m].
        seed: Of the noise.
    """
    import open3d as o3d

    cos, sin = np.cos(yaw), np.sin(yaw)
    turned = body.vertices @ np.array([[cos, 0.0, -sin], [0.0, 1.0, 0.0], [sin, 0.0, cos]])
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor.from_numpy(turned.astype(np.float32)), o3d.core.Tensor.from_numpy(body.faces.astype(np.uint32))
    )
    stature = float(np.ptp(body.vertices[:, 1]))
    focal = 0.85 * _HEIGHT * (distance - 0.2) / stature
    column, row = np.meshgrid(np.arange(_WIDTH) + 0.5, np.arange(_HEIGHT) + 0.5)
    up = (0.5 * _HEIGHT - row) / focal + (0.5 * stature - _LENS_HEIGHT_M) / distance
    across = (column - 0.5 * _WIDTH) / focal
    ahead = np.stack([across, up, -np.ones_like(up)], axis=2)
    eye = np.broadcast_to([0.0, _LENS_HEIGHT_M, distance], ahead.shape)
    rays = np.concatenate([eye, ahead], axis=2).astype(np.float32)
    hit = np.isfinite(scene.cast_rays(o3d.core.Tensor.from_numpy(rays))["t_hit"].numpy())
    grey = np.where(hit, _BODY, _BACKDROP)[:, :, None] + np.random.default_rng(seed).normal(
        0.0, _NOISE, (_HEIGHT, _WIDTH, 3)
    )
    return np.clip(grey, 0, 255).astype(np.uint8)


def _people(sex: str, count: int) -> Measured:
    seconds, wrong, null, held = [], [], [], []
    for seed in range(count):
        known = drawn(sex, seed)
        body = named_pose(
            fit_measurements(Measurements({name: known.values[name] for name in ASKED}, sex=sex)), "a_pose"
        )
        true = measure(body).values
        job, config = Job(), SilhouettesConfig.model_validate({"sex": sex})
        front, side = (photograph(body.mesh, yaw, config.distance_m, seed) for yaw in (0.0, np.pi / 2))
        began = time.perf_counter()
        fit_silhouettes(Silhouettes(Path("front"), Path("side"), true["stature"]), front, side, config, job)
        seconds.append(time.perf_counter() - began)
        guess = complete(Measurements({name: true[name] for name in ("stature", "mass")}, sex=sex)).values
        read = [float(str(job.metrics[f"{name}_m"])) - true[name] for name in GIRTHS]
        half = [float(str(job.metrics[f"{name}_interval_mm"])) * 1e-3 for name in GIRTHS]
        wrong.append(np.abs(read))
        null.append([abs(guess[name] - true[name]) for name in GIRTHS])
        held.append([abs(away) <= reach for away, reach in zip(read, half, strict=True)])
    mae, by_weight = 1e3 * np.mean(wrong, axis=0), 1e3 * np.mean(null, axis=0)
    return Timing(float(np.median(seconds)), count), {
        **{f"{name}_mae_mm": float(value) for name, value in zip(GIRTHS, mae, strict=True)},
        **{f"{name}_by_weight_mm": float(value) for name, value in zip(GIRTHS, by_weight, strict=True)},
        "inside_interval_share": float(np.mean(held)),
    }
