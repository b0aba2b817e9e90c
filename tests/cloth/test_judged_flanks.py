"""The judge's own search for all places of a body that may bear a vertex, and what they bear together."""

import numpy as np
import pytest
from cloth_scenes import ball, fabric, sheet
from numpy.testing import assert_allclose
from scipy.optimize import minimize, nnls

from vto_pipeline.cloth.judge.audit import audit
from vto_pipeline.cloth.judge.bearing import residual_after_all_surfaces, residual_after_one_surface
from vto_pipeline.cloth.judge.flanks import flanks
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh


def folded(angle, half=0.1, length=0.4, cells=7):
    """Two planes that meet in the z axis, each rising from it at an angle (a ridge where negative), facing up."""
    across, along = np.meshgrid(np.linspace(-half, half, 2 * cells + 1), np.linspace(-length / 2, length / 2, cells))
    x = np.column_stack([across.ravel() * np.cos(angle), np.abs(across.ravel()) * np.sin(angle), along.ravel()])
    columns = 2 * cells + 1
    a = (np.arange(cells - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    faces = np.vstack(
        [np.column_stack([a, a + columns, a + 1]), np.column_stack([a + 1, a + columns, a + columns + 1])]
    )
    return TriangleMesh(x, faces.astype(np.int32))


def directions(body, point, within):
    owner, outward = flanks(body, np.array([point]), np.array([False]), np.array([within]))
    assert (owner == 0).all()
    return np.unique(outward.round(9), axis=0)


@pytest.mark.parametrize("angle", np.radians([1.0, 30.0, 80.0]))
def test_a_groove_has_two_flanks_and_a_ridge_one_edge(angle):
    away = 2e-3
    point = [0.0, away / np.cos(angle), 0.011]
    wanted = [[-np.sin(angle), np.cos(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0]]
    assert_allclose(directions(folded(angle), point, 1.01 * away), wanted, rtol=0, atol=1e-8)
    assert len(directions(folded(angle), point, 0.99 * away)) == 0
    aside = [0.1e-3 * np.sin(angle), point[1], 0.011]  # nearer to one of them
    found = directions(folded(angle), aside, 1.01 * (away + 0.5e-3))
    assert_allclose(found, wanted, rtol=0, atol=1e-8)
    over = directions(folded(-angle), [0.0, away, 0.011], 3 * away)
    assert_allclose(over, [[0.0, 1.0, 0.0]], rtol=0, atol=1e-8)


def test_the_far_side_of_what_is_thin_does_not_push():
    corners = np.array([[-1.0, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]])
    below = corners + [0, -1e-3, 0] + 0.5 * corners[:, [1, 0, 1]]  # a wedge's lower side, at a slope of 0.5
    faces = np.array([[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]], dtype=np.int32)
    wedge = TriangleMesh(np.vstack([corners, below]), faces)
    assert_allclose(directions(wedge, [0.1e-3, 1e-3, 0.0], 4e-3), [[0.0, 1.0, 0.0]], rtol=0, atol=1e-9)
    _, outward = flanks(wedge, np.array([[0.1e-3, -0.2e-3, 0.0]]), np.array([True]), np.array([4e-3]))
    down = np.array([0.5, -1.0, 0.0]) / np.hypot(0.5, 1.0)
    assert_allclose(np.unique(outward.round(9), axis=0), [[0.0, 1.0, 0.0], down], rtol=0, atol=1e-8)


def test_a_point_is_pushed_from_as_far_as_it_keeps_away_and_no_farther():
    groove, point = folded(np.radians(30.0)), [0.0, 2e-3 / np.cos(np.radians(30.0)), 0.011]
    points, outside = np.array([point] * 3), np.zeros(3, bool)
    owner, _ = flanks(groove, points, outside, np.array([1.9e-3, 10.0, 2.1e-3]))
    assert np.unique(owner).tolist() == [1, 2]


def test_flanks_are_the_minima_of_a_dense_sample():
    rng = np.random.default_rng(1)
    hollow = ball(0.1, levels=3)
    dents = rng.normal(size=(40, 3))
    dents *= 0.1 / np.linalg.norm(dents, axis=1, keepdims=True)
    depth = np.exp(-(((hollow.vertices[:, None] - dents) ** 2).sum(axis=2)) / 0.02**2).sum(axis=1)
    hollow = TriangleMesh(hollow.vertices * (1.0 - 0.15 * depth)[:, None], hollow.faces)
    points = hollow.vertices[rng.integers(len(hollow.vertices), size=10)] * 1.06
    points = points[~SurfaceDistance(hollow).inside(points)]
    within = 0.02
    owner, outward = flanks(hollow, points, np.zeros(len(points), bool), np.full(len(points), within))
    corners = hollow.vertices[hollow.faces]
    count = 0
    for i, point in enumerate(points):
        near = np.linalg.norm(corners.mean(axis=1) - point, axis=1) < 3 * within
        found = once(outward[owner == i])
        minima = minima_on(corners[near], point, within)
        assert_allclose(found, minima, rtol=0, atol=1.5e-3)
        count += len(found) > 1
    assert count > 3


def once(vectors):
    """Each of several vectors once, sorted."""
    return np.unique(np.round(vectors, 3), axis=0)


def minima_on(corners, point, within):
    """Local minima of the distance, each triangle's constrained one kept where no move along the surface is shorter."""
    found = []
    for a, b, c in corners:

        def away(w, a=a, b=b, c=c):
            return 1e4 * np.sum((a + w[0] * (b - a) + w[1] * (c - a) - point) ** 2)

        best = minimize(
            away, [0.3, 0.3], bounds=[(0, 1)] * 2, constraints={"type": "ineq", "fun": lambda w: 1 - w.sum()}, tol=1e-14
        )
        place = a + best.x[0] * (b - a) + best.x[1] * (c - a)
        if np.linalg.norm(place - point) < within and (np.cross(b - a, c - a) @ (point - place)) > 0:
            found.append(place)
    kept = []
    for place in found:
        ring = place + 1e-5 * np.random.default_rng(0).normal(size=(200, 3))
        onto = TriangleMesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
        moved = SurfaceDistance(onto).nearest(ring).point
        if (np.linalg.norm(moved - point, axis=1) >= np.linalg.norm(place - point) - 1e-8).all():
            kept.append((point - place) / np.linalg.norm(point - place))
    return once(kept)


def drawn(seed, count):
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3, 3))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    return rng.normal(size=(count, 3)), normals


def test_flanks_without_friction_bear_what_nonnegative_least_squares_finds():
    forces, normals = drawn(2, 100)
    left = [
        np.linalg.norm(residual_after_all_surfaces(force, normal, 0.0))
        for force, normal in zip(forces, normals, strict=True)
    ]
    wanted = [nnls(-normal.T, force)[1] for normal, force in zip(normals, forces, strict=True)]
    assert_allclose(left, wanted, rtol=0, atol=1e-9)
    assert 10 < (np.array(wanted) < 1e-9).sum() < 90


@pytest.mark.parametrize("friction", [0.1, 0.5, 1.5])
def test_flanks_leave_as_little_as_any_forces_within_their_cones(friction):
    """Against cones of 180 rays: those leave more, and by no more than the cones' arrows above their chords."""
    forces, normals = drawn(3, 30)
    turn = np.linspace(0.0, 2.0 * np.pi, 181)[:-1]
    borne = 0
    for force, normal in zip(forces, normals, strict=True):
        rays = []
        for n in normal:
            one = np.cross(n, np.eye(3)[np.abs(n).argmin()])
            one /= np.linalg.norm(one)
            rays += [-n + friction * (np.cos(a) * one + np.sin(a) * np.cross(n, one)) for a in turn]
        shares, least = nnls(np.array(rays).T, force)
        found = np.linalg.norm(residual_after_all_surfaces(force, normal, friction))
        assert found <= least + 1e-9
        assert found >= least - shares.sum() * friction * (1.0 - np.cos(np.pi / 180)) - 1e-9
        borne += least < 1e-9
    assert borne > 2


@pytest.mark.parametrize("friction", [0.0, 0.2, 0.45])
def test_a_wedge_slides_along_its_groove_where_its_flanks_do_not_hold_it(friction):
    tilt = np.radians(60.0)  # of the flanks; each is pressed with half of 1 / cos
    outward = np.array([[-np.sin(tilt), np.cos(tilt), 0.0], [np.sin(tilt), np.cos(tilt), 0.0]])
    slope = friction / np.sqrt(np.cos(tilt) ** 2 - (friction * np.sin(tilt)) ** 2)  # steepest, in the groove's plane
    for along in (0.9 * slope, 1.1 * slope + 0.1):
        left = residual_after_all_surfaces(np.array([0.0, -1.0, along]), outward, friction)
        wanted = max(0.0, (along - slope) / np.hypot(1.0, slope))
        assert_allclose(np.linalg.norm(left), wanted, rtol=0, atol=1e-8)


def test_one_flank_alone_bears_no_more_than_coulomb_allows():
    force = np.array([[0.0, -2.0, 1.0], [0.0, -2.0, 0.1], [0.0, 1.0, 1.0]])
    left = residual_after_one_surface(force, np.tile([0.0, 1.0, 0.0], (3, 1)), 0.2)
    assert_allclose(left, [[0.0, 0.0, 0.6], [0.0, 0.0, 0.0], [0.0, 1.0, 1.0]], rtol=0, atol=1e-12)


def test_a_strip_in_a_groove_is_borne_by_both_flanks():
    angle, skin = np.radians(30.0), 3e-3
    strip = sheet(3, 9, 0.02, 0.2, upright=False)
    x = strip.vertices - strip.vertices.mean(axis=0)
    lying = np.column_stack([x[:, 0] * np.cos(angle), skin / np.cos(angle) + np.abs(x[:, 0]) * np.sin(angle), x[:, 2]])
    found = audit(
        TriangleMesh(lying, strip.faces), RestShape(lying), folded(angle), settled=True, energy=0.0, residual=0.0,
        fabric=fabric(), friction=1.0,
    )  # fmt: skip
    assert found["judged_residual"] < 1e-6
    found = audit(
        TriangleMesh(lying, strip.faces), RestShape(lying), folded(angle), settled=True, energy=0.0, residual=0.0,
        fabric=fabric(), friction=0.0,
    )  # fmt: skip
    assert_allclose(found["judged_residual"], np.sqrt(1 / 2) * np.sin(angle), rtol=1e-5)  # half the mass is borne
