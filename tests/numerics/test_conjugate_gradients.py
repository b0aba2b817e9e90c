"""Conjugate gradients against SciPy's direct solver, and what multigrid saves."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.sparse import csc_array
from scipy.sparse.linalg import spsolve
from stiff_sheets import grid_edges, level_matrix, levels_of

from vto_pipeline.numerics.cpu_threads import limited_threads
from vto_pipeline.numerics.linear.conjugate_gradients import pcg

TIGHT = 1e-13  # share of the residual; a solution then is as good as its condition number, below 1e3, allows


def solved(levels, count, multigrid, tolerance=TIGHT, seed=0):
    right = np.random.default_rng(seed).normal(size=(count, 3))
    x = np.zeros((count, 3))
    done, left = pcg(levels, right, x, right, tolerance, 3000, multigrid)
    return right, x, done, left


SYSTEMS = {
    "sheet": (grid_edges(20), 400, ()),
    "held sheet": (grid_edges(20), 400, (0, 19, 210)),
    "over the size from which threads share": (grid_edges(52), 2704, (0, 51)),
    "one vertex": (np.empty((0, 2), np.int32), 1, ()),
    "two vertices": (np.array([[0, 1]], np.int32), 2, ()),
    "seven": (np.column_stack([np.arange(6), np.arange(1, 7)]).astype(np.int32), 7, (3,)),
    "all of the coarsest": (np.column_stack([np.arange(23), np.arange(1, 24)]).astype(np.int32), 24, ()),
    "one more": (np.column_stack([np.arange(24), np.arange(1, 25)]).astype(np.int32), 25, ()),
    "lone vertices": (grid_edges(8), 100, (70,)),
    "two sheets": (np.vstack([grid_edges(8), grid_edges(8, 64)]), 128, (64,)),
    "one of two sheets held": (np.vstack([grid_edges(8), grid_edges(8, 64)]), 128, range(64)),
}


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize("multigrid", [False, True], ids=["Jacobi", "multigrid"])
def test_solution_is_that_of_scipy(name, multigrid):
    edges, count, held = SYSTEMS[name]
    levels = levels_of(edges, count, held, mass=0.1)
    right, x, done, left = solved(levels, count, multigrid)
    expected = spsolve(csc_array(level_matrix(levels, 0)), right.ravel()).reshape(count, 3)
    assert_allclose(x, expected, rtol=0, atol=1e-10 * np.abs(expected).max())
    assert_allclose(x[list(held)], right[list(held)], rtol=0, atol=1e-12)  # identity rows
    assert left <= TIGHT
    assert 1 <= done < 300


def test_a_first_guess_is_used():
    levels = levels_of(grid_edges(20), 400, (0,))
    right, x, done, _ = solved(levels, 400, True)
    again = x.copy()
    more, left = pcg(levels, right, again, right, 1e-9, 100, True)
    assert more == 0
    assert left < 1e-9
    assert_array_equal(again, x)
    near = x + 1e-6 * np.random.default_rng(1).normal(size=x.shape)
    fewer, _ = pcg(levels, right, near, right, 1e-9, 100, True)
    assert 0 < fewer < done


def test_nothing_to_solve():
    levels = levels_of(grid_edges(8), 64)
    zero, x = np.zeros((64, 3)), np.zeros((64, 3))
    assert pcg(levels, zero, x, zero, 0.1, 30, True) == (0, 0.0)
    assert not x.any()


def test_residual_is_measured_as_said():
    levels = levels_of(grid_edges(20), 400, (0, 5))
    right = np.random.default_rng(2).normal(size=(400, 3))
    reference = 3.0 * right[::-1]
    x = np.zeros_like(right)
    _, left = pcg(levels, right, x, reference, 1e-3, 100, True)
    rest = (right.ravel() - level_matrix(levels, 0) @ x.ravel()).reshape(-1, 3)
    assert_allclose(left, np.linalg.norm(rest) / np.linalg.norm(reference), rtol=1e-9)  # r is kept by recurrence
    assert left <= 1e-3


def test_multigrid_needs_about_as_many_iterations_on_any_mesh():
    counts = {}
    for multigrid in (False, True):
        counts[multigrid] = []
        for side in (12, 24, 48):
            levels = levels_of(grid_edges(side), side * side, (0, side - 1))
            counts[multigrid].append(solved(levels, side * side, multigrid, 1e-8)[2])
    jacobi, multi = (np.array(counts[multigrid]) for multigrid in (False, True))
    assert (jacobi[1:] > 1.4 * jacobi[:-1]).all()  # in proportion to the side, twice as many, until mass tells
    assert (multi[1:] < 1.35 * multi[:-1]).all()
    assert multi[-1] < 0.2 * jacobi[-1]


@pytest.mark.parametrize("multigrid", [False, True])
def test_the_same_bits_with_one_thread_and_two(multigrid):
    found = []
    for threads in (1, 2):
        with limited_threads(threads):
            found.append(solved(levels_of(grid_edges(60), 3600, (0, 59)), 3600, multigrid, 1e-6)[1])
    assert_array_equal(found[0], found[1])


def test_the_same_bits_in_another_process():
    """Nothing random goes into the levels, and no hash order."""
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]); from test_conjugate_gradients import *; "
        "sys.stdout.buffer.write(solved(levels_of(grid_edges(30), 900, (0,)), 900, True, 1e-6)[1].tobytes())"
    )
    here = str(Path(__file__).parent)
    other = subprocess.run([sys.executable, "-c", code, here], capture_output=True, check=True).stdout
    mine = solved(levels_of(grid_edges(30), 900, (0,)), 900, True, 1e-6)[1]
    assert_array_equal(np.frombuffer(other).reshape(900, 3), mine)
