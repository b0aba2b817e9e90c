"""Forward kinematics against products of matrices, rotations against SciPy."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from vto_pipeline.numerics.kinematics import (
    continuous_signs,
    local_rotations,
    matrix_quaternions,
    quaternion_matrices,
    shortest_rotations,
    world_transforms,
)


def test_world_transforms_are_products_of_matrices():
    rng = np.random.default_rng(2)
    parents = [-1, 0, 1, 1, 3]
    turns = Rotation.random(20, rng=rng).as_matrix().reshape(4, 5, 3, 3)
    places = rng.normal(size=(4, 5, 3))
    turn, place = world_transforms(parents, turns, places)
    for t in range(4):
        world = []
        for j, parent in enumerate(parents):
            local = np.eye(4)
            local[:3, :3], local[:3, 3] = turns[t, j], places[t, j]
            world.append(local if parent < 0 else world[parent] @ local)
        np.testing.assert_allclose(turn[t], np.array(world)[:, :3, :3], rtol=0, atol=1e-12)  # rounding
        np.testing.assert_allclose(place[t], np.array(world)[:, :3, 3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(local_rotations(parents, turn), turns, rtol=0, atol=1e-12)
    np.testing.assert_allclose(quaternion_matrices(matrix_quaternions(turns)), turns, rtol=0, atol=1e-12)


def test_the_shortest_rotation_turns_by_the_angle_between():
    rng = np.random.default_rng(3)
    start, end = rng.normal(size=(50, 3)), rng.normal(size=(50, 3))
    end[:2] = -2.0 * start[:2]  # half a turn
    end[2] = 3.0 * start[2]
    turn = shortest_rotations(start, end)
    u = start / np.linalg.norm(start, axis=1, keepdims=True)
    v = end / np.linalg.norm(end, axis=1, keepdims=True)
    np.testing.assert_allclose(np.einsum("nab,nb->na", turn, u), v, rtol=0, atol=1e-9)  # rounding near half a turn
    between = np.arccos(np.clip((u * v).sum(axis=1), -1, 1))
    angle = np.linalg.norm(Rotation.from_matrix(turn).as_rotvec(), axis=1)
    np.testing.assert_allclose(angle, between, rtol=0, atol=1e-7)  # of the arc cosine


def test_signs_follow_the_frame_before():
    turns = Rotation.from_euler("Z", np.arange(0, 720, 40)[:, None], degrees=True).as_quat()
    mixed = turns * np.where(np.arange(len(turns)) % 3 == 1, -1.0, 1.0)[:, None]
    found = continuous_signs(mixed)
    assert ((found[1:] * found[:-1]).sum(axis=1) > 0).all()
    np.testing.assert_allclose(abs(found), abs(turns), rtol=0, atol=0)
