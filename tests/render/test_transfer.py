"""The render mesh on the simulation mesh: exact at rest, rigid under rigid motion, right on a bend."""

from pathlib import Path

import numba
import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from vto_pipeline.bench.drape.transfer import measure_transfer
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.render.transfer import apply, bind

GARMENTS = Path(__file__).parents[2].parent / "shared" / "data" / "garments"


def coarse_and_fine():
    ball = trimesh.creation.icosphere(2, 0.3)
    cut = ball.submesh([np.flatnonzero(ball.triangles_center[:, 1] > 0)], append=True)
    coarse = TriangleMesh(cut.vertices, cut.faces)
    fine = cut.subdivide().subdivide()
    rng = np.random.default_rng(0)
    return coarse, TriangleMesh(fine.vertices + rng.normal(0, 2e-3, fine.vertices.shape), fine.faces)


def test_rest_gives_the_render_mesh_back():
    sim, render = coarse_and_fine()
    binding = bind(render, sim)
    assert np.abs(binding.height).max() > 1e-3
    assert_allclose(apply(binding, sim.vertices), render.vertices, rtol=0, atol=1e-12)  # rounding only
    assert binding.turned_away == 0


def test_rigid_motion_moves_it_rigidly():
    sim, render = coarse_and_fine()
    turn = Rotation.from_rotvec([1.0, -2.0, 0.5]).as_matrix()
    found = apply(bind(render, sim), sim.vertices @ turn.T + [1, 2, 3])
    assert_allclose(found, render.vertices @ turn.T + [1, 2, 3], rtol=0, atol=1e-12)  # rounding only


def flat(count, width=1.0):
    x, z = np.meshgrid(np.linspace(0, width, count), np.linspace(0, width, count), indexing="ij")
    corner = (np.arange(count - 1)[:, None] * count + np.arange(count - 1)).ravel()
    faces = np.vstack(
        [
            np.column_stack([corner, corner + 1, corner + count]),
            np.column_stack([corner + 1, corner + count + 1, corner + count]),
        ]
    )
    return TriangleMesh(np.column_stack([x.ravel(), 0 * x.ravel(), z.ravel()]), faces)


def rolled(points, radius):
    x, y, z = points.T
    return np.column_stack([(radius + y) * np.sin(x / radius), (radius + y) * np.cos(x / radius) - radius, z])


@pytest.mark.parametrize("count", [21, 41])
def test_height_follows_a_bend(count):
    sim, radius = flat(count), 0.5
    render = flat(33, 0.98)
    lifted = TriangleMesh(render.vertices + np.array([0.01, 0.02, 0.01]), render.faces)
    found = apply(bind(lifted, sim), rolled(sim.vertices, radius))
    wanted = rolled(lifted.vertices, radius)
    inner = (lifted.vertices[:, 0] > 0.1) & (lifted.vertices[:, 0] < 0.9)
    error = np.linalg.norm(found - wanted, axis=1)[inner].max()
    step = 1 / (count - 1)
    assert error < 1.2 * step**2 / (8 * radius) + 0.02 * step / radius * 0.5  # sagitta of the chord, turn of the normal
    assert error > 1e-6


def test_the_other_side_of_a_fold_is_not_taken():
    """Two layers 1 mm apart: the render vertices of the upper lie nearer to the lower, which faces away."""
    top, bottom = flat(11), flat(11)
    upper = top.vertices + np.array([0, 0.001, 0])
    sim = TriangleMesh(np.vstack([upper, bottom.vertices]), np.vstack([top.faces, bottom.faces[:, ::-1] + 121]))
    render = TriangleMesh(top.vertices + np.array([0, 0.0002, 0]), top.faces)
    binding = bind(render, sim)
    assert (binding.corners < 121).all()
    moved = sim.vertices.copy()
    moved[:121, 1] += 0.1
    assert_allclose(apply(binding, moved)[:, 1], 0.1002, rtol=0, atol=1e-9)


def by_hand(binding, positions):
    """The riding vertices by the formula, one at a time."""
    tri = trimesh.Trimesh(positions, binding.faces, process=False)
    corner_normals = np.zeros_like(positions)
    for face, angles, normal in zip(tri.faces, tri.face_angles, tri.face_normals, strict=True):
        corner_normals[face] += angles[:, None] * normal
    corner_normals /= np.linalg.norm(corner_normals, axis=1, keepdims=True)
    found = []
    for corners, weights, height, residual in zip(
        binding.corners, binding.weights, binding.height, binding.residual, strict=True
    ):
        a, b, c = positions[corners]
        up = weights @ corner_normals[corners]
        along = (b - a) / np.linalg.norm(b - a)
        normal = np.cross(b - a, c - a) / np.linalg.norm(np.cross(b - a, c - a))
        frame = np.array([along, np.cross(normal, along), normal])
        found.append(weights @ positions[corners] + height * up / np.linalg.norm(up) + residual @ frame)
    return np.array(found)


def test_any_deformation_is_followed_by_the_formula_whatever_the_number_of_threads():
    sim, render = coarse_and_fine()
    binding = bind(render, sim)
    moved = sim.vertices + 0.05 * np.sin(9 * sim.vertices[:, ::-1])
    found = apply(binding, moved)
    assert np.abs(binding.residual).max() > 1e-4
    assert_allclose(found, by_hand(binding, moved), rtol=0, atol=1e-13)  # rounding only
    threads = numba.get_num_threads()
    try:
        numba.set_num_threads(1)
        assert np.array_equal(apply(binding, moved), found)
    finally:
        numba.set_num_threads(threads)


def test_a_triangle_that_has_collapsed_carries_its_vertices_along():
    sim, render = coarse_and_fine()
    point = np.zeros_like(sim.vertices)
    found = apply(bind(render, sim), point)
    assert np.isfinite(found).all()
    assert_allclose(found, 0.0, atol=1e-12)  # no direction is left for height and residual


@pytest.mark.real_data
@pytest.mark.skipif(not GARMENTS.is_dir(), reason="the data folder is absent")
@pytest.mark.parametrize("name", ["tshirt.ply", "makehuman/female_sportsuit01.obj"])
def test_no_triangle_turns_over_on_foreign_garments_that_are_shaken(name):
    found = measure_transfer(read_mesh(GARMENTS / name))
    assert found["flipped"] == 0
    assert found["largest_stretch"] > 1.3  # they are violent
    assert found["rest_error_mm"] < 1e-9
    assert found["wrong_layer"] == 0
