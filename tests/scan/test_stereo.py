from __future__ import annotations

import os
import tracemalloc

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scan_scene import distances, make_scene, photos, render

from vto_pipeline.errors import InputError, ScanError
from vto_pipeline.model.camera import CameraSet, Intrinsics
from vto_pipeline.model.frames import PhotoSet
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud
from vto_pipeline.scan.photos import stereo
from vto_pipeline.scan.photos.consistency import consensus
from vto_pipeline.scan.photos.disparity import MatchConfig, _in_second, match_pair
from vto_pipeline.scan.photos.neighbours import choose_pairs, visibility
from vto_pipeline.scan.photos.rectify import StereoView, depth_in_view, rectify, warp
from vto_pipeline.scan.photos.stereo import PAIR_BYTES, StereoConfig, estimate_depth_maps
from vto_pipeline.scan.photos.subpixel import refine_disparity


@pytest.fixture(scope="module")
def sparse(scene):
    """Points on the tube with their outward directions."""
    step = scene.vertices[::37]
    normals = step * [1, 0, 1]
    return PointCloud(step, normals / np.linalg.norm(normals, axis=1, keepdims=True))


@pytest.fixture(scope="module")
def maps(shot, true_cameras, sparse):
    job = Job()
    return estimate_depth_maps(shot[0], true_cameras, sparse, StereoConfig(), job), job


def test_depth_agrees_with_the_ray_cast_truth(maps, shot, scene):
    found, job = maps
    errors, covered = [], []
    for index in (0, 5, 11):
        _, truth = render(scene, shot[0].intrinsics[index], shot[1][index], samples=1)
        tube = truth > 0
        known = found.depth[index] > 0
        errors.append((found.depth[index] - truth)[known & tube])
        covered.append(known.sum() / 20_000)
    error = np.abs(np.concatenate(errors))
    assert 5e-5 < np.median(error) < 8e-4  # a pixel is 1.9 mm; under 0.05 mm would be the truth itself
    assert np.percentile(error, 95) < 4e-3
    assert min(covered) > 0.5
    assert 0.5 < job.metrics["consistent_share"] <= 1


@pytest.mark.slow
def test_photos_that_were_exposed_differently_cover_as_much(maps, shot, true_cameras, sparse, tmp_path):
    for index, path in enumerate(shot[0].paths):
        picture = cv2.imread(str(path))
        cv2.imwrite(str(tmp_path / path.name), np.rint(picture * (0.75, 1.0, 0.85)[index % 3]).astype(np.uint8))
    uneven = PhotoSet(tuple(tmp_path / path.name for path in shot[0].paths), shot[0].intrinsics)
    job = Job()
    found = estimate_depth_maps(uneven, true_cameras, sparse, StereoConfig(), job)
    assert (found.depth > 0).sum() > 0.97 * (maps[0].depth > 0).sum()
    assert_allclose(job.metrics["exposure_spread"], 1 / 0.75, rtol=0.02)


