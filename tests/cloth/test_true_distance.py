"""The true curve of a drape: each look's distance to the end, from runs that were stopped there."""

import numpy as np
import pytest
from cloth_scenes import fabric
from numpy.testing import assert_allclose
from test_drape import pear, vest

import vto_pipeline.cloth.rest.multiresolution as levels_module
from vto_pipeline.cloth.drape import drape
from vto_pipeline.cloth.dynamics.stepper import Stepper
from vto_pipeline.cloth.model.coarsening import coarser_ones
from vto_pipeline.cloth.rest.true_distance import some_positions, with_true_distances
from vto_pipeline.model.cloth import TraceRow, seconds_within
from vto_pipeline.model.job import Job


def test_distances_are_those_of_the_vertices():
    rng = np.random.default_rng(0)
    final, way = rng.normal(size=(200, 3)), rng.normal(size=(200, 3))
    way *= np.linspace(0.0, 1.0, 200)[:, None] / np.linalg.norm(way, axis=1, keepdims=True)
    rows = with_true_distances([TraceRow(1.0, 1, 9.0, 0.1)], [final + 1e-3 * way], final)
    assert_allclose((rows[0].true_mm_median, rows[0].true_mm_p95, rows[0].true_mm_max), (0.5, 0.95, 1.0), rtol=1e-9)
    assert (rows[0].seconds, rows[0].error_mm) == (1.0, 9.0)


@pytest.mark.parametrize("count", [1, 7, 1000, 1001, 250_000])
def test_few_vertices_stand_for_many(count):
    x = np.arange(3.0 * count).reshape(-1, 3)
    kept = some_positions(count)(x)
    assert len(kept) == min(count, 1000)
    assert (np.diff(kept[:, 0]) > 0.0).all()
    assert (kept[0, 0], kept[-1, 0]) == (x[0, 0], x[-1, 0])


@pytest.mark.parametrize(
    ("distances", "when"),
    [([9, 4, 2, 0.5], 3.0), ([9, 0.5, 2, 0.5], 3.0), ([0.5, 0.2, 0], 0.0), ([9, 0.9, 0.9], 1.0), ([9, 8], 1.0)],
)
def test_good_enough_is_from_then_on(distances, when):
    trace = [TraceRow(float(k), k, 0.1, 0.1, true_mm_p95=x) for k, x in enumerate(distances)]
    assert seconds_within(trace, 1.0) == when


def test_it_is_not_known_while_it_runs():
    assert seconds_within([TraceRow(0.0, 0, 0.1, 0.1)], 1.0) is None
    assert seconds_within([], 1.0) is None


def test_a_drape_knows_how_far_each_look_was(monkeypatch):
    """Every state that any step ended in is kept here, by its mesh and its number of steps."""
    states, coarser, run = {}, [], Stepper.run

    def kept(stepper, state, seconds):
        after = run(stepper, state, seconds)
        states[len(after.positions), stepper.steps] = after.positions
        return after

    def noted(*given):
        coarser.extend(coarser_ones(*given))
        return coarser

    monkeypatch.setattr(Stepper, "run", kept)
    monkeypatch.setattr(levels_module, "coarser_ones", noted)
    settings = {"settle_seconds": 4.0, "target_error_mm": 1.0, "coarsen_above": 1000}
    found = drape(vest(), pear(), fabric(bending=1e-5), settings, job := Job())
    some = some_positions(len(found.mesh.vertices))
    assert {row.level for row in found.trace} == {0, 1}
    for row in found.trace:
        mesh = coarser[0].garment.mesh if row.level else found.mesh
        look = states[len(mesh.vertices), row.step]
        look = some(coarser[0].prolong(look) if row.level else look)
        apart = 1e3 * np.linalg.norm(look - some(found.mesh.vertices), axis=1)
        expected = (np.percentile(apart, 50), np.percentile(apart, 95), apart.max())
        assert_allclose((row.true_mm_median, row.true_mm_p95, row.true_mm_max), expected, rtol=1e-9, atol=1e-12)
    assert found.trace[0].true_mm_max > 0.2 > found.trace[-1].true_mm_max
    assert job.metrics["within_1_mm_s"] in [row.seconds for row in found.trace]
