"""A rim's own shape beside a scan hole at the rim: only over the one was the mannequin seen bare."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from test_openings import HEIGHT, RADIUS, arm, sleeve

from vto_pipeline.garment.bare_parts import BareParts
from vto_pipeline.garment.openings import OpeningsConfig, close_scan_holes
from vto_pipeline.geometry.topology import concatenate, submesh
from vto_pipeline.model.garment import SurfaceLabels
from vto_pipeline.model.job import Job

DEEP, WIDE = 0.1, 0.06


def in_the_v(points):
    """Which points lie in a V in the upper rim, on the +X side."""
    across = np.abs(points[:, 2]) * RADIUS / np.maximum(np.hypot(points[:, 0], points[:, 2]), 1e-9)
    return (points[:, 0] > 0) & (points[:, 1] > HEIGHT - DEEP + across * DEEP / WIDE)


def collar():
    """A tube with a V cut out of its upper rim."""
    pipe = sleeve(around=200, along=130)
    return submesh(pipe, ~in_the_v(pipe.vertices[pipe.faces].mean(axis=1)))[0]


@pytest.fixture(scope="module")
def worn():
    form = arm()
    cloth = collar()
    shown = submesh(form, np.ones(len(form.faces), dtype=bool))[0]
    scan = concatenate([cloth, shown])
    on_cloth = np.arange(len(scan.vertices)) < len(cloth.vertices)
    bare = in_the_v(scan.vertices) | (scan.vertices[:, 1] > HEIGHT) | (scan.vertices[:, 1] < 0)
    return form, cloth, scan, on_cloth, bare


def closed(worn, seen, sure=1.0):
    form, cloth, scan, on_cloth, _ = worn
    confidence = np.where(on_cloth | seen, sure, 0.0)
    labels = SurfaceLabels(on_cloth, confidence)
    job = Job()
    garment, openings, _ = close_scan_holes(cloth, form, OpeningsConfig(), job, BareParts(scan, labels, form))
    return garment, openings, job.metrics["filled_notches"]


def test_the_v_of_a_collar_stays_open_where_the_skin_was_seen(worn):
    garment, openings, filled = closed(worn, worn[4])
    assert filled == 0
    v = 2 * (np.hypot(DEEP, WIDE) - WIDE)
    assert_allclose(openings[0].perimeter, 2 * np.pi * RADIUS + v, rtol=0.05)
    assert not in_the_v(garment.vertices * [1, 1, 1] - [0, 0.01, 0]).any()


def test_the_same_bay_is_filled_where_nothing_was_seen(worn):
    _, openings, filled = closed(worn, np.zeros(len(worn[4]), dtype=bool))
    assert filled == 1
    assert_allclose(openings[0].perimeter, 2 * np.pi * RADIUS, rtol=0.05)


def test_what_is_unsure_says_nothing(worn):
    assert closed(worn, worn[4], sure=0.6)[2] == 1


def test_a_place_is_bare_where_the_form_was_seen_near_it(worn):
    form, _, scan, on_cloth, bare = worn
    parts = BareParts(scan, SurfaceLabels(on_cloth, np.where(bare, 1.0, 0.0)), form)
    above = np.array([[0.09, HEIGHT + 0.05, 0.0], [0.0, HEIGHT + 0.05, 0.2]])
    below = np.array([[0.09, HEIGHT / 2, 0.0], [0.0, HEIGHT / 2, 0.2]])
    assert parts.under(above).all()
    assert not parts.under(below).any()