def test_same_bits_on_one_core_and_on_all_in_the_stated_memory(maps, shot, true_cameras, sparse, monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    job = Job()
    tracemalloc.start()
    again = estimate_depth_maps(shot[0], true_cameras, sparse, StereoConfig(), job)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert again.depth.tobytes() == maps[0].depth.tobytes()
    assert 0.3e6 * job.metrics["memory_bound_mb"] < peak < 1e6 * job.metrics["memory_bound_mb"]


@pytest.mark.slow
def test_less_memory_matches_fewer_pairs_at_a_time_with_the_same_bits(maps, shot, true_cameras, sparse, monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 4)
    pair = PAIR_BYTES * true_cameras.intrinsics[0].width * true_cameras.intrinsics[0].height

    def within(left: float) -> Job:
        monkeypatch.setattr(Job, "memory_left", lambda _: left)
        found = estimate_depth_maps(shot[0], true_cameras, sparse, StereoConfig(), job := Job(memory=1e12))
        assert found.depth.tobytes() == maps[0].depth.tobytes()
        return job

    ample = within(1e12)
    whole = 1e6 * ample.metrics["memory_bound_mb"]
    assert any("4 at a time on 4 cores" in note for note in ample.notes)
    tight = within(whole - 1.5 * pair)
    assert any("2 at a time on 4 cores" in note for note in tight.notes)
    assert 1e6 * tight.metrics["memory_bound_mb"] == pytest.approx(whole - 2 * pair, abs=1e6)  # rounded
    with pytest.raises(ScanError, match="GB of memory; the budget leaves .* GB"):
        within(whole - 3.5 * pair)


def test_plain_surface_is_refused(tmp_path, true_cameras, sparse):
    plain = make_scene(contrast=0.0)
    few = CameraSet(true_cameras.names[:4], true_cameras.intrinsics[:4], true_cameras.world_from_cam[:4])
    shots = photos(plain, tmp_path, few.world_from_cam, few.intrinsics[0], board=False)
    with pytest.raises(ScanError, match="no depth is confirmed") as caught:
        estimate_depth_maps(shots, few, sparse, StereoConfig(check_views=3), Job())
    assert "print" in caught.value.hint


def test_photos_that_share_nothing_are_refused(shot, true_cameras, sparse):
    with pytest.raises(ScanError, match="share"):
        estimate_depth_maps(shot[0], true_cameras, PointCloud(sparse.points[:2]), StereoConfig(), Job())


def test_camera_without_photo_is_refused(shot, true_cameras, sparse):
    names = ("gone.jpg", *true_cameras.names[1:])
    cameras = CameraSet(names, true_cameras.intrinsics, true_cameras.world_from_cam)
    with pytest.raises(InputError, match="gone.jpg"):
        estimate_depth_maps(shot[0], cameras, sparse, StereoConfig(), Job())


def test_pairs_are_neighbours_in_the_ring(true_cameras, sparse):
    seen = visibility(true_cameras, sparse)
    assert 0.2 < seen.mean() < 0.45  # a camera faces about a third of a tube within 60 degrees
    pairs = choose_pairs(true_cameras, sparse, seen, per_photo=2, min_shared=12)
    assert pairs == sorted([(i, i + 1) for i in range(15)] + [(0, 15)])


def bent_view(k1):
    return Intrinsics(160, 120, 150.0, 155.0, 78.0, 61.0, k1)


def cluster():
    """Points where the photos look."""
    return np.random.default_rng(0).uniform([-0.15, 0.15, -0.15], [0.15, 0.45, 0.15], (50, 3))


def test_a_point_falls_on_the_same_row_of_both_windows(true_cameras):
    """Projection written out again, with distortion: warp must put each photo's pixel where the frame says."""
    points = cluster()
    camera = bent_view(-0.2)
    ramp = np.tile(np.arange(160, dtype=np.uint8), (120, 1))
    first, second = (StereoView(ramp, camera, true_cameras.world_from_cam[k]) for k in (3, 4))
    frame = rectify(first, second, points, 0.1)
    for view, shift in ((first, 0), (second, frame.min_disparity)):
        window = warp(view, frame, shift)
        local = (points - view.world_from_cam[:3, 3]) @ frame.rect_from_world.T
        sine = local[:, 0] / np.linalg.norm(local, axis=1)
        u = frame.scale * np.arctanh(sine) - frame.corner[0] + shift
        v = frame.scale * np.arctan2(local[:, 1], local[:, 2]) - frame.corner[1]
        inside = (points - view.world_from_cam[:3, 3]) @ view.world_from_cam[:3, :3]
        flat = inside[:, :2] / inside[:, 2:]
        truth = camera.fx * flat[:, 0] * (1 - 0.2 * (flat**2).sum(1)) + camera.cx
        seen = cv2.remap(window.astype(np.float32), u[:, None].astype(np.float32), v[:, None].astype(np.float32), 1)
        assert_allclose(seen.ravel(), truth, rtol=0, atol=1.0)  # the ramp is kept in whole grey levels
    assert frame.disparities % 16 == 0


@pytest.mark.parametrize("second", [False, True])
def test_depth_puts_points_where_both_cameras_see_the_disparity(true_cameras, second):
    """From the angles at both cameras: the isometric latitude of an angle t to the axis is artanh(cos t)."""
    camera = bent_view(0.0)
    views = [StereoView(np.zeros((120, 160), np.uint8), camera, true_cameras.world_from_cam[k]) for k in (3, 4)]
    frame = rectify(*views, cluster(), 0.1)
    disparity = np.full(frame.size[::-1], 0.4 * frame.scale, np.float32)
    depth = depth_in_view(views[second], frame, disparity, second=second)
    v, u = np.nonzero(depth)
    assert len(v) > 1000
    ray = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(len(u))], axis=1)
    pose = views[second].world_from_cam
    world = (ray * depth[v, u][:, None]) @ pose[:3, :3].T + pose[:3, 3]
    centers = [view.world_from_cam[:3, 3] for view in views]
    baseline = (centers[1] - centers[0]) / np.linalg.norm(centers[1] - centers[0])
    cosines = [(world - c) @ baseline / np.linalg.norm(world - c, axis=1) for c in centers]
    assert_allclose(np.arctanh(cosines[0]) - np.arctanh(cosines[1]), 0.4, rtol=1e-5, atol=0)  # single precision


