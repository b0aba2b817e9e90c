"""The render mesh on the simulation mesh: exact at rest, rigid under rigid motion, right on a bend."""

from pathlib import Path

import igl
import numba
import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose
from scipy.linalg import polar
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
    assert np.linalg.norm(binding.offset, axis=1).max() > 1e-3
    assert_allclose(apply(binding, sim.vertices), render.vertices, rtol=0, atol=1e-12)  # rounding only


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


def sheets(gap):
    """Two flat sheets that face the same way, and a finer render mesh of both that lies within half a millimetre."""
    sim, fine = flat(11), flat(41)
    up = np.array([0.0, gap, 0.0])
    lift = np.random.default_rng(2).uniform(-5e-4, 5e-4, (2 * len(fine.vertices), 1)) * [0, 1, 0]
    both = np.vstack([fine.vertices, fine.vertices + up]) + lift
    return (
        TriangleMesh(
            np.vstack([sim.vertices, sim.vertices + up]), np.vstack([sim.faces, sim.faces + len(sim.vertices)])
        ),
        TriangleMesh(both, np.vstack([fine.faces, fine.faces + len(fine.vertices)])),
    )


def test_layers_closer_than_the_meshes_are_told_apart_by_their_neighbours():
    sim, render = sheets(gap=5e-4)
    upper, upper_face = np.arange(len(render.vertices)) >= len(render.vertices) // 2, len(sim.faces) // 2
    _, nearest, _ = igl.point_mesh_squared_distance(render.vertices, sim.vertices, sim.faces.astype(np.int64))
    assert 0.2 < ((nearest >= upper_face) != upper).mean() < 0.3  # a quarter lies nearer to the other layer
    corners = bind(render, sim).corners
    assert ((corners >= len(sim.vertices) // 2) == upper[:, None]).all()


def test_a_simulation_mesh_that_is_cut_where_the_render_mesh_is_not_keeps_both_sides():
    render, whole = flat(33), flat(11)
    left = whole.vertices[whole.faces].mean(axis=1)[:, 0] < 0.5
    sides = [trimesh.Trimesh(whole.vertices, whole.faces[side], process=False) for side in (left, ~left)]
    for side in sides:
        side.remove_unreferenced_vertices()
    sim = trimesh.util.concatenate(sides)
    binding = bind(render, TriangleMesh(sim.vertices, sim.faces))
    right = binding.corners[:, 0] >= len(sides[0].vertices)
    away = np.abs(render.vertices[:, 0] - 0.5) > 1e-6
    assert (right == (render.vertices[:, 0] > 0.5))[away].all()


def test_a_crease_does_not_shear_what_stands_off_it():
    """A sheet folded over sharply: what stands on it stays within its height of the surface, and keeps its order."""
    sim, render = flat(21), flat(81, 0.98)
    lifted = TriangleMesh(render.vertices + np.array([0.01, 0.01, 0.01]), render.faces)
    beyond = np.maximum(sim.vertices[:, 0] - 0.5, 0.0)[:, None]
    angle = np.radians(150)
    folded = sim.vertices + beyond * np.array([np.cos(angle) - 1.0, np.sin(angle), 0.0])
    found = apply(bind(lifted, sim), folded)
    squared, _, _ = igl.point_mesh_squared_distance(found, folded, sim.faces.astype(np.int64))
    assert np.sqrt(squared.max()) < 0.0101
    step = np.linalg.norm(np.diff(found.reshape(81, 81, 3), axis=0), axis=2)
    assert step.max() < 2.5 * 0.98 / 80  # one offset turns into the next: no tear of twice the height


def by_hand(binding, rest, positions):
    """The riding vertices by the formula, one at a time: turns as polar factors, from SciPy."""
    then, now = (trimesh.Trimesh(p, binding.turns.faces, process=False) for p in (rest, positions))
    turns = np.zeros((len(rest), 3, 3))
    angles = np.zeros(len(rest))
    for face, (a, b, c) in enumerate(then.faces):
        frames = [np.column_stack([m.vertices[b] - m.vertices[a], m.vertices[c] - m.vertices[a], m.face_normals[face]])
                  for m in (then, now)]  # fmt: skip
        turn, _ = polar(frames[1] @ np.linalg.inv(frames[0]))
        for corner, angle in zip((a, b, c), then.face_angles[face], strict=True):
            turns[corner] += angle * turn
            angles[corner] += angle
    turns /= angles[:, None, None]
    found = []
    for corners, weights, offset in zip(binding.corners, binding.weights, binding.offset, strict=True):
        turn = np.einsum("k,kij->ij", weights, turns[corners])
        found.append(weights @ positions[corners] + turn @ offset)
    return np.array(found)


def test_any_deformation_is_followed_by_the_formula_whatever_the_number_of_threads():
    sim, render = coarse_and_fine()
    binding = bind(render, sim)
    moved = sim.vertices + 0.05 * np.sin(9 * sim.vertices[:, ::-1])
    found = apply(binding, moved)
    assert_allclose(found, by_hand(binding, sim.vertices, moved), rtol=0, atol=1e-13)  # rounding only
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
    assert_allclose(found, 0.0, atol=1e-12)  # no direction is left to stand off in


@pytest.mark.real_data
@pytest.mark.skipif(not GARMENTS.is_dir(), reason="the data folder is absent")
@pytest.mark.parametrize(
    "name",
    [
        "berkeley/shirt/shirt-iso.obj",
        "makehuman/female_elegantsuit01.obj",
        *(
            pytest.param(one, marks=pytest.mark.slow)
            for one in (
                *("tshirt.ply", "berkeley/robe/robe-iso.obj"),
                *("makehuman/male_worksuit01.obj", "makehuman/male_elegantsuit01.obj"),
            )
        ),
    ],
)
def test_no_triangle_turns_over_and_no_layer_is_mistaken_on_foreign_garments_that_are_shaken(name):
    found = measure_transfer(read_mesh(GARMENTS / name))
    assert found["flipped"] == 0
    assert found["largest_stretch"] > 1.3  # they are violent
    assert found["rest_error_mm"] < 1e-9
    assert found["wrong_layer"] == 0
