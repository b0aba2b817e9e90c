"""Mittens: hulls about the ends of limbs, which coarse cloth passes over where fingers would come through it."""

import numpy as np
import pytest
import trimesh
from cloth_scenes import fabric, tube
from figures import capsules, surface
from numpy.testing import assert_allclose
from scipy.spatial import cKDTree

import vto_pipeline.cloth.rest.phases as module
from vto_pipeline.cloth.drape_config import DrapeConfig
from vto_pipeline.cloth.model.build import at_rest, build_cloth
from vto_pipeline.cloth.placement.limbs.limbs import Limbs
from vto_pipeline.cloth.placement.limbs.mittens import in_mittens
from vto_pipeline.cloth.rest.phases import Phases
from vto_pipeline.errors import IntersectingError
from vto_pipeline.geometry.intersections import intersecting_faces
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

TRUNK, TOP, TIP, FINGER = 0.06, 1.0, 1.06, 0.009  # m: radius of the trunk, where fingers begin and end, their radius
ROUND = np.linspace(0.0, 2.0 * np.pi, 6, endpoint=False)


@pytest.fixture(scope="module")
def forearm():
    """A trunk that stands upright, with six fingers at its top, spread."""
    fingers = [
        (np.array([0.03 * c, TOP, 0.03 * s]), np.array([0.075 * c, TIP, 0.075 * s]), FINGER)
        for c, s in zip(np.cos(ROUND), np.sin(ROUND), strict=True)
    ]
    trunk = (np.array([0.0, 0.1, 0.0]), np.array([0.0, TOP - TRUNK, 0.0]), TRUNK)
    return surface(lambda x: capsules(x, [trunk, *fingers]), 0.01)


@pytest.mark.parametrize("padding", [0.004, 0.01])
def test_a_mitten_is_convex_and_stands_off_all_that_it_covers(forearm, padding):
    limbs = Limbs(forearm)
    found = in_mittens(MovingBody(forearm.vertices[None], forearm.faces), limbs, padding).final
    assert (found.vertices[: len(forearm.vertices)] == forearm.vertices).all()
    assert (found.faces[: len(forearm.faces)] == forearm.faces).all()
    mittens = trimesh.Trimesh(found.vertices, found.faces[len(forearm.faces) :], process=False).split()
    assert len(mittens) == len(limbs.ends()) == 2
    for mitten in mittens:
        assert mitten.is_watertight
        assert mitten.is_convex
        assert mitten.volume > 0.0
    covered = np.unique(np.concatenate(limbs.ends()))
    assert (forearm.vertices[:, 1] > TOP).sum() == np.isin(np.flatnonzero(forearm.vertices[:, 1] > TOP), covered).sum()
    surfaces = [SurfaceDistance(TriangleMesh(one.vertices, one.faces.astype(np.int32))) for one in mittens]
    depth = np.max([-one.signed(forearm.vertices[covered]).distance for one in surfaces], axis=0)
    assert depth.min() > 0.75 * padding  # the ball about each point has fourteen corners


def test_a_mitten_moves_along_and_is_padded_at_the_end_only(forearm):
    frames = np.stack([0.5 * forearm.vertices - [0.3, 0.0, 0.1], forearm.vertices])
    limbs = Limbs(forearm)
    found = in_mittens(MovingBody(frames, forearm.faces), limbs, 0.01).keyframes[:, len(forearm.vertices) :]
    covered = np.unique(np.concatenate(limbs.ends()))
    away = [cKDTree(frames[k, covered]).query(found[k])[0] for k in (0, 1)]
    assert_allclose(away[0], 0.0, rtol=0, atol=1e-12)
    assert away[1].min() > 0.0075
    assert away[1].max() < 0.0101


@pytest.mark.parametrize("base", [0.6, 0.603, 0.608])
def test_fingers_do_not_come_through_coarse_cloth_in_which_they_grow(forearm, base, monkeypatch):
    """A sleeve of long edges that begins in the trunk and goes on over the fingers, which spread beyond it.

    What comes through without mittens is twice as much, and sometimes comes free all the same: that hangs on bits.
    """
    garment = tube(0.045, 0.6, 14, 20, base=base)
    rest = RestShape(tube(0.065, 0.6, 14, 20, base=base).vertices)
    model = build_cloth(garment, rest, fabric())
    usual, through = Phases._grown, []

    def grown(phases, growth, config):
        if config.body_features:  # which takes long, and is not what is asked here
            raise IntersectingError("jammed")
        state, stepper = usual(phases, growth, config)
        through.append(len(intersecting_faces(TriangleMesh(state.positions, garment.faces), forearm)))
        return state, stepper

    monkeypatch.setattr(Phases, "_grown", grown)
    phases = Phases(model, rest, fabric(), DrapeConfig(), Job())
    found = phases.grow_body(at_rest(garment.vertices), forearm)
    assert len(intersecting_faces(TriangleMesh(found.positions, garment.faces), forearm)) == 0
    monkeypatch.setattr(module, "in_mittens", lambda body, limbs, padding: body)
    phases.grow_body(at_rest(garment.vertices), forearm)
    assert through[1] > 1.5 * through[0]
