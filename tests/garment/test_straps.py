"""A top whose straps are narrower than what is dropped as a flap."""

from __future__ import annotations

import numpy as np
import pytest
from dressed_form import HIGH, LOW, form_distance, largest, level_set, outward
from test_openings import sleeve

from vto_pipeline.garment.openings import OpeningsConfig, close_scan_holes
from vto_pipeline.garment.rims import drop_flaps
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import submesh
from vto_pipeline.model.job import Job

WIDTH, BUST = 0.012, 0.66
"""Of the straps, and the height where they begin [m]."""


@pytest.fixture(scope="module")
def dressed():
    """The form; a top of 4 mm edges, 8 mm off it; which of its faces are straps."""
    body = outward(*level_set(form_distance, LOW, HIGH, 0.008))
    cloth = outward(*level_set(lambda p: form_distance(p) - 0.008, LOW, HIGH, 0.004))
    x, y, _ = cloth.vertices[cloth.faces].mean(axis=1).T
    strap = (np.abs(np.abs(x) - 0.1) < 0.5 * WIDTH) & (y > BUST - 0.06)
    return body, largest(submesh(cloth, ((y > 0.25) & (y < BUST) & (np.abs(x) < 0.165)) | strap)[0])


def test_straps_stay_and_part_neck_from_armholes(dressed):
    body, top = dressed
    found, openings, _ = close_scan_holes(top, body, OpeningsConfig(), Job())
    assert len(openings) == 4
    points = sample_surface(top, 50_000, 0)[0]
    strap = points[points[:, 1] > BUST + 0.02]
    assert len(strap) > 500
    assert np.mean(SurfaceDistance(found).nearest(strap).distance < 0.003) > 0.98


def test_what_is_left_of_a_torn_strap_is_a_flap(dressed):
    """It parts nothing: neck and both armholes are one opening, and the hem is the other."""
    body, top = dressed
    _, y, z = top.vertices[top.faces].mean(axis=1).T
    torn = largest(submesh(top, (y < BUST + 0.01) | (np.abs(z) > 0.03))[0])
    found, openings, _ = close_scan_holes(torn, body, OpeningsConfig(), Job())
    assert len(openings) == 2
    assert torn.vertices[:, 1].max() > BUST + 0.03
    assert found.vertices[:, 1].max() < BUST + 0.02


@pytest.mark.parametrize(("count", "stays"), [(0, False), (1, False), (2, True)])
def test_a_strip_stays_between_two_openings_only(count, stays):
    """Two windows in a tube, 6 mm apart, of which so many are openings."""
    tube = sleeve(around=300, along=200)
    x, y, z = tube.vertices[tube.faces].mean(axis=1).T
    barred = submesh(tube, ~((z < -0.05) & (np.abs(y - 0.2) < 0.06) & (np.abs(x) > 0.003)))[0]

    def is_opening(loop):
        side = float(np.mean(loop[:, 0]))
        window = bool(np.mean(loop[:, 2]) < -0.05)
        return window and (count == 2 or (count == 1 and side > 0.0))

    clean = drop_flaps(barred, 0.012, 0.12, is_opening)
    strip = (clean.vertices[:, 2] < -0.09) & (np.abs(clean.vertices[:, 1] - 0.2) < 0.05)
    assert strip.any() == stays
