"""Sparse matrices of 3 x 3 blocks against SciPy's, under and over the size from which threads share the work."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.sparse import coo_array

from vto_pipeline.numerics.cpu_threads import limited_threads
from vto_pipeline.numerics.linear.block_matrix import PARALLEL_FROM, multiply, pattern, row_times, to_scipy


def random_matrix(count, seed=0):
    """A matrix with about five blocks a row, some given twice, and some rows empty."""
    rng = np.random.default_rng(seed)
    rows, columns = rng.integers(0, count, (2, 4 * count)).astype(np.int32)
    rows[rows % 7 == 3] = 0
    matrix, places = pattern(rows, columns, count)
    values = rng.normal(size=(len(rows), 3, 3))
    np.add.at(matrix.blocks, places, values)
    return matrix, rows, columns, values


@pytest.mark.parametrize("count", [1, 2, 40])
def test_every_block_has_its_place(count):
    matrix, rows, columns, values = random_matrix(count)
    dense = np.zeros((count, 3, count, 3))
    np.add.at(dense, (rows, slice(None), columns), values)
    assert_array_equal(to_scipy(matrix).toarray(), dense.reshape(3 * count, 3 * count))
    for row in range(count):
        inside = matrix.columns[matrix.starts[row] : matrix.starts[row + 1]]
        assert (np.diff(inside) > 0).all()  # ascending, each once
        assert matrix.starts[row] <= matrix.diagonal[row] < matrix.starts[row + 1]
    assert_array_equal(matrix.columns[matrix.diagonal], np.arange(count))


def test_a_matrix_of_no_blocks_has_a_diagonal():
    nothing = np.empty(0, np.int32)
    matrix, places = pattern(nothing, nothing, 4)
    assert len(places) == 0
    assert_array_equal(matrix.starts, [0, 1, 2, 3, 4])
    assert not matrix.blocks.any()


@pytest.mark.parametrize("count", [1, 40, PARALLEL_FROM - 1, PARALLEL_FROM, 6001])
def test_products_are_those_of_scipy(count):
    matrix, rows, columns, values = random_matrix(count, seed=1)
    corner = np.arange(3)
    i = (3 * rows[:, None, None] + corner[:, None] + 0 * corner).ravel()
    j = (3 * columns[:, None, None] + 0 * corner[:, None] + corner).ravel()
    expected = coo_array((values.ravel(), (i, j)), shape=(3 * count, 3 * count)).tocsr()
    x = np.random.default_rng(2).normal(size=(count, 3))
    found = np.full((count, 3), np.nan)
    multiply(matrix, x, found)
    scale = abs(expected) @ np.abs(x).ravel()
    assert_allclose(found.ravel(), expected @ x.ravel(), rtol=0, atol=1e-14 * scale.max())  # rounding of a row's sum
    assert_allclose(to_scipy(matrix) @ x.ravel(), found.ravel(), rtol=0, atol=1e-14 * scale.max())
    assert_array_equal(row_times(matrix, count // 2, x), found[count // 2])


@pytest.mark.parametrize("count", [PARALLEL_FROM - 1, PARALLEL_FROM, 6001])
def test_products_have_the_same_bits_with_one_thread_and_two(count):
    matrix, *_ = random_matrix(count, seed=3)
    x, found = np.random.default_rng(4).normal(size=(count, 3)), np.empty((2, count, 3))
    for threads in (1, 2):
        with limited_threads(threads):
            multiply(matrix, x, found[threads - 1])
    assert_array_equal(found[0], found[1])
