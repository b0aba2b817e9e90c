"""Where the object can be, from cameras alone."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scan_scene import look_at

from vto_pipeline.model.camera import CameraSet, Intrinsics
from vto_pipeline.scan.photos.region import REACH, object_region

LENS = Intrinsics(800, 600, 900.0, 900.0, 399.5, 299.5)


def ring(count, radius, *, arc=2 * np.pi, middle=(0.4, 1.1, -0.2), seed=0):
    random = np.random.default_rng(seed)
    turns = arc * np.arange(count) / count
    offset = np.stack([np.sin(turns), 0.2 * np.cos(3 * turns), np.cos(turns)], axis=1)
    eyes = np.array(middle) + radius * offset
    return [look_at(eye, np.array(middle) + random.normal(0, 0.03, 3)) for eye in eyes]


def cameras(poses):
    return CameraSet(tuple(map(str, range(len(poses)))), (LENS,) * len(poses), np.array(poses), metric=False)


@pytest.mark.parametrize("arc", [2 * np.pi, np.pi / 2])
def test_it_is_round_what_all_look_at(arc):
    found = object_region(cameras(ring(24, 2.0, arc=arc)))
    assert_allclose([found.x, found.z], [0.4, -0.2], rtol=0, atol=0.03)  # aims scatter by 0.03
    assert_allclose(found.radius, REACH * 2.0, rtol=0.05, atol=0)
    points = np.array([[0.4, 9.0, -0.2], [0.4 + 0.9 * REACH * 2.0, 0.0, -0.2], [0.4, 1.0, 1.9]])
    assert found.holds(points).tolist() == [True, True, False]


def test_two_close_ups_do_not_shrink_it():
    found = object_region(cameras(ring(24, 2.0) + ring(2, 0.3, seed=1)))
    assert_allclose(found.radius, REACH * 2.0, rtol=0.1, atol=0)


@pytest.mark.parametrize(
    "poses",
    [
        pytest.param(
            [look_at(np.array([0.2 * k, 1.0, 3.0]), np.array([0.2 * k, 1.0, 0.0])) for k in range(9)], id="wall"
        ),
        pytest.param([look_at(np.zeros(3), row[:3, 3]) for row in ring(12, 2.0, middle=(0, 0, 0))], id="panorama"),
        pytest.param(
            [look_at(np.array([0.3 * np.sin(k), 2.0, 0.3 * np.cos(k)]), np.zeros(3)) for k in range(9)], id="from above"
        ),
    ],
)
def test_photos_that_do_not_go_round_a_thing_leave_nothing_out(poses):
    assert object_region(cameras(poses)) is None
