"""The render mesh on the simulation mesh: exact at rest, rigid under rigid motion, right on a bend."""

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.render.transfer import apply, bind


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
