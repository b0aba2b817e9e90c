"""Our sparse Cholesky beside MKL PARDISO and SuperLU, on the system of one implicit step of a sheet.

The order of elimination is found once a pattern and is not timed, save in SuperLU, which has no such step of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

from vto_pipeline.bench.bench import Measured, Row, Watch
from vto_pipeline.bench.scaling.throughput import sheet_system
from vto_pipeline.bench.timing import Timing, threads_now, timed
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.cpu_threads import limited_threads
from vto_pipeline.numerics.linear.block_matrix import BlockMatrix, to_scipy
from vto_pipeline.numerics.linear.cholesky import allocate_factor, factorise
from vto_pipeline.numerics.linear.elimination import plan_elimination
from vto_pipeline.numerics.linear.elimination_tree import dissection
from vto_pipeline.numerics.linear.substitution import solve

_STEP = 1.0 / 60.0  # s
_RUNS = 5


class Direct(NamedTuple):
    """A direct solver, with its order of elimination at hand.

    Args:
        factor: Factors the matrix.
        solve: Returns the solution for a right side, both of shape (N, 3).
    """

    factor: Callable[[], object]
    solve: Callable[[FloatArray], FloatArray]


def direct_rows(count: int, watch: Watch) -> Iterator[Row]:
    """Measure each solver on a sheet of count x count vertices."""
    for method, prepare in _SOLVERS.items():
        if method == "MKL PARDISO" and find_spec("pypardiso") is None:
            watch(f"{method} is left out: no package pypardiso (pip install 'vto-pipeline[bench]')")
            continue
        yield watch.row(f"linear system {count}", method, {}, count**2, partial(_measure, prepare, count))


def _measure(prepare: Callable[[BlockMatrix], Direct], count: int) -> Measured:
    """Return the time of a factorisation and a solve; how good the solution is, and whether threads change its bits."""
    matrix = sheet_system(count, _STEP)
    right = np.random.default_rng(0).standard_normal((count**2, 3))
    with limited_threads(1), _mkl_threads(1):  # PARDISO bears no change of threads after its analysis
        direct = prepare(matrix)
        direct.factor()
        alone = direct.solve(right)
    with _mkl_threads(threads_now()):
        direct = prepare(matrix)
        _, factor = timed(direct.factor, warm=direct.factor, runs=_RUNS)
        x, solved = timed(lambda: direct.solve(right), runs=_RUNS)
    left = to_scipy(matrix) @ x.ravel() - right.ravel()
    return Timing(factor.seconds + solved.seconds, factor.runs, factor.compile_s), {
        "factor_s": factor.seconds,
        "solve_s": solved.seconds,
        "residual": float(np.abs(left).max() / np.abs(right).max()),
        "same_bits_on_one_thread": x.tobytes() == alone.tobytes(),
    }


def own_cholesky(matrix: BlockMatrix) -> Direct:
    """Return the solver of `cloth.implicit_step.linear_system`."""
    weights, between = np.empty((0, 4)), np.empty((0, 3, 3))
    order = dissection(matrix.starts, matrix.columns)
    plan = plan_elimination(matrix.starts, matrix.columns, order, np.empty((0, 4), np.int32), weights)
    room = allocate_factor(plan)

    def solved(right: FloatArray) -> FloatArray:
        x = np.empty_like(right)
        solve(plan, room, right, x)
        return x

    return Direct(lambda: factorise(plan, matrix.starts, matrix.blocks, weights, between, room), solved)


def _pardiso(matrix: BlockMatrix) -> Direct:
    """Return PARDISO for a symmetric positive definite matrix; pypardiso has no public call for one phase alone."""
    from pypardiso import PyPardisoSolver
    from scipy.sparse import csr_matrix, triu

    upper = csr_matrix(triu(to_scipy(matrix).tocsr(), format="csr"))
    upper.sort_indices()
    solver = PyPardisoSolver(mtype=2)

    def phase(number: int, right: FloatArray) -> FloatArray:
        solver.set_phase(number)
        return np.asarray(solver._call_pardiso(upper, right.reshape(-1, 1))).reshape(-1, 3)

    nothing = np.zeros((len(matrix.diagonal), 3))
    phase(11, nothing)
    return Direct(lambda: phase(22, nothing), lambda right: phase(33, right))


def _superlu(matrix: BlockMatrix) -> Direct:
    """Return SciPy's SuperLU in its symmetric mode."""
    from scipy.sparse.linalg import splu

    whole = to_scipy(matrix).tocsc()
    found: list[Any] = []

    def factor() -> None:
        options = {"SymmetricMode": True}
        found[:] = [splu(whole, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)]

    return Direct(factor, lambda right: found[0].solve(right.ravel()).reshape(-1, 3))


@contextmanager
def _mkl_threads(count: int) -> Iterator[None]:
    """Let MKL, where it is installed, use so many threads inside the block."""
    if find_spec("pypardiso") is None:
        yield
        return
    from pypardiso import PyPardisoSolver

    mkl = PyPardisoSolver().libmkl
    before = mkl.MKL_Get_Max_Threads()
    mkl.MKL_Set_Num_Threads(count)
    try:
        yield
    finally:
        mkl.MKL_Set_Num_Threads(before)


_SOLVERS: dict[str, Callable[[BlockMatrix], Direct]] = {
    "own Cholesky": own_cholesky,
    "MKL PARDISO": _pardiso,
    "SuperLU": _superlu,
}
