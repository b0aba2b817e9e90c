"""Rigidity from a drape coefficient: read backwards from a line that is known, and from discs of real fabrics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.bench.physics.cusick import MEASURED
from vto_pipeline.cloth.swatch.disc import DrapeTest, at_minimum, drape_coefficient, resolving_edge, specimen
from vto_pipeline.cloth.swatch.fit_drape import fit_drape, read_backwards
from vto_pipeline.errors import ComputationError, DivergedError, InputError
from vto_pipeline.model.job import Job
from vto_pipeline.units import GRAVITY

TRUTH, SLOPE, SPREAD = np.log(5e-6), 0.22, 0.04


def known_line(rng):
    return lambda log_rigidity, seed: 0.5 + SLOPE * (log_rigidity - TRUTH) + SPREAD * rng.normal()


@pytest.mark.parametrize("drapes", [1, 4])
def test_the_interval_covers_the_truth_as_often_as_it_says(drapes):
    """Of 400 fabrics whose drapes scatter about a known line: 95 % are 380, with a standard deviation of 4.4."""
    covered, wide, rng = 0, [], np.random.default_rng(0)
    for _ in range(400):
        measured = 0.5 + SPREAD * rng.normal() / np.sqrt(drapes)
        found = read_backwards(measured, drapes, TRUTH + rng.uniform(-1.0, 1.0), known_line(rng), Job())
        low, high = found.interval
        covered += low < np.exp(TRUTH) < high
        wide.append(np.log(high / low))
    assert 366 <= covered <= 394
    # half the interval is 2 spreads of what was measured over the slope, and a little for the line itself
    assert 1.0 < np.median(wide) / (2 * 2.0 * SPREAD / np.sqrt(drapes) / SLOPE) < 1.5


def test_a_line_is_read_where_it_is():
    found = read_backwards(0.5, 1, TRUTH + 1.2, lambda x, seed: 0.5 + SLOPE * (x - TRUTH), Job())
    assert_allclose(found.rigidity, np.exp(TRUTH), rtol=1e-9)  # no scatter: rounding
    assert_allclose([found.slope, found.spread], [SLOPE, 0.0], rtol=1e-9, atol=1e-9)


def test_seeds_are_all_different():
    seeds = []
    read_backwards(0.5, 1, TRUTH, lambda x, seed: seeds.append(seed) or 0.5 + SLOPE * (x - TRUTH), Job(seed=7))
    assert seeds == list(range(7, 7 + len(seeds)))


def test_a_coefficient_that_does_not_change_tells_nothing():
    rng = np.random.default_rng(1)
    with pytest.raises(InputError, match="hardly changes"):
        read_backwards(0.5, 1, TRUTH, lambda x, seed: 0.5 + 0.05 * rng.normal(), Job())


def test_drapes_that_find_no_rest_are_left_out():
    """Every fourth of them: the line is where it was; and where none comes to rest, that is said."""
    found = read_backwards(
        0.5, 1, TRUTH + 0.5, lambda x, seed: np.nan if seed % 4 == 1 else 0.5 + SLOPE * (x - TRUTH), Job()
    )
    assert_allclose(found.rigidity, np.exp(TRUTH), rtol=1e-9)  # no scatter: rounding
    with pytest.raises(ComputationError, match="0 of 4 simulated drapes"):
        read_backwards(0.5, 1, TRUTH, lambda x, seed: np.nan, Job())


@pytest.mark.parametrize(("share", "size"), [(0.12, "24 cm"), (0.97, "36 cm")])
def test_limp_and_stiff_cloth_is_refused(share, size):
    fabric = MEASURED["MAT-B"].fabric("b")
    with pytest.raises(InputError, match="tells no rigidity") as refused:
        fit_drape(share, 1, fabric, DrapeTest(), Job())
    assert size in refused.value.hint


def test_a_shadow_of_disc_and_specimen_are_nought_and_one():
    test = DrapeTest()
    assert_allclose(test.coefficient(np.pi * 0.09**2), 0.0, rtol=0, atol=1e-12)
    assert_allclose(test.coefficient(np.pi * 0.15**2), 1.0, rtol=1e-12)


def test_edges_go_with_the_bending_length():
    """Peirce's length of a cloth of 100 g/m² whose rigidity is w (12 mm)³: three quarters of it, no more than 15 mm."""
    weight = 0.1 * GRAVITY
    assert_allclose(resolving_edge(weight * 0.012**3, 0.1), 0.009, rtol=1e-9)
    assert resolving_edge(weight * 0.1**3, 0.1) == 0.015


def test_each_drape_is_simulated_on_a_mesh_that_shows_its_folds(monkeypatch):
    """Limp cloth on coarse triangles is held up by them: from 15 mm to 7.5 mm a faille of 1 µN·m falls by 9 points."""
    edges = {}

    def refuse(fabric, test, kind, edge, *, seed):
        edges[fabric.bending_warp] = edge
        raise DivergedError("not wanted")

    monkeypatch.setattr("vto_pipeline.cloth.swatch.fit_drape.specimen", refuse)
    with pytest.raises(ComputationError):
        fit_drape(0.3, 1, MEASURED["MAT-F"].fabric("f"), DrapeTest(), Job())
    limp, stiff = min(edges), max(edges)
    assert_allclose(edges[stiff] / edges[limp], (stiff / limp) ** (1.0 / 3.0), rtol=1e-9)
    assert edges[limp] < 0.008


@pytest.mark.slow
@pytest.mark.parametrize("name", list(MEASURED))
def test_real_fabrics_drape_as_measured_once_fitted(name):
    """Within 3 points, in the mean of eight drapes that begin in other unevenness; their own error is a point."""
    one = MEASURED[name]
    found = fit_drape(one.drape, 1, one.fabric(name), DrapeTest(), Job())
    fabric = replace(one.fabric(name), bending_warp=found.rigidity, bending_weft=found.rigidity)
    again, edge = [], 0.8 * resolving_edge(found.rigidity, one.density)
    for seed in range(100, 108):
        cloth = specimen(fabric, DrapeTest(), "irregular", edge, seed=seed)
        again.append(drape_coefficient(at_minimum(cloth), cloth.model.faces, DrapeTest()))
    assert abs(np.mean(again) - one.drape) < 0.03
