"""The error predicted from depth maps alone: of known noise, and of a surface that is off by a known distance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scan_scene import distances, look_at
from scipy.ndimage import map_coordinates

from vto_pipeline.geometry.rigid import transform_mesh
from vto_pipeline.geometry.topology import submesh
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.frames import DepthMaps
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.scan.depth_views import depth_only
from vto_pipeline.scan.disagreement import predicted_error
from vto_pipeline.scan.fuse import FuseConfig, fuse_depth_frames
from vto_pipeline.stages.scan_report import STAGES, scan_report

CAMERA = Intrinsics(120, 90, 150.0, 150.0, 59.5, 44.5)
SIGMA = 0.0004
WAVE = 4
"""Noise is one value for so many pixels: between pixels it is interpolated, and finer noise would be averaged out."""


def wall(z=1.0, step=0.004) -> TriangleMesh:
    """A sheet before the cameras, facing them."""
    x, y = np.meshgrid(np.arange(-0.3, 0.3, step), np.arange(-0.2, 0.2, step))
    rows, columns = x.shape
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    a, b, c, d = corner, corner + 1, corner + columns, corner + columns + 1
    faces = np.concatenate([np.stack([a, c, b], 1), np.stack([b, c, d], 1)])
    vertices = np.stack([x.ravel(), y.ravel(), np.full(x.size, z)], axis=1)
    return TriangleMesh(vertices, faces[:, [0, 2, 1]] if _away(vertices, faces) else faces)


def _away(vertices, faces) -> bool:
    a, b, c = vertices[faces[0]]
    return bool(np.cross(b - a, c - a)[2] > 0)


def maps_of_wall(noise: float, count=6, seed=0) -> DepthMaps:
    """Depth maps from a row of places, all of which look straight at the wall at 1 m."""
    random = np.random.default_rng(seed)
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, 0, 3] = np.linspace(-0.05, 0.05, count)
    coarse = random.normal(0.0, noise, (count, 90 // WAVE + 1, 120 // WAVE + 1))
    rough = coarse.repeat(WAVE, axis=1).repeat(WAVE, axis=2)[:, :90, :120]
    names = tuple(f"{k}.png" for k in range(count))
    return DepthMaps(names, (CAMERA,) * count, poses, (1.0 + rough).astype(np.float32))


def middle_of(maps: DepthMaps) -> TriangleMesh:
    """The sheet in the middle of all maps that show it."""
    sheet = wall(step=0.002)  # readings are averaged over so much; noise is not
    x, y, _ = sheet.vertices.T
    shown = np.full((len(maps.names), len(x)), np.nan)
    for k, pose in enumerate(maps.world_from_cam):
        at = np.stack([y * CAMERA.fy + CAMERA.cy, (x - pose[0, 3]) * CAMERA.fx + CAMERA.cx])
        shown[k] = map_coordinates(maps.depth[k].astype(float), at, order=1, cval=np.nan)
    return TriangleMesh(np.stack([x, y, np.nanmean(shown, axis=0)], axis=1), sheet.faces)


@pytest.mark.parametrize("alike", [1, 2, 8], ids=["independent", "in pairs", "in halves"])
def test_what_noise_leaves_in_the_middle_of_the_maps_is_predicted(alike):
    """Maps that were taken one after the other share their noise, so many at a time."""
    true, found = [], []
    for seed in range(6):  # one wall has 600 places with noise of their own: its median is known to 5 %
        maps = maps_of_wall(SIGMA, count=16, seed=seed)
        alike_depth = maps.depth[np.arange(16) // alike * alike]
        maps = replace(maps, depth=alike_depth, world_from_cam=np.tile(np.eye(4), (16, 1, 1)))
        surface = middle_of(maps)
        true.append(np.quantile(1e3 * np.abs(surface.vertices[:, 2] - 1.0), [0.5, 0.95]))
        found.append(list(predicted_error(depth_only(maps), surface).values()))
    expected = np.array([0.6745e3, 1.96e3]) * SIGMA / np.sqrt(16 / alike)  # quantiles of a normal distribution
    assert_allclose(np.mean(true, axis=0), expected, rtol=0.2, atol=0)  # less where it is interpolated
    assert_allclose(np.mean(found, axis=0), np.mean(true, axis=0), rtol=0.1, atol=0)


def test_a_surface_that_is_off_is_found_out():
    found = predicted_error(depth_only(maps_of_wall(0.0)), wall(z=1.002))
    assert found is not None
    assert_allclose([found["median"], found["p95"]], 2.0, rtol=0, atol=0.01)  # the steps of the count


def test_a_distance_is_along_the_normal_however_the_maps_look_at_it():
    turn = np.radians(50.0)
    pose = np.eye(4)
    pose[:3, :3] = [[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]]
    pose[:3, 3] = [0, 0, 1.0] - 0.6 * pose[:3, 2]
    column, row = np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height))
    ray = np.stack([(column - CAMERA.cx) / CAMERA.fx, (row - CAMERA.cy) / CAMERA.fy, np.ones(row.shape)], axis=-1)
    depth = (1.0 - pose[2, 3]) / (ray @ pose[2, :3])  # of the plane z = 1
    maps = DepthMaps(("a.png",), (CAMERA,), pose[None], np.where(depth > 0, depth, 0)[None].astype(np.float32))
    found = predicted_error(depth_only(maps), wall(z=1.002))
    assert found is not None
    assert_allclose([found["median"], found["p95"]], 2.0, rtol=0, atol=0.02)


def test_what_was_filled_is_worse_than_all_that_was_seen():
    views = depth_only(maps_of_wall(SIGMA))
    plain, filled = predicted_error(views, wall()), predicted_error(views, wall(), filled_share=0.1)
    assert plain is not None
    assert filled is not None
    assert filled["median"] > plain["median"]
    assert filled["p95"] is None
    assert_allclose(predicted_error(views, wall(), 0.1)["median"], 0.1 * plain["median"], rtol=0, atol=0.001)


def test_without_readings_nothing_is_predicted():
    maps = maps_of_wall(0.0)
    blank = DepthMaps(maps.names, maps.intrinsics, maps.world_from_cam, np.zeros_like(maps.depth))
    assert predicted_error(depth_only(blank), wall()) is None


@pytest.mark.parametrize(("percent", "expected"), [(0.0, 0.3), (1.0, np.hypot(0.3, 0.6745 * 2.0))])
def test_the_scale_adds_to_the_error(percent, expected):
    """One per cent of 0.2 m is 2 mm."""
    stages = [{"name": "garment.scale", "status": "ran", "metrics": {"scale_error_percent": percent}}]
    report = scan_report("garment", True, {"stages": stages}, lambda unit, filled: {"median": 0.3, "p95": None}, 0.2)
    assert_allclose(report["predicted_error_mm"]["median"], expected, rtol=0, atol=0.001)  # rounded to that
    assert report["predicted_error_mm"]["p95"] is None


def test_a_depth_scan_tells_the_error_of_its_garment(walk, scene):
    """Not of the floor around it, and in whatever frame the garment is. What was lost is no part of it."""
    frames, poses = walk
    surface = fuse_depth_frames(frames, poses, FuseConfig(), Job())
    garment, _ = submesh(surface, surface.vertices[surface.faces][..., 1].min(axis=1) > 0.13)
    true = 1e3 * distances(scene, garment.vertices)
    motion = look_at(np.array([1.0, 2.0, -0.5]), np.array([0.3, 0.2, 0.4]))
    report = {stage.name: stage for stage in STAGES}["garment.scan_report"]
    shares = {"unobserved_share": 0.1, "filled_share": 0.01}
    given = {
        "garment_surface": surface,
        "garment_depth": frames,
        "garment_trajectory": poses,
        "garment": transform_mesh(garment, motion),
        "observed": np.ones(len(garment.vertices), bool),
        "garment_placement": motion,
        "run_record": {"stages": [{"name": "openings", "status": "ran", "metrics": shares}]},
    }
    found = report.run(given, report.settings(), Job())["garment_scan_report"]["predicted_error_mm"]
    assert 1 / 1.5 < found["median"] / np.median(true) < 1.5
    assert 1 / 1.5 < found["p95"] / np.quantile(true, 0.95) < 1.5
