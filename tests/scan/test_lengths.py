"""Scale from stated lengths, against a scene whose size is known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scan_scene import look_at

from vto_pipeline.errors import ScanError
from vto_pipeline.model.camera import CameraSet, Intrinsics
from vto_pipeline.model.job import Job
from vto_pipeline.scan.photos.lengths import StatedLength, scale_from_lengths

LENS = Intrinsics(800, 600, 900.0, 900.0, 399.5, 299.5, -0.02)
UNIT = 3.7  # units of the cameras' frame per metre


@pytest.fixture(scope="module")
def cameras():
    turns = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    eyes = np.stack([1.5 * np.sin(turns), 0.3 * np.cos(2 * turns), 1.5 * np.cos(turns)], axis=1)
    poses = np.array([look_at(eye, np.zeros(3)) for eye in eyes])
    poses[:, :3, 3] *= UNIT
    return CameraSet(tuple(f"{k}.jpg" for k in range(8)), (LENS,) * 8, poses, metric=False, unregistered=("lost.jpg",))


def marks(cameras, point, photos, noise=0.0, seed=0):
    """Pixels at which a point [m] is seen, by the definition of the lens."""
    random, seen = np.random.default_rng(seed), {}
    for number in photos:
        pose = cameras.world_from_cam[number]
        x, y, z = (UNIT * np.asarray(point) - pose[:3, 3]) @ pose[:3, :3]
        flat = np.array([x / z, y / z])
        bent = flat * (1 + LENS.k1 * flat @ flat)
        pixel = bent * 900.0 + [399.5, 299.5] + random.normal(0, noise, 2)
        seen[cameras.names[number]] = (float(pixel[0]), float(pixel[1]))
    return seen


def stated(cameras, metres, one=(0.1, 0.3, 0.05), other=(-0.1, -0.35, 0.0), **more):
    return StatedLength(
        metres=metres, one=marks(cameras, one, (0, 1, 7), **more), other=marks(cameras, other, (0, 1, 7), **more)
    )


TRUE = float(np.linalg.norm(np.subtract((0.1, 0.3, 0.05), (-0.1, -0.35, 0.0))))


def test_exact_marks_give_the_exact_scale(cameras):
    scale, _ = scale_from_lengths(cameras, (stated(cameras, TRUE),), 2.0, Job())
    assert_allclose(scale, 1 / UNIT, rtol=1e-9)


def test_marks_a_pixel_off_give_the_scale_within_its_stated_error(cameras):
    errors, said = [], []
    for seed in range(40):
        scale, error = scale_from_lengths(cameras, (stated(cameras, TRUE, noise=0.7, seed=seed),), 5.0, Job())
        errors.append(scale * UNIT - 1)
        said.append(error)
    ratio = np.std(errors) / np.mean(said)
    assert 0.25 < ratio < 1.5  # said of marks a pixel off in all; 0.7 px each way are that


def test_lengths_that_contradict_each_other_are_refused(cameras):
    centimetres = stated(cameras, 100 * TRUE)
    with pytest.raises(ScanError, match="contradict"):
        scale_from_lengths(cameras, (stated(cameras, TRUE), centimetres), 2.0, Job())


def test_marks_of_different_spots_are_refused(cameras):
    length = stated(cameras, TRUE)
    wrong = dict(length.one)
    wrong["1.jpg"] = (wrong["1.jpg"][0], wrong["1.jpg"][1] + 60.0)
    with pytest.raises(ScanError, match="not of one point"):
        scale_from_lengths(cameras, (length.model_copy(update={"one": wrong}),), 2.0, Job())


@pytest.mark.parametrize(("name", "why"), [("lost.jpg", "could not be placed"), ("other.jpg", "not among")])
def test_a_photo_without_a_pose_is_named(cameras, name, why):
    length = stated(cameras, TRUE)
    with pytest.raises(ScanError, match=why):
        scale_from_lengths(cameras, (length.model_copy(update={"one": {**length.one, name: (1.0, 2.0)}}),), 2.0, Job())
