"""Links beside a matrix: Gᵀ B G against dense algebra, on all levels, and what they make of the solver."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from stiff_sheets import grid_edges, interpolation, level_matrix, levels_of

from vto_pipeline.numerics.cpu_threads import limited_threads
from vto_pipeline.numerics.linear.block_matrix import Sparse
from vto_pipeline.numerics.linear.conjugate_gradients import pcg
from vto_pipeline.numerics.linear.links import apply_links, apply_links_transposed, make_links, no_links
from vto_pipeline.numerics.linear.multigrid import update_hierarchy, v_cycle

SIDE = 14
COUNT = SIDE * SIDE


def linked(levels, many, seed=0, *, stiff=10.0, held=()):
    """Put random links of four vertices, a quarter of them of two, into the levels."""
    random = np.random.default_rng(seed)
    vertices = np.array([random.choice(COUNT, 4, replace=False) for _ in range(many)], np.int32)
    on = random.dirichlet([1.0, 1.0, 1.0], many)
    weights = np.column_stack([np.ones(many), -on])
    weights[::4, 1:] = [-1.0, 0.0, 0.0]
    weights[np.isin(vertices, held)] = 0.0
    links = make_links(vertices, weights, levels.up, levels.rows)
    normal = random.normal(size=(many, 3))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    links.blocks[:] = stiff * normal[:, :, None] * normal[:, None, :]
    return levels._replace(links=links), vertices, weights


def dense_links(links, vertices, weights, count):
    """Gᵀ B G of the first level."""
    gather = np.zeros((len(vertices), count))
    for row, (at, w) in enumerate(zip(vertices, weights, strict=True)):
        np.add.at(gather[row], at, w)
    wide = np.kron(gather, np.eye(3))
    blocks = np.zeros((3 * len(vertices),) * 2)
    for p, block in enumerate(links.blocks):
        blocks[3 * p : 3 * p + 3, 3 * p : 3 * p + 3] = block
    return wide.T @ blocks @ wide


def product(links, level, x, rows):
    """Gᵀ B G x of a level; `x` has a row for each of all levels."""
    apply_links(links, level, x)
    return np.array([apply_links_transposed(links, i) for i in range(*rows)])


def test_products_on_every_level_are_galerkins():
    levels, vertices, weights = linked(levels_of(grid_edges(SIDE), COUNT), 30)
    expected = dense_links(levels.links, vertices, weights, COUNT)
    random = np.random.default_rng(3)
    for level in range(len(levels.rows) - 1):
        if level > 0:
            up = interpolation(levels, level - 1).toarray()
            expected = up.T @ expected @ up
        rows = (levels.rows[level], levels.rows[level + 1])
        x = np.zeros((levels.rows[-1], 3))
        x[slice(*rows)] = random.normal(size=(rows[1] - rows[0], 3))
        found = product(levels.links, level, x, rows)
        assert_allclose(found.ravel(), expected @ x[slice(*rows)].ravel(), rtol=0, atol=1e-12 * np.abs(expected).max())


def test_the_coarsest_level_is_solved_with_its_links():
    count = 20  # a single level
    edges = np.column_stack([np.arange(count - 1), np.arange(1, count)]).astype(np.int32)
    levels = levels_of(edges, count, mass=0.1)
    vertices, weights = np.array([[0, 7, 12, 19]], np.int32), np.array([[1.0, -0.2, -0.3, -0.5]])
    links = make_links(vertices, weights, levels.up, levels.rows)
    links.blocks[0] = np.diag([5.0, 1.0, 0.5])
    levels = levels._replace(links=links)
    update_hierarchy(levels)
    whole = level_matrix(levels, 0).toarray() + dense_links(links, vertices, weights, count)
    right = np.random.default_rng(1).normal(size=(count, 3))
    levels.right[:count] = right
    v_cycle(levels)
    assert_allclose(levels.guess[:count].ravel(), np.linalg.solve(whole, right.ravel()), rtol=1e-10, atol=0)  # cond 1e3


@pytest.mark.parametrize("stiff", [1e-2, 1e3])
def test_a_cycle_with_links_is_symmetric_and_positive(stiff):
    """Four vertices with one diagonal each would make Jacobi's iteration diverge, and the cycle indefinite."""
    levels, _, _ = linked(levels_of(grid_edges(SIDE), COUNT), 60, stiff=stiff)
    update_hierarchy(levels)
    columns = []
    for unit in np.eye(3 * COUNT):
        levels.right[:COUNT] = unit.reshape(COUNT, 3)
        v_cycle(levels)
        columns.append(levels.guess[:COUNT].ravel().copy())
    operator = np.array(columns)
    assert_allclose(operator, operator.T, rtol=0, atol=1e-11 * np.abs(operator).max())  # rounding
    assert np.linalg.eigvalsh(operator).min() > 0.0


