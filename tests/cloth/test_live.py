"""Cloth that follows a body as fast as it moves: beside closed forms, brute force, and the frames of `follow`."""

from __future__ import annotations

import numpy as np
import pytest
from cloth_scenes import ball, fabric
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.cloth import MeshCollider, simulate
from vto_pipeline.cloth.collision.body.nearest import Nearest
from vto_pipeline.cloth.collision.body.walk import faces_around, walk
from vto_pipeline.cloth.model.build import ClothState
from vto_pipeline.cloth.moving.follow import follow
from vto_pipeline.cloth.moving.live import LiveCloth
from vto_pipeline.cloth.solvers.newton import Newton
from vto_pipeline.geometry.closest import closest_points
from vto_pipeline.geometry.topology import concatenate, submesh
from vto_pipeline.model.garment import Garment, RestShape
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.motion import BodyPath

RADIUS = 0.1
PERIOD = 1 / 25


def walked(points: np.ndarray, guess: np.ndarray, mesh: TriangleMesh) -> Nearest:
    around = faces_around(mesh.faces, len(mesh.vertices))
    return Nearest(*walk(points, guess.astype(np.int32), mesh.vertices, mesh.faces, *around))


def test_walks_over_a_convex_body_end_where_brute_force_does():
    body = ball(RADIUS, levels=3)
    rng = np.random.default_rng(0)
    away = rng.normal(0.0, 1.0, (300, 3))
    points = away / np.linalg.norm(away, axis=1, keepdims=True) * rng.uniform(1.01, 3.0, (300, 1)) * RADIUS
    found = walked(points, rng.integers(0, len(body.faces), 300), body)
    place = found.points_on(body.vertices, body.faces)
    _, nearest, distance = closest_points(points, body.vertices, body.faces)
    assert_allclose(np.linalg.norm(points - place, axis=1), distance, rtol=0, atol=1e-9)
    assert_allclose(place, nearest, rtol=0, atol=1e-7)


def test_a_walk_stays_on_its_own_part_where_two_pass_through_each_other():
    parts = [ball(RADIUS, (x, 0.0, 0.0)) for x in (0.0, 0.8 * RADIUS)]
    body, count = concatenate(parts), len(parts[0].faces)
    points = np.array([[0.95 * RADIUS, 0.01, 0.02], [1.3 * RADIUS, 0.02, 0.0]])  # in, and beyond, the other ball
    for guess, part in ((np.zeros(2), 0), (np.full(2, count), 1)):
        found = walked(points, guess, body)
        assert_array_equal(found.triangle >= count, part == 1)
        place = found.points_on(body.vertices, body.faces)
        _, nearest, _ = closest_points(points, parts[part].vertices, parts[part].faces)
        assert_allclose(place, nearest, rtol=0, atol=1e-7)


@pytest.fixture(scope="module")
def cap() -> Garment:
    """A cap on a ball, at rest."""
    shell = ball(1.04 * RADIUS, levels=3)
    mesh = submesh(shell, (shell.vertices[:, 1] > 0.65 * RADIUS)[shell.faces].all(axis=1))[0]
    on = MeshCollider(ball(RADIUS, levels=3), friction=0.6)
    still = simulate(mesh, cloth(), colliders=[on], seconds=4.0, settings={"until": "rest", "damping": 5.0})
    assert still.report["settled"]
    return Garment(TriangleMesh(still.positions, mesh.faces), RestShape(mesh.vertices))


def cloth(friction: float = 0.6):
    return fabric(bending=1e-4, friction=friction)


def smooth(share: float) -> float:
    s = np.clip(share, 0.0, 1.0)
    return float(s**3 * (10 + s * (6 * s - 15)))


