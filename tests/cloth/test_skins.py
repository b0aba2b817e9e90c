"""How far cloth keeps from the body: as its drape had it, and no farther than there is room for."""

import numpy as np
import pytest
from cloth_scenes import ball, fabric
from ipc_judge import crosses
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.cloth.moving.follow import follow
from vto_pipeline.cloth.moving.skins import draped_skin, thickened
from vto_pipeline.model.garment import Garment, RestShape
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.motion import BodyPath

RADIUS, SKIN = 0.1, 0.003  # m


def coarse_cover(gap):
    """An icosphere of 42 corners whose facets' middles are this far off the ball [m], and how far its corners are."""
    one = ball(1.0, levels=1)
    middle = np.linalg.norm(one.vertices[one.faces].mean(axis=1), axis=1).min()
    radius = (RADIUS + gap) / middle
    return TriangleMesh(radius * one.vertices, one.faces), radius - RADIUS


def scaled(mesh, share):
    return TriangleMesh(share * mesh.vertices, mesh.faces)


@pytest.fixture(scope="module")
def body():
    return ball(RADIUS, levels=4)


def test_cloth_whose_triangles_would_cut_the_body_keeps_the_distance_of_its_drape(body):
    """A facet's middle stands back behind its corners, here by more than the skin; ipctk is the judge."""
    cloth, away = coarse_cover(1e-3)
    assert SKIN < away < 4.0 * SKIN
    assert not crosses(cloth, body)
    assert crosses(scaled(cloth, (RADIUS + SKIN) / (RADIUS + away)), body)
    keeps = draped_skin(cloth, body, SKIN)
    assert_allclose(keeps[keeps > SKIN], away, atol=2e-4)  # the ball has facets, too
    way = cloth.vertices / np.linalg.norm(cloth.vertices, axis=1, keepdims=True)
    assert not crosses(TriangleMesh((RADIUS + keeps[:, None]) * way, cloth.faces), body)


def test_cloth_that_can_lie_closer_or_hangs_free_keeps_the_usual_distance(body):
    assert_array_equal(draped_skin(ball(RADIUS + 2.0 * SKIN, levels=4), body, SKIN), SKIN)
    free, away = coarse_cover(4.0 * SKIN)
    assert away > 4.0 * SKIN
    assert_array_equal(draped_skin(free, body, SKIN), SKIN)


def test_a_tight_drape_stays_clear_of_a_body_that_stands_still(body):
    """Let down to the usual distance, its triangles would cut the body in the first frame, for all of its attempts."""
    cloth, _ = coarse_cover(1e-3)
    still = BodyPath(lambda time: np.array(body.vertices), body.faces, 4, 1 / 30)
    tight = Garment(cloth, RestShape(0.9 * cloth.vertices))
    motion, found = follow(tight, still, fabric(bending=1e-4, friction=0.6), {"skin_mm": 1e3 * SKIN})
    assert [frame["attempts"] for frame in found["per_frame"]] == [0, 1, 1, 1]
    assert not any(crosses(TriangleMesh(frame, motion.faces), body) for frame in motion.frames)


def test_skin_thickens_where_there_is_room_and_not_in_a_fold():
    """Between two balls, by their closed form: in the gap there is no room for it, on their far sides there is."""
    gap = 0.006
    centers = np.array([[-RADIUS - 0.5 * gap, 0.0, 0.0], [RADIUS + 0.5 * gap, 0.0, 0.0]])
    one, other = (ball(RADIUS, center, levels=4) for center in centers)
    both = TriangleMesh(
        np.vstack([one.vertices, other.vertices]), np.vstack([one.faces, other.faces + len(one.vertices)])
    )
    angle = np.linspace(0.0, np.pi, 241)  # from the gap round to the far side
    way = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    before = np.full(len(way), SKIN)
    thicker = thickened(before, np.arange(len(way)), centers[0] + (RADIUS + SKIN) * way, both)
    assert_allclose(thicker[thicker > SKIN], SKIN + 1e-3, atol=1e-12)
    room = np.linalg.norm(centers[0] + (RADIUS + SKIN + 1e-3) * way - centers[1], axis=1) - RADIUS
    assert (thicker[room > SKIN + 0.5e-3] > SKIN).all()
    assert (thicker[room < SKIN - 0.5e-3] == SKIN).all()
    assert (room < SKIN - 0.5e-3).sum() > 3
    assert_array_equal(before, SKIN)


def test_cloth_inside_is_thickened_outwards(body):
    """Otherwise it would look for room on the wrong side of the surface."""
    inside = np.array([[RADIUS - 0.001, 0.0, 0.0], [0.0, RADIUS - 0.001, 0.0]])
    assert_allclose(thickened(np.full(2, SKIN), np.array([1]), inside, body), [SKIN, SKIN + 1e-3], atol=1e-12)