PLANE = 2.0
"""Where the plane of the next tests stands, z [m]."""


def plane_view(camera, pose):
    """A printed plane z = PLANE as a camera sees it, and the plane's depth: both in closed form."""
    texture = smooth_texture(1500, 500)[:, :1500].astype(np.float32)  # 2.5 mm a texel, 1.9 m about the axis
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], -1) @ pose[:3, :3].T
    depth = (PLANE - pose[2, 3]) / rays[..., 2]
    x, y = np.moveaxis(pose[:2, 3] + depth[..., None] * rays[..., :2], -1, 0)
    seen = cv2.remap(texture, (750 + 400 * x).astype(np.float32), (750 + 400 * y).astype(np.float32), cv2.INTER_CUBIC)
    return StereoView(np.clip(np.round(seen), 0, 255).astype(np.uint8), camera, pose), depth


def plane_points(camera, view, other):
    """Points of the plane that both views show."""
    x, y = np.meshgrid(np.linspace(-1.5, 1.5, 61), np.linspace(-1.5, 1.5, 61))
    points = np.stack([x.ravel(), y.ravel(), np.full(x.size, PLANE)], axis=1)
    poses = np.stack([view.world_from_cam, other.world_from_cam])
    return points[visibility(CameraSet(("a", "b"), (camera, camera), poses), PointCloud(points)).all(0)]


@pytest.mark.parametrize(
    ("step", "turn_deg"),
    [
        ((0, 0, 0.4), 0),
        ((0, 0, -0.4), 0),
        ((0.1, 0.05, 0.4), 5),
        ((0.3, 0, 0.4), 0),
        ((0, 0.35, 0.1), -4),
        ((0.35, 0, 0), 3),
    ],
)
def test_a_plane_is_measured_wherever_the_second_camera_stands(step, turn_deg):
    """Forward and backward along the view (the axis is in the picture), beside its middle, at its border, sideways."""
    camera = Intrinsics(480, 360, 500.0, 500.0, 239.5, 179.5)
    turn = np.eye(4)
    turn[:3, :3] = cv2.Rodrigues(np.radians([[0.3 * turn_deg], [turn_deg], [turn_deg]]))[0]
    turn[:3, 3] = step
    (first, near), (second, far) = plane_view(camera, np.eye(4)), plane_view(camera, turn)
    frame = rectify(first, second, plane_points(camera, first, second), 0.1)
    assert frame.size[0] * frame.size[1] < 2.2 * 480 * 360  # 2, and the rounding of the disparities
    for measured, truth in zip(match_pair(first, second, frame, MatchConfig()), (near, far), strict=True):
        known = measured > 0
        assert known.mean() > 0.5
        error = np.abs(measured / truth - 1)[known]
        assert 1e-5 < np.median(error) < 2e-3
        assert np.percentile(error, 90) < 0.01


def test_no_pair_of_cameras_needs_a_large_window():
    """Cameras anywhere, looking anywhere, so that the axis is in, near and far from the picture."""
    random = np.random.default_rng(5)
    camera = Intrinsics(400, 300, 420.0, 420.0, 199.5, 149.5)
    gray, axis_shown = np.zeros((300, 400), np.uint8), 0
    for _ in range(300):
        poses = np.tile(np.eye(4), (2, 1, 1))
        poses[1, :3, :3] = cv2.Rodrigues(random.normal(0, 0.2, 3))[0]
        poses[1, :3, 3] = random.normal(size=3) * 10 ** random.uniform(-3, 0.3)
        points = random.uniform([-0.4, -0.3, 0.3], [0.4, 0.3, 1], (200, 3)) * 10 ** random.uniform(-0.5, 1.5, (200, 1))
        points = points[visibility(CameraSet(("a", "b"), (camera, camera), poses), PointCloud(points)).all(0)]
        if len(points) < 12:
            continue
        frame = rectify(StereoView(gray, camera, poses[0]), StereoView(gray, camera, poses[1]), points, 0.1)
        axis = poses[1, :3, 3] / poses[1, 2, 3] * 420
        axis_shown += abs(axis[0]) < 200 and abs(axis[1]) < 150
        assert 16 <= frame.size[0] * frame.size[1] < 2.3 * gray.size
        assert max(frame.size) < 2**15  # OpenCV's limit
    assert axis_shown > 20