def turned(points: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return points @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T


def carried(cap: Garment, at, frames: int, friction: float = 0.6) -> tuple[LiveCloth, np.ndarray]:
    """The cloth and its frames on a ball that moves: at: time, its vertices -> where they are."""
    body = ball(RADIUS, levels=3)
    live = LiveCloth(cap, body, cloth(friction))
    found = [live.positions]
    for frame in range(1, frames):
        live.advance(at(frame * PERIOD, body.vertices), PERIOD)
        found.append(live.positions)
    return live, np.array(found)


def test_on_a_still_body_it_stays_at_rest(cap):
    live, frames = carried(cap, lambda t, x: x, 26)
    assert np.abs(frames - cap.mesh.vertices).max() < 5e-4
    assert (live.deepest, live.restarts) == (0.0, 0)


def test_it_goes_along_with_a_body_and_lies_as_before_when_all_is_still(cap):
    way = np.array([0.4, 0.0, 0.0])
    live, frames = carried(cap, lambda t, x: x + smooth(t) * way, 51)
    assert_allclose(frames[-1] - way, cap.mesh.vertices, rtol=0, atol=3e-3)  # it slides by less than 1 % of the way
    assert live.restarts == 0


def test_friction_turns_it_with_the_body(cap):
    """By a quarter in three seconds; faster, a step a frame is too long for friction to hold."""
    _, frames = carried(cap, lambda t, x: turned(x, 0.5 * np.pi * smooth(t / 3.0)), 100)
    assert_allclose(frames[-1], turned(cap.mesh.vertices, 0.5 * np.pi), rtol=0, atol=3e-3)


def test_it_is_near_the_frames_of_the_accurate_solver(cap):
    def sways(t: float, x: np.ndarray) -> np.ndarray:
        shift = np.array([0.05 * smooth(t) * np.sin(7.0 * t), 0.0, 0.0])
        return turned(x, 0.6 * smooth(t) * np.sin(4.0 * t)) + shift

    _, frames = carried(cap, sways, 30)
    body = ball(RADIUS, levels=3)
    path = BodyPath(lambda t: np.array(sways(t, body.vertices)), body.faces, 30, PERIOD)
    truth, _ = follow(cap, path, cloth())
    off = np.linalg.norm(frames - truth.frames, axis=2)
    went = np.linalg.norm(truth.frames - truth.frames[0], axis=2)
    assert np.median(off) < 3e-3 < 0.1 * np.quantile(went, 0.95)


def test_a_leap_of_ten_centimetres_a_frame_is_followed_outside_of_the_body(cap):
    leap = np.array([0.1, 0.0, 0.0])
    live, frames = carried(cap, lambda t, x: x + round(t / PERIOD) * leap, 4)
    for _ in range(20):
        live.advance(ball(RADIUS, (0.3, 0.0, 0.0), levels=3).vertices, PERIOD)
    assert np.linalg.norm(live.positions - [0.3, 0.0, 0.0], axis=1).min() > 0.99 * RADIUS
    assert live.restarts == 0
    assert np.isfinite(frames).all()


def test_cloth_that_a_step_leaves_in_the_body_is_shown_on_its_skin(cap, monkeypatch):
    """By brute force: what is in the ball goes to the nearest place of it, and all else stays."""
    live, _ = carried(cap, lambda t, x: x, 3)
    body, stays = ball(RADIUS, (0.04, 0.02, 0.01), levels=3), live.positions
    _, nearest, _ = closest_points(stays, body.vertices, body.faces)
    inside = np.linalg.norm(stays - [0.04, 0.02, 0.01], axis=1) < 0.99 * RADIUS  # facets lie within a percent
    clear = np.linalg.norm(stays - [0.04, 0.02, 0.01], axis=1) > RADIUS
    assert inside.sum() > 10 < clear.sum()
    monkeypatch.setattr(Newton, "advance", lambda self, state, contacts, h, substeps: state)
    live.advance(body.vertices, PERIOD)
    assert_allclose(live.positions[inside], nearest[inside], rtol=0, atol=1e-7)
    assert_array_equal(live.positions[clear], stays[clear])


@pytest.mark.parametrize("wrong", [np.nan, np.inf, 50.0])
def test_cloth_that_has_gone_astray_is_laid_on_anew(cap, wrong, monkeypatch):
    live, _ = carried(cap, lambda t, x: x, 3)

    def blows_up(self, state, contacts, h, substeps):
        positions = state.positions.copy()
        positions[3, 1] = wrong
        return ClothState(positions, state.velocities, state.time + h)

    way = np.array([0.3, 0.1, 0.0])
    with monkeypatch.context() as broken:
        broken.setattr(Newton, "advance", blows_up)
        live.advance(ball(RADIUS, way, levels=3).vertices, PERIOD)
    assert live.restarts == 1
    assert_allclose(live.positions - way, cap.mesh.vertices, rtol=0, atol=1e-9)
    live.advance(ball(RADIUS, way, levels=3).vertices, PERIOD)
    assert live.restarts == 1
    assert_allclose(live.positions - way, cap.mesh.vertices, rtol=0, atol=1e-3)
