"""Floors whose height, noise and slope are known, scanned finely by something noisy."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose

from vto_pipeline.geometry.floor import find_floor
from vto_pipeline.geometry.topology import concatenate, vertex_normals
from vto_pipeline.model.mesh import TriangleMesh

EDGE, NOISE, HEIGHT = 0.003, 0.0009, -0.02


def plate(slope_deg=0.0, noise=NOISE, side=0.6, seed=0):
    """A square in triangles of 3 mm at `HEIGHT`, leaning about the depth axis, its points off along +Y."""
    steps = np.arange(0.0, side, EDGE) - 0.5 * side
    x, z = np.meshgrid(steps, steps, indexing="ij")
    at = np.arange(x.size).reshape(x.shape)
    a, b, c, d = at[:-1, :-1].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel(), at[:-1, 1:].ravel()
    rough = np.random.default_rng(seed).normal(0.0, noise, x.size)
    points = np.column_stack([x.ravel(), HEIGHT + np.tan(np.radians(slope_deg)) * x.ravel() + rough, z.ravel()])
    return TriangleMesh(points, np.vstack([np.column_stack([a, c, b]), np.column_stack([a, d, c])]))


def tube(low, high, noise=NOISE):
    """An upright open tube, 8 cm in radius, its points off along their normals."""
    made = trimesh.creation.cylinder(radius=0.08, height=high - low, sections=160)
    sides = np.abs(made.face_normals[:, 2]) < 0.5
    made = made.submesh([np.flatnonzero(sides)], append=True).subdivide_to_size(EDGE)
    upright = made.vertices[:, [0, 2, 1]] * [1.0, 1.0, -1.0] + [0.0, 0.5 * (low + high), 0.0]
    mesh = TriangleMesh(upright, made.faces)
    off = np.random.default_rng(1).normal(0.0, noise, (len(upright), 1))
    return TriangleMesh(upright + off * vertex_normals(mesh), made.faces)


@pytest.mark.parametrize("noise", [0.0002, NOISE, 0.002])
def test_a_level_floor_is_found_however_its_noise_tilts_the_triangles(noise):
    """Half of them lean by more than 20 degrees where the noise is a depth camera's."""
    found = find_floor(concatenate([plate(noise=noise), tube(HEIGHT, 0.06)]), 0.0)
    assert found is not None
    assert_allclose(found.height, HEIGHT, rtol=0, atol=0.05 * noise + 1e-5)
    assert_allclose(found.noise, noise, rtol=0.05)  # 40,000 points, and some of the tube's


def test_a_board_has_two_level_sides():
    made = trimesh.creation.box((0.4, 0.012, 0.3), trimesh.transformations.translation_matrix((0, HEIGHT, 0)))
    made = made.subdivide_to_size(0.01)
    found = find_floor(TriangleMesh(made.vertices, made.faces), 0.0)
    assert found is not None
    assert found.share > 0.8  # the rest are its edges


@pytest.mark.parametrize("noise", [0.0, NOISE])
def test_a_slope_is_no_floor(noise):
    assert find_floor(plate(slope_deg=15.0, noise=noise, side=0.15), 0.5) is None


def test_the_lower_end_of_a_tube_is_no_floor():
    assert find_floor(tube(HEIGHT, 0.06), 0.0) is None