def test_points_on_the_axis_do_not_cost_the_others_their_resolution():
    """The axis itself is infinitely far up the map."""
    camera, ahead = Intrinsics(400, 300, 420.0, 420.0, 199.5, 149.5), np.eye(4)
    ahead[2, 3] = 0.1
    first, second = (StereoView(np.zeros((300, 400), np.uint8), camera, pose) for pose in (np.eye(4), ahead))
    turn = np.linspace(0, 2 * np.pi, 100)
    ring = np.stack([0.3 * np.cos(turn), 0.3 * np.sin(turn), np.ones(100)], axis=1)
    alone = rectify(first, second, ring, 0.1)
    together = rectify(first, second, np.concatenate([ring, np.tile([0, 0, 1.0], (5, 1))]), 0.1)
    assert 0.7 * alone.scale < together.scale < 1.4 * alone.scale


def test_photos_from_one_place_cannot_be_rectified(true_cameras):
    view = StereoView(np.zeros((120, 160), np.uint8), bent_view(0.0), true_cameras.world_from_cam[0])
    with pytest.raises(ScanError, match="one place"):
        rectify(view, view, cluster(), 0.1)


def test_a_pair_that_fails_is_left_out_with_its_names(shot, true_cameras, sparse, monkeypatch):
    few = CameraSet(true_cameras.names[:5], true_cameras.intrinsics[:5], true_cameras.world_from_cam[:5])

    def failing(first, second, *rest):
        if np.array_equal(first.world_from_cam, few.world_from_cam[0]):
            raise cv2.error("Insufficient memory")
        return match_pair(first, second, *rest)

    monkeypatch.setattr(stereo, "match_pair", failing)
    job = Job()
    found = estimate_depth_maps(shot[0], few, sparse, StereoConfig(check_views=1), job)
    assert found.depth[1:].any(axis=(1, 2)).all()
    assert "000.jpg and 001.jpg: Insufficient memory" in job.warnings[0]


def test_photos_that_need_more_memory_than_there_is_are_refused(shot, true_cameras, sparse, monkeypatch):
    monkeypatch.setattr(os, "sysconf", lambda name: 4096)  # 4096 pages of 4096 bytes
    with pytest.raises(ScanError, match="this machine has 0.0") as caught:
        estimate_depth_maps(shot[0], true_cameras, sparse, StereoConfig(), Job())
    assert "max_side_px" in caught.value.hint


def test_photos_that_see_the_points_under_small_angles_are_no_pair(true_cameras, sparse):
    """Two steps towards the points, and a third aside: their baselines have the same length."""
    start, target = true_cameras.world_from_cam[0].copy(), sparse.points.mean(0)
    ahead, aside = start.copy(), start.copy()
    ahead[:3, 3] += 0.25 * start[:3, 2]
    aside[:3, 3] += 0.25 * start[:3, 0]
    cameras = CameraSet(("a", "b", "c"), true_cameras.intrinsics[:3], np.stack([start, ahead, aside]))
    near = PointCloud(target + np.random.default_rng(1).uniform(-0.02, 0.02, (40, 3)))
    assert choose_pairs(cameras, near, visibility(cameras, near), per_photo=2, min_shared=12) == [(0, 2), (1, 2)]


def smooth_texture(height, width):
    noise = np.random.default_rng(3).normal(size=(height, 4 * width)).astype(np.float32)
    fine = cv2.GaussianBlur(noise, (0, 0), 4.0)
    return 120 + 40 * fine / fine.std()


