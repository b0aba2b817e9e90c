from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil
import pytest
from numpy.testing import assert_allclose
from PIL import Image
from scan_scene import distances, render

from vto_pipeline.errors import ScanError
from vto_pipeline.model.camera import CameraSet, Intrinsics
from vto_pipeline.model.frames import DepthMaps, PhotoSet
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud
from vto_pipeline.pipeline.execution.cost import Meter
from vto_pipeline.scan import fuse
from vto_pipeline.scan.canonical import canonical_mesh
from vto_pipeline.scan.depth.depth_mask import clean_depth
from vto_pipeline.scan.fuse import (
    FuseConfig,
    PhotoFuseConfig,
    check_coverage,
    fuse_depth_frames,
    fuse_depth_maps,
)
from vto_pipeline.scan.photos.coverage import covered_share

COARSE = FuseConfig(voxel_mm=4)


@pytest.fixture(scope="module")
def true_maps(scene, shot, true_cameras):
    depth = np.stack([render(scene, true_cameras.intrinsics[0], pose, samples=1)[1] for pose in shot[1]])
    return DepthMaps(true_cameras.names, true_cameras.intrinsics, shot[1], np.where(depth < 1.25, depth, 0))


def test_fused_surface_lies_on_the_truth_and_keeps_both_ends_open(true_maps, true_cameras, shot, scene):
    job = Job()
    mesh = fuse_depth_maps(shot[0], true_cameras, true_maps, COARSE, job)
    tube = mesh.vertices[mesh.vertices[:, 1] > 0.06]
    error = distances(scene, tube)
    assert np.percentile(error, 50) < 4e-4
    assert np.percentile(error, 99) < 6e-3  # 1.5 voxels, what support allows at the rims; a false sheet is 16 mm off
    assert job.metrics["voxel_mm"] == 4
    across = np.linalg.norm(mesh.vertices[:, [0, 2]], axis=1)
    above = (mesh.vertices[:, 1] > 0.47) & (mesh.vertices[:, 1] < 0.6)
    assert not (above & (across < 0.08)).any()  # no lid
    assert np.ptp(mesh.colors[mesh.vertices[:, 1] > 0.2], axis=0).min() > 100  # the print came along


def test_two_runs_give_the_same_bits(true_maps, true_cameras, shot):
    first, second = (fuse_depth_maps(shot[0], true_cameras, true_maps, COARSE, Job()) for _ in range(2))
    assert first.vertices.tobytes() == second.vertices.tobytes()
    assert first.faces.tobytes() == second.faces.tobytes()
    assert first.colors.tobytes() == second.colors.tobytes()


def test_depth_frames_with_known_poses(walk, scene):
    frames, poses = walk
    mesh = fuse_depth_frames(frames, poses, FuseConfig(), Job())
    error = distances(scene, mesh.vertices[mesh.vertices[:, 1] > 0.06])
    assert 5e-5 < np.median(error) < 1e-3  # readings have 1 mm of noise
    assert np.percentile(error, 95) < 3e-3


def test_empty_depth_is_refused(true_maps, true_cameras, shot):
    blank = DepthMaps(true_maps.names, true_maps.intrinsics, true_maps.world_from_cam, np.zeros_like(true_maps.depth))
    with pytest.raises(ScanError, match="none of 16"):
        fuse_depth_maps(shot[0], true_cameras, blank, COARSE, Job())


def test_view_with_hardly_a_reading_is_left_out(true_maps, true_cameras, shot):
    """Open3D would abort: it looks at every fourth pixel, and finds none."""
    thin = true_maps.depth.copy()
    thin[3] = 0
    thin[3, 101:103, 101:103] = 0.9
    job = Job()
    maps = DepthMaps(true_maps.names, true_maps.intrinsics, true_maps.world_from_cam, thin)
    assert len(fuse_depth_maps(shot[0], true_cameras, maps, COARSE, job).faces) > 10_000
    assert any("003.jpg: 4 readings" in text for text in job.notes)


def test_views_that_never_meet_are_refused(true_maps, true_cameras, shot):
    lonely = np.zeros_like(true_maps.depth)
    lonely[0] = true_maps.depth[0]
    single = DepthMaps(true_maps.names, true_maps.intrinsics, true_maps.world_from_cam, lonely)
    with pytest.raises(ScanError, match="2 of 16|supported"):
        fuse_depth_maps(shot[0], true_cameras, single, COARSE, Job())


WALL = Intrinsics(320, 240, 300.0, 300.0, 159.5, 119.5)


