"""A hole over a shoulder, through which the form bulges: photos drawn by another ray caster show cloth on it."""

from __future__ import annotations

import numpy as np
import pytest
from dressed_form import HIGH, LOW, form_distance, largest, level_set, outward
from test_parted import CELL, form, photographs

from vto_pipeline.garment.loop_evidence import encloses
from vto_pipeline.garment.openings import OpeningsConfig, close_scan_holes, list_openings
from vto_pipeline.garment.photographed.covered import covered_loops
from vto_pipeline.garment.photographed.sightings import Sightings
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import submesh
from vto_pipeline.model.job import Job


def vest():
    """8 mm off the form, over both shoulders."""
    cloth = outward(*level_set(lambda p: form_distance(p) - 0.008, LOW, HIGH, CELL))
    x, y, _ = cloth.vertices[cloth.faces].mean(axis=1).T
    neck = (np.abs(x) < 0.075) & (y > 0.78)
    return largest(submesh(cloth, (y > 0.25) & (np.abs(x) < 0.23) & ~neck)[0])


def torn(garment, spots, radius):
    middle = garment.vertices[garment.faces].mean(axis=1)
    near = (np.linalg.norm(middle[:, None] - np.array(spots), axis=2) < radius).any(axis=1)
    return largest(submesh(garment, ~near)[0])


@pytest.fixture(scope="module")
def body():
    return form()


SHOULDER = [[0.14, 0.75, 0.0], [0.15, 0.72, 0.04], [0.15, 0.72, -0.04]]


@pytest.mark.parametrize("radius", [0.05, 0.055])
def test_a_shoulder_that_comes_through_a_hole_is_no_opening(tmp_path, body, radius):
    whole = vest()
    scanned = torn(whole, SHOULDER, radius)
    loops = list_openings(scanned)
    assert (len(list_openings(whole)), len(loops)) == (4, 5)
    bulging = min(loops, key=lambda one: np.linalg.norm(one.center - SHOULDER[0]))
    assert encloses(scanned.vertices[bulging.loop], SurfaceDistance(body), 0.06)  # the form alone tells wrongly
    job = Job()
    config = OpeningsConfig(edge_mm=12.0, flap_edges=1.0)
    closed, openings, observed = close_scan_holes(scanned, body, config, job, photos=photographs(tmp_path, whole, body))
    assert len(openings) == 4
    assert any("the photos show cloth there: scan hole" in note for note in job.notes)
    off = form_distance(closed.vertices[~observed])
    assert np.quantile(np.abs(off - 0.008), 0.95) < 0.006


def circle(x, radius=0.05):
    turn = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    return np.column_stack([x + radius * np.cos(turn), np.zeros(60), radius * np.sin(turn)])


def test_what_counts_is_what_shows_within_each_loop():
    """A grid of 5 mm seen through three circles; cloth in one, bare in the next, and next to nothing in the third."""
    x, z = np.meshgrid(np.arange(-0.1, 0.6, 0.005), np.arange(-0.1, 0.1, 0.005))
    points = np.column_stack([x.ravel(), 0.0 * x.ravel(), z.ravel()])
    points = points[~((points[:, 0] > 0.38) & (np.arange(len(points)) % 40 > 0))]
    sightings = Sightings(points, points[:, 0] < 0.1, 25e-6)
    assert covered_loops(sightings, [circle(0.0), circle(0.2), circle(0.45)]) == [True, False, False]
    mixed = Sightings(points, points[:, 2] > 0.0, 25e-6)
    assert covered_loops(mixed, [circle(0.0), circle(0.2)]) == [False, False]
    assert covered_loops(sightings, []) == []