@pytest.mark.parametrize("multigrid", [False, True])
def test_solution_is_that_of_dense_algebra(multigrid):
    levels, vertices, weights = linked(levels_of(grid_edges(SIDE), COUNT, (0, 3)), 40, held=(0, 3))
    update_hierarchy(levels)
    whole = level_matrix(levels, 0).toarray() + dense_links(levels.links, vertices, weights, COUNT)
    right = np.random.default_rng(2).normal(size=(COUNT, 3))
    right[[0, 3]] = 0.0
    found = np.zeros_like(right)
    pcg(levels, right, found, right, 1e-12, 3000, multigrid)
    assert_allclose(found.ravel(), np.linalg.solve(whole, right.ravel()), rtol=0, atol=1e-8)  # tolerance x condition


def test_links_between_sheets_cost_few_iterations():
    """Two sheets held together all over move as one: only coarse levels that know the links can see that."""
    sheet = grid_edges(SIDE)
    count = 2 * COUNT
    iterations = []
    for known in (True, False):
        levels = levels_of(np.vstack([sheet, sheet + COUNT]), count)
        vertices = np.column_stack([np.arange(COUNT), COUNT + np.arange(COUNT)] + [np.zeros(COUNT)] * 2)
        weights = np.tile([1.0, -1.0, 0.0, 0.0], (COUNT, 1))
        links = make_links(vertices.astype(np.int32), weights, levels.up, levels.rows)
        links.blocks[:] = 100.0 * np.eye(3)
        levels = levels._replace(links=links)
        update_hierarchy(levels)
        right = np.random.default_rng(4).normal(size=(count, 3))
        iterations.append(pcg(levels, right, np.zeros_like(right), right, 1e-6, 3000, known)[0])
    assert iterations[0] < 80
    assert iterations[0] < 0.3 * iterations[1]  # block Jacobi


def test_the_same_bits_with_one_thread_and_two():
    found = []
    for threads in (1, 2):
        with limited_threads(threads):
            levels = levels_of(grid_edges(60), 3600)
            many = 3000  # enough to be shared among threads
            random = np.random.default_rng(7)
            vertices = random.integers(0, 3600, (many, 4)).astype(np.int32)
            links = make_links(vertices, random.normal(size=(many, 4)), levels.up, levels.rows)
            links.blocks[:] = np.eye(3)
            levels = levels._replace(links=links)
            update_hierarchy(levels)
            levels.right[:3600] = random.normal(size=(3600, 3))
            v_cycle(levels)
            found.append(levels.guess.copy())
    assert_array_equal(found[0], found[1])


def test_no_links_are_nothing():
    empty = Sparse(np.zeros(10, np.int32), np.empty(0, np.int32), np.empty(0))
    rows = np.array([0, 9])
    one = make_links(np.empty((0, 4), np.int32), np.empty((0, 4)), empty, rows)
    other = no_links(9)
    for a, b in zip(one, other, strict=True):
        assert_array_equal(a, b)
    apply_links(one, 0, np.ones((9, 3)))
    assert apply_links_transposed(one, 4) == (0.0, 0.0, 0.0)