def wall(folder: Path, k1: float = 0.0) -> tuple[PhotoSet, CameraSet, DepthMaps]:
    """Two photos, 40 mm apart, of a wall 1 m away that grows lighter to the right and downwards."""
    lens = replace(WALL, k1=k1)
    v, u = np.mgrid[: WALL.height, : WALL.width].astype(float)
    far_x, far_y = (u - WALL.cx) / WALL.fx, (v - WALL.cy) / WALL.fy
    x, y = far_x, far_y
    for _ in range(50):  # undo x_d = x (1 + k1 r²)
        bend = 1 + k1 * (x * x + y * y)
        x, y = far_x / bend, far_y / bend
    names, poses = ("left.png", "right.png"), np.stack([np.eye(4)] * 2)
    poses[1, 0, 3] = 0.04
    for name, pose in zip(names, poses, strict=True):
        shade = [128 + 150 * (x + pose[0, 3]), 128 + 150 * y, np.full_like(x, 90.0)]
        Image.fromarray(np.round(np.stack(shade, axis=2)).astype(np.uint8)).save(folder / name)
    photos = PhotoSet(tuple(folder / name for name in names), (None, None))
    depth = np.ones((2, WALL.height, WALL.width), np.float32)
    return photos, CameraSet(names, (lens, lens), poses), DepthMaps(names, (WALL, WALL), poses, depth)


def test_as_many_views_as_are_wanted_are_enough(tmp_path):
    """Two maps of one wall carry a surface that asks for two, and none that asks for three."""
    scene = wall(tmp_path)
    mesh = fuse_depth_maps(*scene, FuseConfig(voxel_mm=10, min_views=2), Job())
    assert_allclose(mesh.vertices[:, 2], 1.0, rtol=0, atol=1e-4)  # the depth is exact
    with pytest.raises(ScanError, match="3 of 2"):
        fuse_depth_maps(*scene, FuseConfig(voxel_mm=10, min_views=3), Job())


@pytest.mark.parametrize("k1", [0.0, -0.25, 0.2])
def test_colours_are_undistorted_as_the_depths_are(tmp_path, k1):
    mesh = fuse_depth_maps(*wall(tmp_path, k1), FuseConfig(voxel_mm=10), Job())
    assert mesh.colors is not None
    inner = (np.abs(mesh.vertices[:, 0] - 0.02) < 0.4) & (np.abs(mesh.vertices[:, 1]) < 0.3)
    assert inner.sum() > 1000
    true = 128 + 150 * mesh.vertices[inner, :2]
    # a level of rounding, one of interpolation, and half a voxel, 0.75 levels; without undistortion up to 15
    assert_allclose(mesh.colors[inner, :2], true, rtol=0, atol=2.75)


def test_canonical_mesh_does_not_depend_on_the_order():
    random = np.random.default_rng(0)
    vertices = random.normal(size=(40, 3))
    faces = np.array([random.choice(40, 3, replace=False) for _ in range(60)])
    colors = random.integers(0, 255, (40, 3), dtype=np.uint8)
    order, rows = random.permutation(40), random.permutation(60)
    place = np.argsort(order)
    turned = np.roll(place[faces[rows]], 1, axis=1)
    a, b = canonical_mesh(vertices, faces, colors), canonical_mesh(vertices[order], turned, colors[order])
    for name in ("vertices", "faces", "colors"):
        assert getattr(a, name).tobytes() == getattr(b, name).tobytes()

    def corners(v, f):
        return np.sort(np.linalg.norm(np.cross(v[f[:, 1]] - v[f[:, 0]], v[f[:, 2]] - v[f[:, 0]]), axis=1))

    kept = np.unique(np.sort(faces, axis=1), axis=0)
    assert len(a.faces) >= len(kept)
    assert_allclose(
        corners(a.vertices, a.faces)[-1], corners(vertices, faces)[-1], rtol=1e-12, atol=0
    )  # same triangles


def test_canonical_mesh_welds_and_drops_flat_faces():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [0, 0, 0]], float)
    mesh = canonical_mesh(vertices, np.array([[0, 1, 2], [3, 4, 1]]), None)
    assert len(mesh.vertices) == 3
    assert len(mesh.faces) == 1


def test_flying_pixels_and_grazing_surfaces_are_masked():
    camera = Intrinsics(64, 48, 60.0, 60.0, 31.5, 23.5)
    depth = np.full((48, 64), 1.0, np.float32)
    depth[:, 30:34] = 1.2  # a step, and on its edge:
    depth[:, 29] = 1.1
    clean = clean_depth(depth, camera)
    assert not clean[:, 29].any()
    assert (clean[5:-5, 5:20] == 1).all()
    u = np.arange(64)
    wall = np.tile((1.0 / (1 + 9 * (u - 31.5) / 60 * 0.1)).astype(np.float32), (48, 1))
    assert (clean_depth(wall, camera) > 0).mean() > 0.9  # tilted 42 degrees: kept


def test_voxels_grow_until_the_scene_fits_in_memory(true_maps, true_cameras, shot, scene, monkeypatch):
    monkeypatch.setattr(fuse, "MAX_BLOCKS", 60)
    job = Job()
    mesh = fuse_depth_maps(shot[0], true_cameras, true_maps, COARSE, job)
    assert "instead of 4 mm" in job.warnings[0]
    assert 5 < job.metrics["voxel_mm"] < 40
    error = distances(scene, mesh.vertices[mesh.vertices[:, 1] > 0.1])
    assert np.median(error) < 1e-3 * job.metrics["voxel_mm"]


