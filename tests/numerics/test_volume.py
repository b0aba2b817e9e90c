"""Volumes by flux against closed forms."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.testing import assert_allclose

from vto_pipeline.numerics.volume import axis_volumes


def test_a_box_has_its_volume_from_every_axis_and_the_negative_inside_out():
    box = trimesh.creation.box((0.4, 1.7, 0.3))
    faces = np.vstack([box.faces, box.faces[:, ::-1] + len(box.vertices)])
    vertices = np.vstack([box.vertices, box.vertices + 5.0])
    volumes, area = axis_volumes(vertices, faces, np.repeat([0, 1], len(box.faces)), 2)
    assert_allclose(volumes, np.array([[1.0] * 3, [-1.0] * 3]) * 0.4 * 1.7 * 0.3, rtol=1e-12, atol=0)
    assert_allclose(area, box.area, rtol=1e-12, atol=0)


def test_a_floor_counts_for_its_own_axis_only():
    ball = trimesh.creation.icosphere(3, 0.3)
    floor = np.array([[-2.0, -0.3, -2], [2, -0.3, -2], [2, -0.3, 2], [-2, -0.3, 2]])
    vertices = np.vstack([ball.vertices, floor])
    faces = np.vstack([ball.faces, np.array([[0, 2, 1], [0, 3, 2]]) + len(ball.vertices)])
    volumes, _ = axis_volumes(vertices, faces, np.zeros(len(faces), int), 1)
    assert_allclose(volumes[0, [0, 2]], ball.volume, rtol=1e-9, atol=0)
    assert volumes[0, 1] < 0  # a floor that faces up, below the middle
