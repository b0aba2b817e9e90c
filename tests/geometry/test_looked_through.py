"""Cameras on the z axis that look at a plate, which lies a metre before them."""

from __future__ import annotations

import numpy as np
import pytest

from vto_pipeline.geometry.seen.looked_through import cameras_through
from vto_pipeline.model.camera import CameraSet, Intrinsics
from vto_pipeline.model.mesh import TriangleMesh

LENS = Intrinsics(100, 80, 100.0, 100.0, 49.5, 39.5)
FACING = [[0, 2, 1], [0, 3, 2]]


def plate(faces=FACING) -> TriangleMesh:
    return TriangleMesh(np.array([[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1.0]]), np.array(faces))


def cameras(*places) -> CameraSet:
    poses = np.tile(np.eye(4), (len(places), 1, 1))
    poses[:, :3, 3] = places
    return CameraSet(tuple(map(str, range(len(places)))), (LENS,) * len(places), poses)


@pytest.mark.parametrize(
    ("point", "count"),
    [
        ((0, 0, 0.5), 3),
        ((0, 0, 0.98), 3),
        ((0, 0, 0.995), 0),  # nearer to the plate than was asked
        ((0, 0, 1.2), 0),  # behind it
        ((0, 0, -0.5), 0),  # behind the cameras
        ((0.2, 0, 0.5), 2),  # beside the picture of the camera on the left
        ((0, 0.23, 0.5), 0),  # and of all of them: it is not as high as wide
        ((0, 0.19, 0.5), 3),
    ],
)
def test_places_before_a_plate_are_looked_through(point, count):
    ring = cameras((-0.1, 0, 0), (0, 0, 0), (0.1, 0, 0))
    assert list(cameras_through(np.array([point], float), plate(), ring, 0.01)) == [count]


def test_a_back_was_not_seen():
    place = np.array([[0, 0, 0.5]])
    assert list(cameras_through(place, plate([[0, 1, 2], [0, 2, 3]]), cameras((0, 0, 0)), 0.01)) == [0]


def test_beyond_all_that_was_seen_nothing_is_looked_through():
    there = cameras((3, 0, 0))
    assert list(cameras_through(np.array([[3, 0, 0.5]]), plate(), there, 0.01)) == [0]
