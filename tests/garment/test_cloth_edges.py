"""A ball in cloth of its own colour: an edge of cloth round its top is an opening, cloth that comes close is not."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from scipy.special import ndtr

from vto_pipeline.garment.bare_parts import BareParts
from vto_pipeline.garment.openings import OpeningsConfig, close_scan_holes
from vto_pipeline.garment.subtraction.cloth_edges import ClothEdges
from vto_pipeline.garment.subtraction.subtract import SubtractConfig, extract_garment, label_garment
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.garment import SurfaceLabels
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

BALL, STEP, NOISE = 0.15, 0.003, 0.0003
"""Its radius, the scan's edges and their noise [m]."""
COLLAR, HEM = 0.072, 0.25
"""From the top along the ball [m]: a loop of 42 cm, that the ball fills but does not come out of, and one it does."""
OFF, BLUR = 0.0026, 0.002
"""Cloth rests so far off the ball; a scan blurs its edge [m]."""


def turned(along, off, rng=None):
    """A surface of revolution about +Y: points so far from the top along the ball (N,), so far off it (N,) [m]."""
    around = int(2 * np.pi * BALL / STEP)
    turn = np.linspace(0, 2 * np.pi, around, endpoint=False)
    away = np.repeat((BALL + off)[:, None], around, axis=1)
    if rng is not None:
        away = away + rng.normal(0, NOISE, away.shape)
    polar = along[:, None] / BALL
    vertices = np.stack(
        [away * np.sin(polar) * np.sin(turn), away * np.cos(polar), away * np.sin(polar) * np.cos(turn)], -1
    )
    at = np.arange(vertices[..., 0].size).reshape(len(along), around)
    beside = np.roll(at, -1, axis=1)
    a, b, c, d = at[1:].ravel(), beside[1:].ravel(), beside[:-1].ravel(), at[:-1].ravel()
    return TriangleMesh(vertices.reshape(-1, 3), np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])]))


def ball():
    whole = turned(np.linspace(1e-4, BALL * np.pi - 1e-4, 160), np.zeros(160))
    around = int(2 * np.pi * BALL / STEP)
    ring, last = np.arange(around), len(whole.vertices)
    following, below = np.roll(ring, -1), last - around
    caps = [
        np.column_stack([ring, following, np.full(around, last)]),
        np.column_stack([below + following, below + ring, np.full(around, last + 1)]),
    ]
    poles = [[0, BALL, 0], [0, -BALL, 0]]
    return TriangleMesh(np.vstack([whole.vertices, poles]), np.vstack([whole.faces, *caps]))


def edge(along, at=COLLAR):
    """Cloth that ends at the collar."""
    return OFF * ndtr((along - at) / BLUR)


def touching(along):
    """Cloth that lies on the ball's top, and comes to do so by and by: by as much over 3 cm."""
    return 0.0004 + OFF * np.clip((along - COLLAR + 0.015) / 0.03, 0, None)


def closed(shape, first):
    """The garment, and what was warned, of a scan without colours that begins so far from the top [m]."""
    along = np.arange(first, 0.40, STEP)
    off = shape(along) * ndtr((HEM - along) / BLUR)
    form, scan = ball(), turned(along, off, np.random.default_rng(0))
    labels = label_garment(scan, form, SubtractConfig(), Job())
    shell = extract_garment(scan, labels, SubtractConfig(), Job())
    job, bare = Job(), BareParts(scan, labels, form)
    garment, openings, _ = close_scan_holes(shell, form, OpeningsConfig(least_seen=0.5), job, bare)
    return garment, openings, [text for text in job.warnings if "cloth" in text]


def test_where_cloth_is_seen_to_end_round_the_form_is_an_opening():
    """Its top was not seen, and has the cloth's colour, as none was seen at all."""
    _, openings, warnings = closed(edge, COLLAR - 0.02)
    assert len(openings) == 2
    assert abs(openings[0].perimeter - 2 * np.pi * (BALL + OFF) * np.sin(COLLAR / BALL)) < 0.02
    assert len(warnings) == 1
    assert "the opening of 4" in warnings[0]
    assert "cloth was seen to end along" in warnings[0]


def test_an_opening_through_which_the_form_was_seen_bare_is_not_warned_of():
    _, openings, warnings = closed(edge, 0.003)
    assert len(openings) == 2
    assert not warnings


@pytest.mark.parametrize("first", [COLLAR - 0.02, COLLAR + 0.02])
def test_what_the_form_fills_and_nobody_saw_is_filled_and_said(first):
    """Cloth that touches the form, seen at its border only, or not at all: from the scan it may be an opening."""
    garment, openings, warnings = closed(touching, first)
    assert len(openings) == 1
    assert garment.vertices[:, 1].max() > BALL
    assert len(warnings) == 1
    assert "neither cloth nor bare mannequin was seen there for certain" in warnings[0]
    assert "0.00, 0.1" in warnings[0]
    assert "openings.keep" in warnings[0]


def test_cloth_that_comes_to_touch_the_form_is_filled():
    """It passes for bare form, but nowhere round it does cloth end."""
    garment, openings, warnings = closed(touching, 0.003)
    assert len(openings) == 1
    assert garment.vertices[:, 1].max() > BALL
    assert not warnings


def test_a_window_that_the_form_does_not_fill_is_filled_and_said():
    """33 cm round, in cloth that lies flat: a hole of the scan looks so, too, but for its edge."""
    _, openings, warnings = closed(partial(edge, at=0.053), 0.003)
    assert len(openings) == 1
    assert len(warnings) == 1
    assert "was filled, but cloth was seen to end along" in warnings[0]


@pytest.mark.parametrize(("shape", "share"), [(edge, 1.0), (touching, 0.0)])
def test_an_edge_of_cloth_is_told_from_a_border_of_labels_within_cloth(shape, share):
    """Labels as a scan of that noise gives them: cloth begins where it is farther off than noise."""
    along = np.arange(COLLAR - 0.03, HEM, STEP)
    scan = turned(along, shape(along), np.random.default_rng(1))
    off = SurfaceDistance(ball()).signed(scan.vertices).distance
    at = np.repeat(along, int(2 * np.pi * BALL / STEP))
    border = np.interp(0.0013, shape(along), along)
    labels = SurfaceLabels(at > border, np.ones(len(at)))
    ring = scan.vertices[np.abs(at - at[at > border].min()) < 1e-9]
    read, edges = ClothEdges(scan, labels, off, 0.003).along(ring)
    assert read.mean() > 0.9
    assert abs(edges.mean() - share) < 0.1
