"""What was seen bare, and what says nothing."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from vto_pipeline.garment.photographed.sightings import Sightings
from vto_pipeline.garment.told_apart import Evidence
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.mesh import TriangleMesh


def sphere() -> TriangleMesh:
    made = trimesh.creation.icosphere(5, 0.15)
    return TriangleMesh(made.vertices, made.faces)


@pytest.mark.parametrize(
    ("bare", "cloth", "is_bare"),
    [
        (0.5, 0.0, True),
        (0.15, 0.0, True),  # the rest is hidden by cloth
        (0.05, 0.0, False),  # the border
        (0.4, 0.6, False),
        (0.2, 0.6, False),
        (0.0, 0.0, False),
        (0.0, 1.0, False),
    ],
)
def test_a_notch_over_form_that_photos_show_bare_is_none(bare, cloth, is_bare):
    """A ball is the form: photos show bands of it bare and clothed, and the points float 1 cm above it."""
    ball = sphere()
    share = (ball.vertices[:, 1] / 0.15 + 1.0) / 2.0  # of the ball's area below
    shown = (share <= bare) | (share > 1.0 - cloth)
    sightings = Sightings(ball.vertices[shown], (share > 1.0 - cloth)[shown], (0.15 / 32) ** 2)
    evidence = Evidence(SurfaceDistance(ball), None, sightings, 0.12, 0.06, 0.4, None)
    assert evidence.over_bare(ball.vertices / 0.15 * 0.16) == is_bare


def test_what_nobody_saw_is_not_bare():
    ball = sphere()
    assert not Evidence(SurfaceDistance(ball), None, None, 0.12, 0.06, 0.4, None).over_bare(ball.vertices)
    nothing = Sightings(np.zeros((0, 3)), np.zeros(0, dtype=bool), 1e-4)
    assert not Evidence(SurfaceDistance(ball), None, nothing, 0.12, 0.06, 0.4, None).over_bare(ball.vertices)
