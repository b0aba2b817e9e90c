"""Straps that photos show and the scan lost. The photos are drawn by another ray caster."""

from __future__ import annotations

import numpy as np
import pytest
from dressed_form import form_distance, largest
from test_parted import STRAPS, form, photographs, tank_top

from vto_pipeline.garment.openings import OpeningsConfig, close_scan_holes, list_openings
from vto_pipeline.garment.photographed.bridged import bridge_straps
from vto_pipeline.garment.photographed.sightings import look_at_mannequin
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import submesh
from vto_pipeline.model.job import Job

COARSE = OpeningsConfig(look_again=False, edge_mm=12.0, flap_edges=1.0)


def narrow_top():
    """A top whose straps are 6 cm wide."""
    top = tank_top()
    x, y, _ = top.vertices[top.faces].mean(axis=1).T
    return submesh(top, (y < STRAPS - 0.05) | (np.abs(np.abs(x) - 0.115) < 0.03))[0]


def without_shoulders(top, sides=(-1.0, 1.0)):
    """What is lost is 8 cm long, over the shoulders."""
    x, y, z = top.vertices[top.faces].mean(axis=1).T
    return largest(submesh(top, ~((y > STRAPS) & (np.abs(z) < 0.04) & np.isin(np.sign(x), sides)))[0])


def one_strap_lost(top):
    return without_shoulders(top, (1.0,))


def photographed(top, folder):
    body = form()
    assert len(list_openings(top)) == 4
    return body, top, photographs(folder, top, body)


@pytest.fixture(scope="module")
def wide(tmp_path_factory):
    return photographed(tank_top(), tmp_path_factory.mktemp("wide"))


@pytest.fixture(scope="module", params=["wide", "narrow"])
def dressed(request, wide, tmp_path_factory):
    return wide if request.param == "wide" else photographed(narrow_top(), tmp_path_factory.mktemp("narrow"))


@pytest.mark.parametrize(("lose", "lost"), [(without_shoulders, 2), (one_strap_lost, 1)])
def test_straps_that_photos_show_are_put_back(dressed, lose, lost):
    """They lie on the form there, and the true ones 8 mm off it."""
    body, top, photos = dressed
    job = Job()
    found, openings, observed = close_scan_holes(lose(top), body, COARSE, job, photos=photos)
    assert len(openings) == 4
    assert sum("was put back" in warning for warning in job.warnings) == lost
    points = sample_surface(top, 100_000, 0)[0]
    x, y, z = points.T
    strap = points[(y > STRAPS) & (np.abs(z) < 0.03) & (np.abs(np.abs(x) - 0.115) < 0.02)]
    assert len(strap) > 500
    assert np.quantile(SurfaceDistance(found).nearest(strap).distance, 0.98) < 0.003
    added = sample_surface(found, 100_000, 0)[0]
    assert np.quantile(SurfaceDistance(top).nearest(added).distance, 0.998) < 0.003
    assert not observed.all()
    assert form_distance(found.vertices[~observed]).min() > 0.0


def test_a_large_bite_in_a_rim_is_put_back(wide):
    """12 by 8 cm at the hem, in front."""
    body, top, photos = wide
    x, y, z = top.vertices[top.faces].mean(axis=1).T
    bitten = largest(submesh(top, ~((np.abs(x) < 0.06) & (y < 0.33) & (z > 0.0)))[0])
    job = Job()
    found, openings, _ = close_scan_holes(bitten, body, COARSE, job, photos=photos)
    assert len(openings) == 4
    assert sum("was put back" in warning for warning in job.warnings) == 1
    points = sample_surface(top, 100_000, 0)[0]
    x, y, z = points.T
    bite = points[(np.abs(x) < 0.05) & (y < 0.32) & (y > 0.27) & (z > 0.0)]
    assert len(bite) > 300
    assert np.quantile(SurfaceDistance(found).nearest(bite).distance, 0.98) < 0.004


@pytest.mark.parametrize("keep", [3, 4])
def test_no_more_openings_are_made_than_are_to_be_kept(wide, keep):
    """One strap was lost: three openings are left of four."""
    body, top, photos = wide
    job = Job()
    config = COARSE.model_copy(update={"keep": keep})
    _, openings, _ = close_scan_holes(one_strap_lost(top), body, config, job, photos=photos)
    assert len(openings) == keep
    assert any("was put back" in warning for warning in job.warnings) == (keep == 4)


def test_a_top_of_one_strap_keeps_it(tmp_path):
    body, top = form(), one_strap_lost(tank_top())
    job = Job()
    _, openings, _ = close_scan_holes(top, body, COARSE, job, photos=photographs(tmp_path, top, body))
    assert len(openings) == 3
    assert not any("was put back" in warning for warning in job.warnings)


def test_a_whole_garment_stays_as_it_is(wide):
    body, top, photos = wide
    sightings = look_at_mannequin(top, np.ones(len(top.vertices), dtype=bool), body, photos, Job())
    job = Job()
    assert bridge_straps(top, sightings, SurfaceDistance(body), 0.12, 0.001, job) is top
    assert job.warnings == []
