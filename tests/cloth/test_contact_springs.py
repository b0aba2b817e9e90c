"""Springs and friction of contacts in an implicit step, against differences of their energy and the law of friction."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.cloth.collision.response.active_set import no_contacts
from vto_pipeline.cloth.collision.response.contact_springs import (
    add_contacts,
    contact_energy,
    linked_contacts,
    project_to_contacts,
    update_active_set,
)
from vto_pipeline.cloth.collision.response.projected_gauss_seidel import separate_pairs
from vto_pipeline.cloth.collision.self_collision.pairs import Pairs
from vto_pipeline.numerics.linear.block_matrix import BlockMatrix

COUNT, STEP = 6, 1e-7


def contacts(sliding, seed=1):
    """On a plane each, vertices 0 to 3; and a pair between 2 and the middle of 3, 4, 5. All push."""
    rng = np.random.default_rng(seed)
    made = no_contacts(5)
    made.key[:] = [0, 1, 2, 3, 1 << 41]
    for c in range(4):
        made.vertices[c, 0], made.weights[c, 0] = c, 1.0
    made.vertices[4], made.weights[4] = [2, 3, 4, 5], [1.0, -0.3, -0.3, -0.4]
    made.normal[:] = unit(rng.normal(size=(5, 3)))
    made.friction[:], made.pushing[:], made.sliding[:] = 0.4, True, sliding
    made.force[:] = rng.uniform(0.5, 1.0, 5)
    made.level[:] = 1e-3
    for part in (made.initial_friction, made.friction_force, made.trial):
        part[:] = along(made, rng.normal(size=(5, 3)))
    made.carried[:] = 1e-4 * rng.normal(size=(5, 3))
    return made


def unit(a):
    return a / np.linalg.norm(a, axis=1, keepdims=True)


def along(made, a):
    return a - np.einsum("ij,ij->i", a, made.normal)[:, None] * made.normal


def slips(made, x, y):
    moved = np.einsum("kw,kwd->kd", made.weights, (y - x)[made.vertices])
    return along(made, moved - made.carried)


def solved(made, x, y, h=0.01, firm=False, stiffness=1e3):
    """What the contacts add: the matrix, dense, and the forces."""
    diagonal = np.arange(COUNT)
    stiff = np.tile(stiffness * np.eye(3), (COUNT, 1, 1))
    matrix = BlockMatrix(np.arange(COUNT + 1, dtype=np.int32), diagonal.astype(np.int32), stiff.copy(), diagonal)
    right, held, mass = np.zeros((COUNT, 3)), np.zeros(COUNT, np.bool_), np.full(COUNT, 1e-3)
    vertices, weights = linked_contacts(made, held)
    between = np.zeros((len(vertices), 3, 3))
    add_contacts(made, mass, held, h, x, y, matrix, right, between, firm)
    dense = np.zeros((COUNT, 3, COUNT, 3))
    for i in range(COUNT):
        dense[i, :, i] += matrix.blocks[i] - stiff[i]
    for corners, shares, block in zip(vertices, weights, between, strict=True):
        for i, a in zip(corners, shares, strict=True):
            for j, b in zip(corners, shares, strict=True):
                dense[i, :, j] += a * b * block
    return dense.reshape(3 * COUNT, -1), right.ravel()


@pytest.mark.parametrize("firm", [False, True])
@pytest.mark.parametrize("sliding", [False, True])
def test_forces_and_stiffness_are_those_of_the_energy(sliding, firm):
    rng = np.random.default_rng(3)
    made = contacts(sliding)
    x = 1e-2 * rng.normal(size=(COUNT, 3))
    y = x + 1e-4 * rng.normal(size=(COUNT, 3))
    matrix, right = solved(made, x, y, firm=firm)

    def energy(d):
        return contact_energy(made, x, y + d.reshape(-1, 3))

    size = 1e-4
    steps = size * np.eye(3 * COUNT)
    slope = [(energy(s) - energy(-s)) / (2 * size) for s in steps]
    assert_allclose(-np.array(slope), right, rtol=1e-7, atol=1e-9 * np.abs(right).max())
    bend = [
        [(energy(s + t) - energy(s - t) - energy(t - s) + energy(-s - t)) / (4 * size**2) for t in steps] for s in steps
    ]
    assert_allclose(bend, matrix, rtol=1e-5, atol=1e-7 * np.abs(matrix).max())


def test_a_firm_pair_is_as_stiff_as_the_cloth_on_either_side_in_series():
    """However little it bears. Cloth that is about to buckle between two layers is held by nothing else."""
    soft, firm = contacts(False), contacts(False)
    x = np.zeros((COUNT, 3))
    for made, is_firm in ((soft, False), (firm, True)):
        made.force[4] = 1e-9
        solved(made, x, x, firm=is_firm)
    cloth = 1e3 + 1e3 * 1e-3 / 0.01**2  # and much stiffer than inertia
    assert_allclose(firm.normal_stiffness[4], cloth / (1.0 + 0.3**2 + 0.3**2 + 0.4**2), rtol=1e-12)
    assert_allclose(firm.tangential_stiffness[4], firm.normal_stiffness[4], rtol=1e-12)
    assert soft.normal_stiffness[4] < 0.1 * firm.normal_stiffness[4]
    assert_allclose(firm.normal_stiffness[:4], soft.normal_stiffness[:4], rtol=1e-12)


def test_cloth_that_would_buckle_is_no_negative_spring():
    made, x = contacts(False), np.zeros((COUNT, 3))
    solved(made, x, x, firm=True, stiffness=-1e9)
    inertia = 1e3 * 1e-3 / 0.01**2
    assert_allclose(made.normal_stiffness[4], inertia / (1.0 + 0.3**2 + 0.3**2 + 0.4**2), rtol=1e-12)
    assert (made.normal_stiffness > 0.0).all()


def test_what_slides_has_the_tangent_of_coulombs_force():
    """The derivative of μ N p / |p|, with p what friction were if the slider held: consistent with a return mapping."""
    rng = np.random.default_rng(5)
    made = contacts(True)
    x = 1e-2 * rng.normal(size=(COUNT, 3))
    y = x + 1e-3 * rng.normal(size=(COUNT, 3))
    solved(made, x, y)  # sets the springs
    cling, hold = made.tangential_stiffness[:, None], (made.friction * made.force)[:, None]
    made.trial[:] = made.initial_friction - cling * slips(made, x, y)
    assert (np.linalg.norm(made.trial, axis=1) > 2.0 * hold[:, 0]).all()

    def coulomb(there):
        trial = made.initial_friction - cling * slips(made, x, there)
        return hold * unit(trial)

    matrix, _ = solved(made, x, y)
    for i in range(2):  # those of a single contact
        for d in range(3):
            step = np.zeros_like(x)
            step[i, d] = 1e-9
            change = (coulomb(y + step) - coulomb(y - step))[i] / 2e-9
            normal = made.normal_stiffness[i] * made.normal[i] * made.normal[i, d]
            assert_allclose(normal - change, matrix[3 * i : 3 * i + 3, 3 * i + d], rtol=1e-5, atol=1e-3)


@pytest.mark.parametrize("seed", range(5))
def test_friction_is_the_trial_or_the_limit_in_its_direction(seed):
    rng = np.random.default_rng(seed)
    made = contacts(rng.random(5) < 0.5, seed)
    x = 1e-2 * rng.normal(size=(COUNT, 3))
    y = x + 1e-3 * rng.normal(size=(COUNT, 3))
    solved(made, x, y)
    gap = np.einsum("kw,kwd,kd->k", made.weights, y[made.vertices], made.normal) - made.level - made.rest_offset
    trial = made.initial_friction - made.tangential_stiffness[:, None] * slips(made, x, y)
    update_active_set(made, x, y, 0.0)
    touches = gap <= 0.0
    assert 0 < touches.sum() < 5 or seed > 0
    assert (made.pushing == touches).all()
    assert_allclose(made.force[touches], (-made.normal_stiffness * gap)[touches], rtol=1e-12)
    limit = made.friction * made.force
    size = np.linalg.norm(trial, axis=1)
    wanted = trial * np.minimum(1.0, limit / size)[:, None]
    assert_allclose(made.friction_force[touches], wanted[touches], rtol=1e-12, atol=1e-15)
    assert (made.friction_force[~touches] == 0.0).all()
    assert not (made.sliding & (size <= limit) & touches).any()


@pytest.mark.parametrize("share", [0.5, 1e-3])
def test_held_places_are_not_put_right_by_what_is_hardly_beside_them(share):
    """A free corner with so much of the place touched has to go gap / share; with little, out of all proportion."""
    made, gap = no_contacts(1), 1e-3
    made.key[0], made.vertices[0], made.weights[0] = 1 << 41, [0, 1, 2, 3], [1.0, -share, -0.4, share - 0.6]
    made.normal[0], made.level[0], made.pushing[0] = [0.0, 1.0, 0.0], gap, True
    x, held = np.zeros((4, 3)), np.array([True, False, True, True])
    at = np.arange(4)
    matrix = BlockMatrix(np.arange(5, dtype=np.int32), at.astype(np.int32), np.tile(1e3 * np.eye(3), (4, 1, 1)), at)
    right, between = np.zeros((4, 3)), np.zeros((1, 3, 3))
    _, weights = linked_contacts(made, held)
    add_contacts(made, np.full(4, 1e-3), held, 0.01, x, x, matrix, right, between, False)
    move = np.linalg.solve(matrix.blocks[1] + weights[0, 1] ** 2 * between[0], right[1])
    by_guess = np.zeros((4, 3))
    project_to_contacts(made, np.where(held, 0.0, 1e3), x, x, by_guess)
    if share > 0.1:
        assert 0.2 * gap / share < -move[1] <= gap / share
        assert_allclose(by_guess[1, 1], -gap / share, rtol=1e-12)
    else:
        assert not move.any()
        assert not by_guess.any()


@pytest.mark.parametrize("share", [0.5, 1e-3])
def test_nor_by_position_based_contacts_that_are_hardly_beside_them(share):
    """Here each contact is put right as a whole: the free corner goes gap / share, or not at all."""
    weights, gap = np.array([[1.0, -share, -0.4, share - 0.6]]), np.array([1e-3])
    up, nothing = np.array([[0.0, 1.0, 0.0]]), np.zeros((1, 3))
    pairs = Pairs(np.array([7]), np.arange(4, dtype=np.int32)[None], weights, up, gap, np.zeros(1), nothing, nothing)
    x = np.zeros((4, 3))
    separate_pairs(pairs, np.array([0.0, 1e3, 0.0, 0.0]), np.zeros((4, 3)), x)
    assert_allclose(x[1, 1], -gap[0] / share if share > 0.1 else 0.0, rtol=1e-12)
    assert not np.delete(x, 1, axis=0).any()
