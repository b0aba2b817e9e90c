"""Sparse Cholesky against SciPy's dense and sparse solvers."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from block_sheets import links, sheet, whole
from numba import get_num_threads, set_num_threads
from scipy import sparse
from scipy.linalg import cho_factor, cho_solve

from vto_pipeline.numerics.linear.block_matrix import BlockMatrix
from vto_pipeline.numerics.linear.cholesky import allocate_factor, factorise
from vto_pipeline.numerics.linear.elimination import Elimination, plan_elimination
from vto_pipeline.numerics.linear.elimination_tree import dissection
from vto_pipeline.numerics.linear.substitution import solve

NO_LINKS = np.empty((0, 4), np.int32), np.empty((0, 4)), np.empty((0, 3, 3))


def planned(matrix: BlockMatrix, vertices, weights) -> Elimination:  # type: ignore[no-untyped-def]
    order = dissection(matrix.starts, matrix.columns)
    return plan_elimination(matrix.starts, matrix.columns, order, vertices, weights)


@pytest.mark.parametrize(("count", "reach", "linked"), [(1, 1, 0), (2, 1, 0), (5, 1, 3), (9, 2, 12), (30, 1, 40)])
def test_solution(count: int, reach: int, linked: int) -> None:
    rng = np.random.default_rng(count)
    matrix = sheet(count, rng, reach)
    vertices, weights, between = links(linked, count * count, rng)
    plan = planned(matrix, vertices, weights)
    room = allocate_factor(plan)
    assert factorise(plan, matrix.starts, matrix.blocks, weights, between, room)
    right, x = rng.standard_normal((count * count, 3)), np.empty((count * count, 3))
    solve(plan, room, right, x)
    dense = whole(matrix, vertices, weights, between).toarray()
    wanted = cho_solve(cho_factor(dense), right.ravel()).reshape(-1, 3)
    np.testing.assert_allclose(x, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())  # condition times rounding


def test_a_room_serves_again() -> None:
    rng = np.random.default_rng(0)
    room = None
    for linked in (60, 5, 20):  # the room shrinks and grows
        matrix = sheet(12, rng)
        vertices, weights, between = links(linked, 144, rng)
        plan = planned(matrix, vertices, weights)
        room = allocate_factor(plan, room)
        assert factorise(plan, matrix.starts, matrix.blocks, weights, between, room)
        right, x = rng.standard_normal((144, 3)), np.empty((144, 3))
        solve(plan, room, right, x)
        left = whole(matrix, vertices, weights, between) @ x.ravel() - right.ravel()
        assert np.abs(left).max() < 1e-12 * np.abs(right).max()


def test_what_is_not_positive_definite_is_told() -> None:
    rng = np.random.default_rng(1)
    matrix = sheet(8, rng)
    plan = planned(matrix, *NO_LINKS[:2])
    matrix.blocks[matrix.diagonal[20]] *= -1.0
    assert not factorise(plan, matrix.starts, matrix.blocks, NO_LINKS[1], NO_LINKS[2], allocate_factor(plan))


def test_pieces_that_nothing_joins() -> None:
    rng = np.random.default_rng(2)
    matrix = sheet(6, rng)
    own = np.repeat(np.arange(36), np.diff(matrix.starts))
    apart = (own < 18) == (matrix.columns < 18)
    starts = np.concatenate([[0], np.cumsum(np.bincount(own[apart], minlength=36))]).astype(np.int32)
    columns, blocks = matrix.columns[apart], matrix.blocks[apart]
    plan = plan_elimination(starts, columns, dissection(starts, columns), *NO_LINKS[:2])
    room = allocate_factor(plan)
    assert factorise(plan, starts, blocks, NO_LINKS[1], NO_LINKS[2], room)
    right, x = rng.standard_normal((36, 3)), np.empty((36, 3))
    solve(plan, room, right, x)
    left = sparse.bsr_array((blocks, columns, starts)) @ x.ravel() - right.ravel()
    assert np.abs(left).max() < 1e-12 * np.abs(right).max()


def test_same_bits_with_any_number_of_threads() -> None:
    rng = np.random.default_rng(3)
    matrix = sheet(40, rng, 2)
    vertices, weights, between = links(30, 1600, rng)
    plan = planned(matrix, vertices, weights)
    assert plan.flops > 4e6  # so that threads are used at all
    right, found = rng.standard_normal((1600, 3)), []
    threads = get_num_threads()
    for count in (1, threads):
        set_num_threads(count)
        room, x = allocate_factor(plan), np.empty((1600, 3))
        factorise(plan, matrix.starts, matrix.blocks, weights, between, room)
        solve(plan, room, right, x)
        found.append(x)
    set_num_threads(threads)
    assert np.array_equal(found[0], found[1])


def test_work_grows_as_nested_dissection_promises() -> None:
    """George 1973: of order n^1.5 for a grid of n rows; a band, or the order of the rows, takes n^2."""
    flops = []
    for count in (20, 40, 80):
        matrix = sheet(count, np.random.default_rng(4))
        flops.append(planned(matrix, *NO_LINKS[:2]).flops)
    for small, large in pairwise(flops):
        assert 1.3 < np.log(large / small) / np.log(4.0) < 1.7


def test_every_row_is_eliminated_once_and_touches_only_later_ones() -> None:
    rng = np.random.default_rng(5)
    matrix = sheet(15, rng)
    vertices, weights, _ = links(25, 225, rng)
    plan = planned(matrix, vertices, weights)
    assert np.array_equal(np.sort(plan.order), np.arange(225))
    assert np.array_equal(plan.place[plan.order], np.arange(225))
    for s in range(len(plan.first) - 1):
        rows = plan.rows[plan.row_starts[s] : plan.row_starts[s + 1]]
        assert (np.diff(rows) > 0).all()
        assert (rows >= plan.first[s + 1]).all()
        for child in plan.children[plan.child_starts[s] : plan.child_starts[s + 1]]:
            passed = plan.rows[plan.row_starts[child] : plan.row_starts[child + 1]]
            front = np.concatenate([np.arange(plan.first[s], plan.first[s + 1]), rows])
            within = plan.within[plan.row_starts[child] : plan.row_starts[child + 1]]
            assert np.array_equal(front[within], passed)