@pytest.mark.slow
def test_what_fits_no_memory_is_refused_with_the_voxel_that_fits(true_maps, true_cameras, shot, monkeypatch):
    """The peak of the process is held against the stated bound; a budget only ever refuses, and changes no bit."""

    def fused(voxel_mm: float, left: float) -> tuple[bytes, Job]:
        monkeypatch.setattr(Job, "memory_left", lambda _: left)
        job = Job(memory=1e12)
        surface = fuse_depth_maps(shot[0], true_cameras, true_maps, FuseConfig(voxel_mm=voxel_mm), job)
        return surface.vertices.tobytes() + surface.faces.tobytes(), job

    meter, before = Meter(), resident()
    ample, job = fused(2.0, 1e12)
    bound = 1e6 * job.metrics["memory_bound_mb"]
    if Path("/proc/self/clear_refs").exists():
        assert 0.3 * bound < 1e6 * meter.peak_mb() - before < bound
    assert fused(2.0, bound + 1e6)[0] == ample
    with pytest.raises(ScanError, match=r"voxels of 2 mm need up to .* GB of memory; the budget leaves") as caught:
        fused(2.0, 0.6 * bound)
    fitting = float(caught.value.hint.split()[-1])
    assert 2.0 < fitting < 3.5
    assert fused(1.1 * fitting, 0.6 * bound)[1].metrics["voxel_mm"] == pytest.approx(1.1 * fitting, abs=1e-3)
    with pytest.raises(ScanError, match="the budget leaves 0 GB") as caught:
        fused(2.0, -1.0)
    assert caught.value.hint == "give more memory"


def resident() -> int:
    return psutil.Process().memory_info().rss


def test_a_far_background_takes_no_voxels(true_maps, true_cameras, shot):
    """A pixel on a wall 40 m away covers 19 voxels: there is no surface to be had, only blocks of memory."""
    wall = np.where(true_maps.depth > 0, true_maps.depth, 40)
    maps = DepthMaps(true_maps.names, true_maps.intrinsics, true_maps.world_from_cam, wall)
    job = Job()
    mesh = fuse_depth_maps(shot[0], true_cameras, maps, COARSE, job)
    assert np.abs(mesh.vertices).max() < 2
    assert any("readings so far away" in note for note in job.notes)
    assert not job.warnings


def wall_and_points(depth):
    """Two cameras before a wall 2 m away, and points that span 60 x 30 of the 100 x 80 pixels of each."""
    camera, poses = Intrinsics(100, 80, 100.0, 100.0, 49.5, 39.5), np.tile(np.eye(4), (2, 1, 1))
    u, v = np.meshgrid(np.arange(20, 81, 5), np.arange(10, 41, 5))
    points = np.stack([2 * (u - 49.5) / 100, 2 * (v - 39.5) / 100, np.full(u.shape, 2.0)], axis=-1).reshape(-1, 3)
    return DepthMaps(("a", "b"), (camera, camera), poses, depth), PointCloud(points)


def test_coverage_is_the_share_of_pixels_between_the_points():
    depth = np.zeros((2, 80, 100), np.float32)
    depth[0, 10:41, 20:51] = 2.0  # the left half of the region
    depth[1, :, 50:] = 2.0  # the right half and more
    maps, cloud = wall_and_points(depth)
    assert_allclose(covered_share(maps, cloud), 0.5, rtol=0, atol=0.02)  # whole pixels: a row of 61, a column of 31
    far = PointCloud(np.concatenate([np.repeat(cloud.points, 3, axis=0), [[0.9, 0.7, 2.0]]]))
    assert_allclose(covered_share(maps, far), 0.5, rtol=0, atol=0.02)  # one stray point does not widen the region
    assert covered_share(maps, PointCloud(cloud.points[:2])) == 0


def test_scraps_are_refused_and_kept_as_a_partial_result(true_maps, true_cameras, shot, scene):
    """Depth in every tenth patch of the tube only. The sparse points are the tube's."""
    points = PointCloud(scene.vertices[::37])
    good = Job()
    whole = fuse_depth_maps(shot[0], true_cameras, true_maps, COARSE, Job())
    check_coverage(whole, true_maps, points, PhotoFuseConfig(), good)
    assert 0.9 < good.metrics["coverage"] <= 1
    holes = np.add.outer(np.arange(360) // 24, np.arange(480) // 24) % 10 == 0
    maps = replace(true_maps, depth=np.where(holes, true_maps.depth, 0))
    scraps = fuse_depth_maps(shot[0], true_cameras, maps, FuseConfig(voxel_mm=4, min_views=1), Job())
    job = Job()
    with pytest.raises(ScanError, match="the surface covers .* pieces is") as caught:
        check_coverage(scraps, maps, points, PhotoFuseConfig(), job)
    assert 0.05 < job.metrics["coverage"] < 0.15
    assert caught.value.partial["surface"] is scraps
    check_coverage(scraps, maps, points, PhotoFuseConfig(min_coverage=0.02), Job())
