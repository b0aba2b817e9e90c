"""Points followed from photo to photo, and cameras adjusted to them, beside the scene that was rendered."""

from __future__ import annotations

from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scan_scene import make_scene, orbit, photos, render

from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.job import Job
from vto_pipeline.scan.photos import sfm
from vto_pipeline.scan.photos.matching import adjust as adjust_module
from vto_pipeline.scan.photos.matching.adjust import _triangulate
from vto_pipeline.scan.photos.matching.tracks import TrackedPhoto, follow, without_light
from vto_pipeline.scan.photos.sfm import SfmConfig, estimate_cameras
from vto_pipeline.scan.similarity import fit_similarity

PHOTO = Intrinsics(480, 360, 528.0, 528.0, 239.5, 179.5)


def photo(scene, pose, gain=1.0, off=0.0):
    """A photo with what structure from motion would know of it: some points, off by a share of their depth."""
    color, depth = render(scene, PHOTO, pose)
    random = np.random.default_rng(7)
    v, u = np.nonzero(depth)
    some = random.choice(len(u), 300, replace=False)
    pixels, z = np.column_stack([u, v])[some].astype(float), depth[v, u][some]
    local = np.column_stack([(pixels - [PHOTO.cx, PHOTO.cy]) / PHOTO.fx, np.ones(300)]) * z[:, None]
    local *= 1.0 + random.normal(0, off, (300, 1))
    gray = cv2.cvtColor(np.clip(gain * color, 0, 255).astype(np.uint8), cv2.COLOR_RGB2GRAY)
    points = local @ pose[:3, :3].T + pose[:3, 3]
    return TrackedPhoto(without_light(gray), PHOTO, np.linalg.inv(pose), pixels, points), depth


@pytest.fixture(scope="module")
def three(scene):
    """Three photos 15 degrees apart, exposed differently, whose points are off by 5 mm."""
    poses = orbit(24, elevations_deg=(15.0,))[:3]
    return [photo(scene, pose, gain, off=0.005) for pose, gain in zip(poses, (1.0, 0.85, 1.15), strict=True)]


def test_corners_are_followed_to_where_the_scene_has_them(three):
    first, depth = three[0]
    corners, seen = follow(first, [other for other, _ in three[1:]])
    assert len(corners) > 200
    at = np.rint(corners).astype(int)
    there = depth[at[:, 1], at[:, 0]]
    smooth = cv2.dilate(depth, np.ones((5, 5))) - cv2.erode(depth, np.ones((5, 5))) < 0.01
    known = smooth[at[:, 1], at[:, 0]] & (there > 0)
    for index, (other, _) in enumerate(three[1:]):
        off = np.linalg.norm(seen[index] - other.project(first.unproject(corners, there)), axis=1)[known]
        assert np.isfinite(off).mean() > 0.4
        assert np.nanmedian(off) < 0.2  # the depth of the nearest whole pixel adds 0.1
        assert np.nanpercentile(off, 90) < 1.0


def test_followed_corners_lie_on_the_surface(three, scene):
    first, depth = three[0]
    corners, seen = follow(first, [other for other, _ in three[1:]])
    points, good = _triangulate([view for view, _ in three], np.concatenate([corners[None], seen]))
    all_three = good.sum(axis=0) == 3
    assert all_three.sum() > 100
    local = points[all_three] @ first.cam_from_world[:3, :3].T + first.cam_from_world[:3, 3]
    at = np.rint(corners[all_three]).astype(int)
    assert_allclose(np.median(np.abs(local[:, 2] - depth[at[:, 1], at[:, 0]])), 0.0, rtol=0, atol=1e-3)  # 0.1 px is


def test_sightings_far_from_their_point_and_parallel_rays_are_left_out(three):
    views = [view for view, _ in three]
    point = np.array([[0.02, 0.25, 0.1]])
    sighted = np.stack([view.project(point) for view in views])
    points, good = _triangulate(views, sighted)
    assert_allclose(points, point, rtol=0, atol=1e-9)
    assert good.all()
    sighted[2] += [0.0, 40.0]
    assert not _triangulate(views, sighted)[1].all()
    assert not _triangulate([views[0]] * 3, np.stack([sighted[0]] * 3))[1].any()


def test_a_plain_picture_is_followed_nowhere():
    plain = TrackedPhoto(np.full((90, 120), 128, np.uint8), PHOTO, np.eye(4), np.empty((0, 2)), np.empty((0, 3)))
    corners, seen = follow(plain, [plain])
    assert corners.shape == (0, 2)
    assert seen.shape == (1, 0, 2)


