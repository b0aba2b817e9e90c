"""Friction cone, three-by-three solver, blocks of constraints, and the thread pool."""

import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from numba import njit, prange
from numpy.testing import assert_allclose, assert_array_equal

import vto_pipeline
from vto_pipeline.numerics.cpu_threads import limited_threads
from vto_pipeline.numerics.linear.coloured_blocks import blocks
from vto_pipeline.numerics.mechanics.friction import friction_shift
from vto_pipeline.numerics.mechanics.membrane import solve_symmetric


def test_friction_holds_inside_the_cone_and_slides_outside():
    up = (0.0, 1.0, 0.0)
    assert_allclose(
        friction_shift((0.2, 5.0, 0.1), up, 1.0, 0.3), (-0.2, 0.0, -0.1), rtol=0, atol=1e-16
    )  # undone whole
    shift = np.array(friction_shift((3.0, 5.0, 4.0), up, 2.0, 0.3))
    assert_allclose(np.linalg.norm(shift), 0.6, rtol=1e-14)  # µ times the push
    barely = np.array(friction_shift((0.62, 0.0, 0.0), up, 2.0, 0.3))
    assert_allclose(barely, (-0.6, 0.0, 0.0), rtol=1e-14)  # just outside the cone it slides
    assert_allclose(shift / 0.6, (-0.6, 0.0, -0.8), rtol=0, atol=1e-15)  # against the slip


def test_three_by_three_solver():
    rng = np.random.default_rng(0)
    root = rng.normal(size=(3, 3))
    matrix, right = root @ root.T + 0.1 * np.eye(3), rng.normal(size=3)
    found = solve_symmetric(*matrix[np.triu_indices(3)], *right)
    assert_allclose(found, np.linalg.solve(matrix, right), rtol=1e-11)  # condition number about 100


def test_three_by_three_solver_with_repeated_rows():
    found = solve_symmetric(1.0, 1.0, 0.0, 1.0, 0.0, 2.0, 3.0, 3.0, 4.0)
    assert_allclose((found[0] + found[1], found[2]), (3.0, 2.0), rtol=1e-14)  # any split of the first two will do


def stencils(kind):
    if kind == "fan":  # thousands of triangles about vertex 0
        rim = np.arange(1, 9001, dtype=np.int32)
        return np.column_stack([np.zeros_like(rim), rim, np.roll(rim, -1)]), 9001
    rng = np.random.default_rng(0)
    return rng.integers(0, 500, (5000, 4)).astype(np.int32), 500


@pytest.mark.parametrize("kind", ["fan", "random"])
def test_blocks_of_one_colour_share_no_vertex(kind):
    wanted, count = stencils(kind)
    found = blocks(wanted, np.random.default_rng(1).uniform(size=(count, 3)))
    assert_array_equal(np.sort(found.order), np.arange(len(wanted)))
    assert found.starts[-1] == len(wanted)
    for first, last in zip(found.colours[:-1], found.colours[1:], strict=True):
        users = [np.unique(wanted[found.order[found.starts[b] : found.starts[b + 1]]]) for b in range(first, last)]
        together = np.concatenate(users)
        assert len(np.unique(together)) == len(together)


@njit(parallel=True)
def _double(x):
    for i in prange(len(x)):
        x[i] *= 2.0


def test_the_thread_pool_is_one_that_sleeps():
    if not (Path(sys.prefix) / "lib" / "libtbb.so.12").exists():
        pytest.skip("tbb is not installed in this environment")
    _double(np.ones(100))
    assert numba.threading_layer() == "tbb"


def test_thread_limit_ends_with_its_block():
    before = numba.get_num_threads()
    with limited_threads(1):
        assert numba.get_num_threads() == 1
    assert numba.get_num_threads() == before


def test_what_may_be_rounded_in_another_way_is_compiled_into_its_caller():
    """Else a process that compiles it and one that loads its caller from the cache run two copies: other bits."""
    package = Path(vto_pipeline.__file__).parent
    marked = [line for path in package.rglob("*.py") for line in path.read_text().splitlines() if "fastmath" in line]
    assert len(marked) > 2
    assert [line for line in marked if "forceinline=True" not in line] == []
