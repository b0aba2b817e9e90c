"""Systems completed by what their matrix lacks: against dense solutions, and differences of forces."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from cloth_scenes import fabric, tube
from numpy.testing import assert_allclose

from vto_pipeline.cloth.constraints.bending.hinge_moments import by_hinges
from vto_pipeline.cloth.constraints.sweep import add_forces, add_lacking, has_lacking
from vto_pipeline.cloth.implicit_step.lacking import complete
from vto_pipeline.cloth.implicit_step.stiffness import Stiffness
from vto_pipeline.cloth.model.build import build_cloth
from vto_pipeline.model.garment import RestShape
from vto_pipeline.numerics.linear.block_matrix import to_scipy

COUNT = 20


def systems(least, seed=0):
    """P, and N such that P + N is from `least` to 1.67 times P, in directions of its own."""
    rng = np.random.default_rng(seed)
    size = 3 * COUNT
    root = rng.normal(size=(size, size)) + size * np.eye(size)
    turn, _ = np.linalg.qr(rng.normal(size=(size, size)))
    shares = np.concatenate([[least], rng.uniform(0.3, 1.67, size - 1)])
    factored = root @ root.T
    return factored, root @ turn @ np.diag(shares - 1.0) @ turn.T @ root.T, rng.normal(size=(COUNT, 3))


def times(matrix, x):
    return (matrix @ x.reshape(-1)).reshape(-1, 3)


def test_what_is_lacking_is_made_up_for():
    factored, lacking, right = systems(0.3)
    inverse = np.linalg.inv(factored)
    x = times(inverse, right)
    first = x.copy()
    assert complete(x, right, partial(times, inverse), partial(times, lacking)) is None
    wanted = times(np.linalg.inv(factored + lacking), right)

    def size(d):
        return np.sqrt(np.vdot(d, times(factored + lacking, d)))

    assert size(first - wanted) > 0.2 * size(wanted)
    assert size(x - wanted) < 0.05 * size(wanted)


@pytest.mark.parametrize("least", [-0.1, -2.0])
def test_a_system_that_is_not_positive_is_found_out_though_its_factored_part_is(least):
    factored, lacking, right = systems(least)
    inverse = np.linalg.inv(factored)
    values, vectors = np.linalg.eigh(factored + lacking)
    assert values[0] < 0.0 < values[1]
    right = right + 10.0 * times(factored, vectors[:, 0].reshape(-1, 3))  # pulled the way it gives
    found = complete(times(inverse, right), right, partial(times, inverse), partial(times, lacking))
    assert found.curvature < 0.0
    assert_allclose(np.vdot(found.direction, times(factored + lacking, found.direction)), found.curvature, rtol=1e-6)


def test_matrix_and_what_it_lacks_are_the_slope_of_the_forces():
    mesh = tube(0.1, 0.2, 12, 8)
    model = build_cloth(mesh, RestShape(mesh.vertices), fabric(bending=1e-3))
    constraints = by_hinges(model.constraints)
    assert has_lacking(constraints)
    rng = np.random.default_rng(1)
    x = mesh.vertices + rng.normal(0.0, 1e-3, mesh.vertices.shape)
    v, step = rng.normal(size=x.shape), 1e-7
    pull, push = np.zeros_like(x), np.zeros_like(x)
    add_forces(x + step * v, constraints, pull)
    add_forces(x - step * v, constraints, push)
    lacking = np.zeros_like(x)
    add_lacking(x, v, constraints, np.inf, lacking)
    stiffness = Stiffness(replace(model, constraints=constraints)).assemble_exact(x)
    found = (to_scipy(stiffness) @ v.reshape(-1)).reshape(-1, 3)
    slope = (push - pull) / (2.0 * step)
    assert_allclose(found + lacking, slope, rtol=0, atol=1e-5 * np.abs(slope).max())
    assert np.abs(lacking).max() > 1e-3 * np.abs(slope).max()
