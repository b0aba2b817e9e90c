"""Growth, roofs and kernels against what they must be."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from scipy.stats import linregress

from vto_pipeline.bench.bench import Watch
from vto_pipeline.bench.scaling import direct_solvers
from vto_pipeline.bench.scaling.batches import batch_rows
from vto_pipeline.bench.scaling.direct_solvers import direct_rows
from vto_pipeline.bench.scaling.overhead import _spinning
from vto_pipeline.bench.scaling.roofline import bandwidth
from vto_pipeline.bench.scaling.sizes import fit_power_law
from vto_pipeline.bench.scaling.throughput import _KERNELS, kernel_rows
from vto_pipeline.cloth.constraints.sweep import PARALLEL_FROM
from vto_pipeline.pipeline.execution.cost import Meter


def test_exponent_of_an_exact_power():
    vertices = np.array([1e3, 4e3, 1.6e4, 6.4e4])
    found = fit_power_law(vertices, 3e-6 * vertices**1.15)
    assert found.exponent == pytest.approx(1.15, rel=1e-12)
    assert found.uncertainty == pytest.approx(0.0, abs=1e-12)


def test_exponent_and_uncertainty_are_those_of_regression():
    rng = np.random.default_rng(5)
    vertices = np.geomspace(1e3, 1e6, 7)
    seconds = vertices**1.3 * np.exp(0.2 * rng.standard_normal(7))
    truth = linregress(np.log(vertices), np.log(seconds))
    found = fit_power_law(vertices, seconds)
    assert found.exponent == pytest.approx(truth.slope, rel=1e-12)
    assert found.uncertainty == pytest.approx(truth.stderr, rel=1e-9)


def test_two_sizes_have_no_uncertainty():
    assert np.isnan(fit_power_law([1.0, 2.0], [1.0, 2.0]).uncertainty)


def test_cache_is_faster_than_memory_and_both_are_possible():
    near, far = bandwidth(400_000, 1), bandwidth(400_000_000, 1)
    assert 1e9 < far < 1e12
    assert 0.5 * far < near < 1e13  # a loaded machine blurs the difference, so only the order is asked for


def test_the_multiply_counts_its_blocks():
    kernel = _KERNELS["block multiply"](10, False)
    # 100 vertices, 81 · 2 faces: blocks of the diagonal, both ways along each edge, and across each hinge
    edges, hinges = 2 * 9 * 10 + 81, 2 * 9 * 8 + 81
    diagonals_across = kernel.operations / 18 - 100 - 2 * edges
    assert 0 < diagonals_across <= 2 * hinges
    assert kernel.moved > 72 * kernel.operations / 18


@pytest.mark.slow
def test_no_kernel_beats_the_machine():
    for row in kernel_rows(64, 1, Watch()):
        assert PARALLEL_FROM <= 64**2
        assert 0.0 < row.errors["roofline_share"] < 1.3, row.method  # 1 and the noise of two timings
        assert row.seconds > 0.0


@pytest.mark.slow
def test_compiled_arithmetic_is_counted():
    sweep, force = _KERNELS["projection sweep"](6, False), _KERNELS["forces"](6, False)
    stencils = 50  # triangles; a triangle's strain alone takes two vectors of three products and two sums each
    assert 50 * stencils < force.operations < sweep.operations < 5000 * stencils


def test_the_busy_neighbour_ends_with_the_block():
    with _spinning(1):
        pass
    with pytest.raises(KeyError), _spinning(1):
        raise KeyError


def test_direct_solvers_solve_and_ours_keeps_its_bits():
    rows = {row.method: row.errors for row in direct_rows(20, Watch())}
    assert {"own Cholesky", "SuperLU"} <= set(rows)
    for method, errors in rows.items():
        assert 0.0 < errors["residual"] < 1e-10, method  # rounding times the condition of one step
    assert rows["own Cholesky"]["same_bits_on_one_thread"]


def test_the_times_of_factor_and_solve_are_told_apart(monkeypatch):
    """On a clock that only the solver moves: 2 s for a factorisation, 1 s for a solve."""
    now = 0.0

    def prepare(matrix):
        direct = direct_solvers._SOLVERS["own Cholesky"](matrix)

        def taking(seconds, work, *given):
            nonlocal now
            now += seconds
            return work(*given)

        return direct_solvers.Direct(partial(taking, 2.0, direct.factor), partial(taking, 1.0, direct.solve))

    monkeypatch.setattr("vto_pipeline.bench.timing.time.perf_counter", lambda: now)
    timing, errors = direct_solvers._measure(prepare, 4)
    assert (errors["factor_s"], errors["solve_s"], timing.seconds) == (2.0, 1.0, 3.0)


def test_a_solver_that_is_not_installed_is_left_out_with_a_reason(monkeypatch):
    monkeypatch.setattr(direct_solvers, "find_spec", lambda name: None)
    said = []
    assert "MKL PARDISO" not in [row.method for row in direct_rows(4, Watch(said.append))]
    assert any("MKL PARDISO is left out: no package pypardiso" in text for text in said)


def test_a_row_of_a_batch_costs_less_than_it_may():
    """By processor time, which leaves out what else runs on this machine."""
    before = Meter().peak_mb()  # what other tests have left in this process
    for _ in range(2):  # the first rows of a process pay for what it loads
        plan, journal, stored = (row.errors for row in batch_rows(500, 3, Watch()))
    assert plan["rows"] == 500
    assert 0.0 < plan["peak_mb"] < before + 1000.0
    assert 0.0 < journal["row_cpu_ms"] < 5.0
    assert 0.0 < stored["row_cpu_ms"] < 50.0