def test_cameras_of_a_faint_print_come_closer(tmp_path, monkeypatch):
    poses = orbit(20, elevations_deg=(15.0,))
    faint = make_scene(contrast=0.35)
    faint.floor[:] = 150
    found, off = photos(faint, tmp_path / "faint", poses, PHOTO, board=False), []
    for adjusted in (False, True):
        job = Job()
        if not adjusted:
            monkeypatch.setattr(sfm, "adjust", lambda model, *rest: model)
        cameras, _ = estimate_cameras(found, SfmConfig(), job)
        monkeypatch.undo()
        assert len(cameras.names) == len(poses)
        centers, truth = cameras.world_from_cam[:, :3, 3], poses[:, :3, 3]
        scale, motion = fit_similarity(centers, truth)
        off.append(np.median(np.linalg.norm(scale * centers @ motion[:3, :3].T + motion[:3, 3] - truth, axis=1)))
    assert job.metrics["tracked_points"] > 1000
    assert off[1] < 0.6 * off[0]
    assert off[1] < 2e-3  # at 1 m and 1.9 mm per pixel


class Placed:
    """A model that knows the errors of its points only."""

    def __init__(self, *errors):
        self.points3D = {number: SimpleNamespace(error=error) for number, error in enumerate(errors)}


@pytest.mark.parametrize("after", [0.6, float("nan"), None])
def test_cameras_stay_where_an_adjustment_fails(monkeypatch, after):
    def spoil(model, *rest):
        if after is None:
            raise ValueError("no convergence")
        return Placed(after), 100

    monkeypatch.setattr(adjust_module, "_adjust", spoil)
    model, job = Placed(0.4), Job()
    assert adjust_module.adjust(model, None, job) is model
    assert "as their features placed them" in job.notes[0]
    assert "tracked_points" not in job.metrics


def test_wrong_sightings_farther_off_do_not_spoil_an_adjustment(monkeypatch):
    better = Placed(*[0.2] * 98, 20.0, 26.0)
    monkeypatch.setattr(adjust_module, "_adjust", lambda *given: (better, 100))
    job = Job()
    assert adjust_module.adjust(Placed(*[0.3] * 98, 1.0, 3.0), None, job) is better
    assert not job.notes


@pytest.mark.parametrize(("from_straight", "kept"), [(0.5, 0.0), (2.0, -0.5), (None, -0.5)])
def test_a_much_bent_lens_is_adjusted_from_a_straight_one_too(monkeypatch, from_straight, kept):
    """The lower of two minima is kept; where there is no way from the straight one, what was found."""
    camera = SimpleNamespace(width=480, height=360, params=np.array([528.0, 240.0, 180.0, -0.5]))

    def solve(model, *rest, **options):
        straight = model.cameras[1].params[3] == 0.0
        if straight and from_straight is None:
            raise ValueError("no convergence")
        return from_straight if straight else 1.0

    monkeypatch.setattr(adjust_module, "solve", solve)
    found, cost = adjust_module._from_both_sides(SimpleNamespace(cameras={1: camera}))
    assert found.cameras[1].params[3] == kept
    assert cost == (0.5 if kept == 0.0 else 1.0)


@pytest.mark.parametrize(("slope", "bent"), [(4e4, True), (1.0, False)])
def test_a_lens_is_as_bent_as_its_sightings_tell(monkeypatch, slope, bent):
    """A loss that is a parabola in k1, of that slope: the most probable bend beside the least of a dense search."""
    camera = SimpleNamespace(width=800, height=600, params=np.array([920.0, 400.0, 300.0, 0.0]))
    best, least, photos_placed = -0.05, 1000.0, 36

    def solve(model, soft_px, bent):
        k1 = best if bent else model.cameras[1].params[3]
        model.cameras[1].params = [920.0, 400.0, 300.0, k1]
        return least + slope * (k1 - best) ** 2

    monkeypatch.setattr(adjust_module, "solve", solve)
    found = adjust_module._as_bent_as_shown(SimpleNamespace(cameras={1: camera}, num_reg_images=lambda: photos_placed))

    searched = np.linspace(-0.06, 0.01, 70_001)
    bends = searched * (400**2 + 300**2) / 920**2
    variance = least / (adjust_module.INDEPENDENT * photos_placed)
    log_posterior = -slope * (searched - best) ** 2 / variance - np.log1p(0.5 * (bends / adjust_module.USUAL_BEND) ** 2)
    most_probable = searched[np.argmax(log_posterior)]
    assert_allclose(found.cameras[1].params[3], most_probable, rtol=0, atol=1e-6)  # the search's own step
    assert (abs(most_probable) > 0.04) == bent


@pytest.mark.parametrize(("k1", "solved"), [(-0.002, 1), (-0.05, 2)])
def test_a_lens_all_but_straight_or_one_that_cannot_be_straight_stays_as_found(monkeypatch, k1, solved):
    camera, calls = SimpleNamespace(width=800, height=600, params=np.array([920.0, 400.0, 300.0, k1])), []

    def solve(model, soft_px, bent):
        calls.append(bent)
        if not bent:
            raise ValueError("no convergence")
        return 1.0

    monkeypatch.setattr(adjust_module, "solve", solve)
    found = adjust_module._as_bent_as_shown(SimpleNamespace(cameras={1: camera}, num_reg_images=lambda: 36))
    assert found.cameras[1].params[3] == k1
    assert len(calls) == solved
