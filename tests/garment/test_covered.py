"""A hole over a shoulder, through which the form bulges: photos drawn by another ray caster show cloth on it."""

from __future__ import annotations

import numpy as np
import pytest
from dressed_form import HIGH, LOW, ellipsoid, form_distance, largest, level_set, outward
from test_parted import CELL, form, photographs

from vto_pipeline.garment.bare_parts import BareParts
from vto_pipeline.garment.loop_evidence import encloses
from vto_pipeline.garment.openings import OpeningsConfig, close_scan_holes, list_openings
from vto_pipeline.garment.photographed.covered import BARE, COVERED, cloth_shares
from vto_pipeline.garment.photographed.sightings import Sightings
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import submesh
from vto_pipeline.model.garment import SurfaceLabels
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


def test_a_shoulder_that_comes_through_a_hole_is_no_opening(tmp_path, body):
    whole = vest()
    scanned = torn(whole, SHOULDER, 0.045)
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


FLARE, STUMP, MIDDLE = (0.2, 0.09, 0.2), (0.085, 0.11), 0.55


def shoulders(points):
    """Flat shoulders, and a form's neck that ends 3 cm above them, about the middle of the photos."""
    y, around = points[:, 1] - MIDDLE, np.hypot(points[:, 0], points[:, 2])
    neck = np.maximum(around - STUMP[0], np.maximum(y - STUMP[1], -y))
    return np.minimum(ellipsoid(points, (0.0, MIDDLE, 0.0), FLARE), neck)


def cape(neck=0.1):
    """2 mm off the shoulders, from a collar of that radius to below their widest place."""
    size = np.array(FLARE) + 0.002
    cloth = outward(
        *level_set(lambda p: ellipsoid(p, (0.0, MIDDLE, 0.0), size), (-0.25, 0.4, -0.25), (0.25, 0.7, 0.25), 0.008)
    )
    x, y, z = (cloth.vertices[cloth.faces].mean(axis=1) - [0.0, MIDDLE, 0.0]).T
    return largest(submesh(cloth, (y > -0.03) & ((np.hypot(x, z) > neck) | (y < 0.0)))[0])


def bare_over(body, seen):
    return BareParts(body, SurfaceLabels(np.zeros(len(body.vertices), bool), np.where(seen, 1.0, 0.0)), body)


@pytest.mark.parametrize("told", ["scan", "photos", None])
def test_a_collar_in_which_the_neck_of_the_form_ends_is_an_opening(tmp_path, told):
    """Nothing of the form comes out of it, and its rim lies on flat shoulders as that of a hole does."""
    body = outward(*level_set(shoulders, (-0.25, 0.4, -0.25), (0.25, 0.7, 0.25), 0.008))
    cloth = cape()
    collar = max(list_openings(cloth), key=lambda one: one.center[1])
    assert not encloses(cloth.vertices[collar.loop], SurfaceDistance(body), 0.06)  # the form alone tells wrongly
    neck = np.hypot(body.vertices[:, 0], body.vertices[:, 2]) < 0.1
    bare = bare_over(body, neck) if told == "scan" else None
    photos = photographs(tmp_path, cloth, body) if told == "photos" else None
    config = OpeningsConfig(edge_mm=8.0, flap_edges=1.0, least_seen=0.0)
    _, openings, _ = close_scan_holes(cloth, body, config, Job(), bare, photos)
    assert len(openings) == (1 if told is None else 2)


def test_a_hole_over_shoulders_that_were_not_seen_bare_is_none():
    body = outward(*level_set(shoulders, (-0.25, 0.4, -0.25), (0.25, 0.7, 0.25), 0.008))
    for half in (False, True):
        bare = bare_over(body, half & (body.vertices[:, 0] > 0.0))
        config = OpeningsConfig(edge_mm=8.0, flap_edges=1.0, least_seen=0.0)
        assert len(close_scan_holes(cape(), body, config, Job(), bare)[1]) == 1


def circle(x, radius=0.05):
    turn = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    return np.column_stack([x + radius * np.cos(turn), np.zeros(60), radius * np.sin(turn)])


def test_what_counts_is_what_shows_within_each_loop():
    """A grid of 5 mm seen through three circles; cloth in one, bare in the next, and next to nothing in the third."""
    x, z = np.meshgrid(np.arange(-0.1, 0.6, 0.005), np.arange(-0.1, 0.1, 0.005))
    points = np.column_stack([x.ravel(), 0.0 * x.ravel(), z.ravel()])
    points = points[~((points[:, 0] > 0.38) & (np.arange(len(points)) % 40 > 0))]
    sightings = Sightings(points, points[:, 0] < 0.1, 25e-6)
    covered, bare, nothing = cloth_shares(sightings, [circle(0.0), circle(0.2), circle(0.45)])
    assert covered > COVERED
    assert bare < BARE
    assert nothing is None
    mixed = Sightings(points, points[:, 2] > 0.0, 25e-6)
    assert all(BARE < share < COVERED for share in cloth_shares(mixed, [circle(0.0), circle(0.2)]))
    assert cloth_shares(sightings, []) == []
