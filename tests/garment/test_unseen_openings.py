"""Neck and armholes are one opening where nobody looked over the shoulders: whether cloth lies there is not known."""

from __future__ import annotations

import numpy as np
import pytest
from dressed_form import HIGH, LOW, capsule, form_distance, largest, level_set, outward, smooth_min
from test_parted import CELL, STRAPS, form

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.bare_parts import BareParts
from vto_pipeline.garment.openings import OpeningsConfig, close_scan_holes, list_openings
from vto_pipeline.garment.photographed.parted import refuse_unseen, unseen_openings
from vto_pipeline.garment.photographed.sightings import SPACING, Sightings
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import submesh
from vto_pipeline.model.garment import SurfaceLabels
from vto_pipeline.model.job import Job

LONG = 0.13
"""A long garment ends so high, a hand's width above the form's underside [m]."""


def seen_bare(body, seen):
    """What a scan tells of the bare form whose points (N, 3) were seen where `seen` says so."""
    return BareParts(body, SurfaceLabels(np.zeros(len(body.vertices), bool), np.where(seen, 1.0, 0.0)), body)


def sleeveless(low=0.25, high=1.0):
    """8 mm off the form, between two heights, cut off at the shoulders."""
    cloth = outward(*level_set(lambda p: form_distance(p) - 0.008, LOW, HIGH, CELL))
    x, y, _ = cloth.vertices[cloth.faces].mean(axis=1).T
    neck = (np.abs(x) < 0.08) & (y > 0.76)
    return largest(submesh(cloth, (y > low) & (y < high) & (np.abs(x) < 0.19) & ~neck)[0])


@pytest.fixture(scope="module")
def dressed():
    body, top, lost = form(), sleeveless(), sleeveless(high=STRAPS)
    assert len(list_openings(top)) == 4  # neck, armholes, hem
    assert len(list_openings(lost)) == 2
    above = body.vertices[:, 1] > STRAPS - 0.02
    return body, top, lost, above & (np.abs(body.vertices[:, 0]) < 0.2) & (body.vertices[:, 1] < 0.85)


def test_neck_and_armholes_are_not_told_apart_over_shoulders_that_nobody_saw(dressed):
    body, _, lost, shoulders = dressed
    upper = list_openings(lost)[0]
    what = f"the opening of {1e3 * upper.perimeter:.0f} mm at .* may be 2 or more: .* seen neither bare nor clothed"
    with pytest.raises(GarmentError, match=what) as caught:
        refuse_unseen(lost, list_openings(lost), body, seen_bare(body, ~shoulders), None, False, Job())
    assert "openings.keep" in caught.value.hint
    assert caught.value.partial["garment"] is lost
    job = Job()
    refuse_unseen(lost, list_openings(lost), body, seen_bare(body, ~shoulders), None, True, job)
    assert len(job.warnings) == 1


def test_the_stage_refuses_it_unless_the_number_is_given(dressed):
    body, _, lost, shoulders = dressed
    bare = seen_bare(body, ~shoulders)
    with pytest.raises(GarmentError, match="may be 2 or more"):
        close_scan_holes(lost, body, OpeningsConfig(), Job(), bare)
    job = Job()
    assert len(close_scan_holes(lost, body, OpeningsConfig(keep=2), job, bare)[1]) == 2
    assert any("may be 2 or more" in text for text in job.warnings)
    close_scan_holes(lost, body, OpeningsConfig(expected=2), Job(), bare)


def test_photos_that_show_the_shoulders_bare_answer_it(dressed):
    body, _, lost, shoulders = dressed
    points = sample_surface(body, int(1.0 / SPACING**2), 1)[0]
    shown = Sightings(points, np.zeros(len(points), bool), SPACING**2)
    assert unseen_openings(lost, body, seen_bare(body, ~shoulders), shown, 0) == []
    clothed = Sightings(points, np.ones(len(points), bool), SPACING**2)
    assert unseen_openings(lost, body, seen_bare(body, ~shoulders), clothed, 0) != []


def test_a_strapless_garment_under_bare_shoulders_passes(dressed):
    body, _, strapless, _ = dressed
    assert unseen_openings(strapless, body, seen_bare(body, np.ones(len(body.vertices), bool)), None, 0) == []


def test_a_whole_garment_passes_though_only_arms_and_neck_were_seen(dressed):
    body, top, _, _ = dressed
    some = body.vertices[:, 1] < 0.9
    assert unseen_openings(top, body, seen_bare(body, some), None, 0) == []


def test_the_unseen_underside_of_a_form_parts_nothing(dressed):
    """A rim of the trunk and the stand are seen bare, and no opening can lie between them."""
    body, _, _, _ = dressed
    long = sleeveless(low=LONG, high=0.76)
    hidden = np.abs(body.vertices[:, 1] - 0.09) < 0.02
    hidden &= SurfaceDistance(long).nearest(body.vertices).distance > 0.02
    stand = body.vertices[:, 1] < 0.07
    assert stand.any()
    assert unseen_openings(long, body, seen_bare(body, ~hidden), None, 0) == []


CROTCH, HEM = 0.40, 0.50


def on_legs(points):
    """Distance of a trunk on two legs that part at `CROTCH`."""
    trunk = capsule(points, (0, 0.52, 0), (0, 0.80, 0), 0.10)
    legs = [capsule(points, (side * 0.11, 0.10, 0), (side * 0.07, 0.52, 0), 0.055) for side in (-1, 1)]
    return smooth_min(trunk, np.minimum(*legs), 0.01)


def test_a_hem_that_hides_the_crotch_from_above_is_a_warning():
    """The legs are seen bare up to the hem outside, and nothing of what joins them: shorts are unlikely."""
    low, high = (-0.2, 0.0, -0.16), (0.2, 0.95, 0.16)
    body = outward(*level_set(on_legs, low, high, CELL))
    cloth = outward(*level_set(lambda p: on_legs(p) - 0.008, low, high, CELL))
    y = cloth.vertices[cloth.faces].mean(axis=1)[:, 1]
    tunic = largest(submesh(cloth, (y > HEM) & (y < 0.85))[0])
    x, y, _ = body.vertices.T
    bare = seen_bare(body, (y < CROTCH - 0.03) | ((np.abs(x) > 0.095) & (y < HEM - 0.02)) | (y > 0.85))
    assert unseen_openings(tunic, body, bare, None, 0) == []
    assert len(list_openings(tunic)) == 2
    job = Job()
    refuse_unseen(tunic, list_openings(tunic), body, bare, None, False, job)
    assert len(job.warnings) == 1
    assert "may be 2 or more" in job.warnings[0]