def test_subpixel_refinement_finds_a_slanted_shift():
    height, width = 60, 200
    fine = smooth_texture(height, width)  # four columns to a pixel
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    truth = (9.3 + 0.05 * u + 0.02 * v).astype(np.float32)
    sample = lambda x: cv2.remap(fine, (4 * x).astype(np.float32), v.astype(np.float32), cv2.INTER_CUBIC)  # noqa: E731
    right = np.clip(np.round(sample(u.astype(np.float32))), 0, 255).astype(np.uint8)
    left = np.clip(np.round(1.2 * sample(u - truth) - 10), 0, 255).astype(np.uint8)  # another exposure, too
    start = np.round(truth)
    start[:, :30] = np.nan
    refined = refine_disparity(left, right, start, 0, 2, 6, 3, 0.5, 0.1)
    known = ~np.isnan(refined)
    assert known[:, :28].sum() == 0
    assert known[4:-4, 40:-4].mean() > 0.95
    error = np.abs(refined - truth)[known]
    assert np.median(error) < 0.05
    assert np.median(np.abs(start - truth)[known]) > 0.15  # what it had to mend


def test_refinement_drops_what_does_not_match():
    noise = np.random.default_rng(4).integers(0, 255, (2, 40, 80), dtype=np.uint8)
    refined = refine_disparity(noise[0], noise[1], np.full((40, 80), 5.0, np.float32), 0, 2, 6, 3, 0.5, 0.1)
    assert (~np.isnan(refined)).mean() < 0.1


def test_a_print_lost_in_noise_is_measured_over_wider_windows():
    height, width, noise = 80, 200, 2.0
    rng = np.random.default_rng(8)
    blobs = cv2.GaussianBlur(rng.normal(size=(height, width + 20)).astype(np.float32), (0, 0), 3.0)
    blobs *= 4.0 / blobs.std()  # but little of it within five pixels
    u, v = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    right = cv2.remap(blobs, u + 10, v, cv2.INTER_CUBIC)
    left = cv2.remap(blobs, u + 10 - np.float32(6.3), v, cv2.INTER_CUBIC)
    left, right = (np.rint(120 + x + rng.normal(0, noise, x.shape)).astype(np.uint8) for x in (left, right))
    start = np.full((height, width), 6.0, np.float32)
    share, error = {}, {}
    for widest in (2, 6):
        refined = refine_disparity(left, right, start, 0, 2, widest, 3, 0.5, 0.1)[10:-10, 20:-10]
        share[widest] = (~np.isnan(refined)).mean()
        error[widest] = np.nanmedian(np.abs(refined - 6.3))
    assert share[6] > 0.85
    assert share[2] < 0.6
    assert error[6] < 0.7 * error[2]
    assert error[6] < 0.3


def test_disparity_is_carried_to_the_second_view_and_the_nearest_wins():
    forward = np.full((1, 60), np.nan, np.float32)
    forward[0, 20:40] = 4.0
    forward[0, 40:50] = 12.25  # nearer: covers part of the first piece
    backward = _in_second(forward, 2)
    truth = np.full(60, np.nan, np.float32)
    truth[18:38] = 4.0
    truth[30:39] = 12.25  # u - 12.25 + 2, whole pixels inside
    assert_allclose(backward[0], truth, rtol=0, atol=1e-6)  # constant pieces: exact


def test_consensus_takes_the_heavier_agreement():
    depths = np.zeros((4, 1, 4), np.float32)
    depths[:, 0, 0] = 1.000, 1.001, 1.5, 1.5  # two against two: the heavier pair
    depths[:, 0, 1] = 1.0, 1.2, 1.4, 0.0  # nobody agrees
    depths[:, 0, 2] = 2.0, 0.0, 0.0, 0.0  # one voice
    depths[:, 0, 3] = 1.0, 1.002, 1.001, 0.0
    merged = consensus(depths, np.array([1.0, 3.0, 1.0, 1.0]), 0.003, 2)
    assert_allclose(merged[0], [(1 + 3 * 1.001) / 4, 0, 0, (1 + 3 * 1.002 + 1.001) / 5], rtol=1e-6, atol=0)  # float32


def test_unseen_side_is_left_out(maps, scene, shot):
    """Every kept pixel lies on the tube or the floor, none floats."""
    found = maps[0]
    v, u = np.nonzero(found.depth[3])
    camera, pose = found.intrinsics[3], found.world_from_cam[3]
    ray = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(len(u))], axis=1)
    world = (ray * found.depth[3][v, u][:, None]) @ pose[:3, :3].T + pose[:3, 3]
    off = np.minimum(distances(scene, world), np.abs(world[:, 1]))
    assert np.percentile(off, 99) < 0.008
