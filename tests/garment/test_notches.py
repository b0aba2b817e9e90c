"""Torn rims: what is a notch, and what a part of the opening. Tubes whose angles have formulas."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.garment.notches import close_notches, in_sheet
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import submesh
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh


def tube(radius: float, height: float, edge: float) -> TriangleMesh:
    """An open tube about +Y, from y = 0 up, its faces outward."""
    around, along = round(2 * np.pi * radius / edge), round(height / edge) + 1
    turn, up = np.meshgrid(2 * np.pi * np.arange(around) / around, np.linspace(0, height, along), indexing="ij")
    at = np.arange(around * along).reshape(around, along)
    beside = np.roll(at, -1, axis=0)
    a, b, c, d = at[:, :-1].ravel(), beside[:, :-1].ravel(), beside[:, 1:].ravel(), at[:, 1:].ravel()
    vertices = np.stack([radius * np.sin(turn), up, radius * np.cos(turn)], axis=-1).reshape(-1, 3)
    return TriangleMesh(vertices, np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])]))


def post(radius: float, behind: float) -> SurfaceDistance:
    """An upright post, closed, its axis so far behind the tube's."""
    import trimesh

    made = trimesh.creation.cylinder(radius=radius, height=1.6, sections=96)
    return SurfaceDistance(TriangleMesh(made.vertices[:, [1, 2, 0]] - [0, 0, behind], made.faces))


def nowhere(points: FloatArray) -> bool:
    """Nothing was seen of the post."""
    return False


def test_a_line_across_the_mouth_of_a_hem_that_stands_off_closes_no_notch() -> None:
    """The hem is torn in front and 12 cm before the body: the line from side to side passes between, and what it would
    leave is rounder. But it lies across the cloth."""
    cloth = tube(0.18, 0.3, 0.006)
    x, y, z = cloth.vertices.T
    turn = np.arctan2(x, z)
    torn = 0.035 * (1.0 + np.cos(2 * np.pi * turn * 0.18 / 0.08)) * (np.abs(turn) < 1.2) * (1 - y / 0.3)
    ragged = TriangleMesh(np.column_stack([x, y + torn, z]), cloth.faces)
    closed, _ = close_notches(ragged, post(0.07, 0.1), nowhere, 0.15, 0.06)
    new = closed.vertices[len(ragged.vertices) :]
    assert_allclose(np.hypot(new[:, 0], new[:, 2]), 0.18, atol=0.012)  # in the tears alone


def test_a_strip_missing_along_a_sleeve_is_a_notch() -> None:
    sleeve = tube(0.05, 0.3, 0.004)
    x, y, z = sleeve.vertices[sleeve.faces].mean(axis=1).T
    torn = submesh(sleeve, ~((np.abs(np.arctan2(x, z)) < np.radians(40.0)) & (y < 0.2)))[0]
    _, count = close_notches(torn, post(0.03, 0.0), nowhere, 0.15, 0.06)
    assert count == 1


@pytest.mark.parametrize("half_angle", [0.3, 0.9, 1.4])
def test_how_far_a_strip_runs_on_as_the_cloth_beside_it_has_a_formula(half_angle: float) -> None:
    """Along its sides the cosine is that of half the angle; across its end it varies as the normal turns. What closes
    it leans from the end's arc to the line across the mouth."""
    radius, length, side = 0.05, 0.2, 400
    turn = np.linspace(-half_angle, half_angle, side)
    up, down = np.linspace(0.0, length, side), np.linspace(length, 0.0, side)
    angle = np.concatenate([np.full(side, -half_angle), turn[1:], np.full(side - 1, half_angle)])
    height = np.concatenate([up, np.full(side - 1, length), down[1:]])  # with the cloth on the left, from outside
    outward = np.column_stack([np.sin(angle), 0.0 * angle, np.cos(angle)])
    rim = radius * outward + height[:, None] * [0.0, 1.0, 0.0]
    beside = outward * np.linalg.norm(np.roll(rim, -1, axis=0) - rim, axis=1)[:, None]
    first, last = np.array([0]), np.array([len(rim) - 1])
    area = 0.5 * np.cross(rim, np.roll(rim, -1, axis=0)).sum(axis=0)[None]
    front = 2.0 * radius * np.sin(half_angle) * length
    below = radius**2 * (half_angle - np.sin(half_angle) * np.cos(half_angle))
    lean = front / np.hypot(front, below)
    expected = 2.0 * (radius * np.sin(half_angle) + length * np.cos(half_angle)) * lean
    assert_allclose(in_sheet(area, beside, first, last), expected, rtol=0.002)  # 400 steps a side
    assert_allclose(in_sheet(-area, beside, first, last), -expected, rtol=0.002)
