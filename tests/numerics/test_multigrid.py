"""Multigrid: coarse matrices against Galerkin's product by SciPy, and the V-cycle as the linear operator it is."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from stiff_sheets import grid_edges, interpolation, level_matrix, levels_of

from vto_pipeline.numerics.cpu_threads import limited_threads
from vto_pipeline.numerics.linear.multigrid import invert, invert_dense, update_hierarchy, v_cycle


def applied(levels, count):
    """The V-cycle as a dense matrix."""
    columns = []
    for unit in np.eye(3 * count):
        levels.right[:count] = unit.reshape(count, 3)
        v_cycle(levels)
        columns.append(levels.guess[:count].ravel().copy())
    return np.array(columns).T


def test_coarse_matrices_are_galerkins():
    held = (0, 1, 30, 400)
    levels = levels_of(grid_edges(30), 900, held)
    count = len(levels.rows) - 1
    assert count >= 3  # more than one is coarse
    for level in range(count - 1):
        up = interpolation(levels, level)
        expected = (up.T @ level_matrix(levels, level) @ up).toarray()
        found = level_matrix(levels, level + 1).toarray()
        assert_allclose(found, expected, rtol=0, atol=1e-13 * np.abs(expected).max())  # rounding
    assert_allclose(interpolation(levels, 0).toarray()[[0, 1, 2, 90, 1200]], 0.0, rtol=0, atol=0)  # held


def test_interpolation_reaches_what_all_vertices_share():
    """A sheet moved as one costs no elastic energy: only coarse levels can see it."""
    levels = levels_of(grid_edges(30), 900)
    shared = np.ones(3 * 900)
    for level in range(len(levels.rows) - 2):
        up = interpolation(levels, level).toarray()
        coarse = np.linalg.lstsq(up, shared)[0]
        assert_allclose(up @ coarse, shared, rtol=0, atol=1e-12)  # rounding
        shared = coarse


def test_levels_follow_the_matrix():
    levels = levels_of(grid_edges(20), 400)
    levels.matrix.blocks[: levels.slots[1]] *= 3.0
    update_hierarchy(levels)
    up = interpolation(levels, 0)
    expected = (up.T @ level_matrix(levels, 0) @ up).toarray()
    assert_allclose(level_matrix(levels, 1).toarray(), expected, rtol=0, atol=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize("held", [(), (0, 8)])
def test_a_cycle_is_symmetric_and_positive(held):
    levels = levels_of(grid_edges(9), 81, held)
    operator = applied(levels, 81)
    assert_allclose(operator, operator.T, rtol=0, atol=1e-12 * np.abs(operator).max())  # rounding
    assert np.linalg.eigvalsh(operator).min() > 0.0


def test_a_cycle_brings_eigenvalues_together():
    """The condition number of a grid grows with its vertices; of the preconditioned one it must not."""
    spread = []
    for side in (6, 12):
        levels = levels_of(grid_edges(side), side * side, (0,))
        dense = level_matrix(levels, 0).toarray()
        found = np.linalg.eigvals(applied(levels, side * side) @ dense).real
        spread.append(found.max() / found.min())
        assert found.max() < 2.0  # Jacobi is damped enough
    assert spread[1] < 3.0 * spread[0]
    assert spread[1] < 0.05 * np.linalg.cond(dense)


@pytest.mark.parametrize("count", [1, 2, 9, 24])
def test_few_rows_are_solved_directly(count):
    edges = np.column_stack([np.arange(count - 1), np.arange(1, count)]).astype(np.int32)
    levels = levels_of(edges, count, mass=0.1)
    assert_array_equal(levels.rows, [0, count])
    left = applied(levels, count) @ level_matrix(levels, 0).toarray()
    assert_allclose(left, np.eye(3 * count), rtol=0, atol=1e-12)  # condition number below 1e3


CHAINS = np.array([[3 * k + i, 3 * k + i + 1] for k in range(60) for i in range(2)], np.int32)
PIECES = {
    "two sheets": (np.vstack([grid_edges(8), grid_edges(8, 64)]), 128, ()),
    "lone vertices": (grid_edges(8), 100, ()),
    "nothing but lone vertices": (np.empty((0, 2), np.int32), 40, ()),
    "sixty short chains": (CHAINS, 180, ()),
    "a sheet held whole": (np.vstack([grid_edges(8), grid_edges(8, 64)]), 128, range(64)),
    "everything held": (grid_edges(8), 64, range(64)),
}


@pytest.mark.parametrize("name", PIECES)
def test_cloth_in_pieces(name):
    edges, count, held = PIECES[name]
    levels = levels_of(edges, count, held)
    operator = applied(levels, count)
    assert np.isfinite(operator).all()
    assert_allclose(operator, operator.T, rtol=0, atol=1e-12 * np.abs(operator).max())
    assert np.linalg.eigvalsh(operator).min() > 0.0


def test_cycles_have_the_same_bits_with_one_thread_and_two():
    found = []
    for threads in (1, 2):
        with limited_threads(threads):
            levels = levels_of(grid_edges(60), 3600, (0, 59))
            levels.right[:3600] = np.random.default_rng(1).normal(size=(3600, 3))
            v_cycle(levels)
            found.append((levels.matrix.blocks, levels.guess.copy()))
    assert_array_equal(found[0][0], found[1][0])
    assert_array_equal(found[0][1], found[1][1])


def test_three_by_three_inverse():
    root = np.random.default_rng(5).normal(size=(3, 3))
    matrix, found = root @ root.T + 0.1 * np.eye(3), np.empty((3, 3))
    invert(matrix, found)
    assert_allclose(found @ matrix, np.eye(3), rtol=0, atol=1e-12)  # condition number about 100


@pytest.mark.parametrize("condition", [1e2, 1e8])
def test_dense_inverse(condition):
    random = np.random.default_rng(6)
    vectors = np.linalg.qr(random.normal(size=(72, 72)))[0]
    matrix = vectors @ np.diag(np.geomspace(1.0, condition, 72)) @ vectors.T
    found = 0.5 * (matrix + matrix.T)
    expected = np.linalg.inv(found)
    invert_dense(found)
    assert_allclose(found, expected, rtol=0, atol=1e-14 * condition)  # rounding times the condition
