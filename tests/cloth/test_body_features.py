"""Cloth and the features of mesh bodies between its vertices: against ipctk, closed forms and brute force."""

import ipctk
import numpy as np
import pytest
import trimesh
from cloth_scenes import ball, fabric, moved, sheet
from numpy.testing import assert_allclose, assert_array_equal
from unclean_bodies import doubled, fine_box, flipped, soup, together

import vto_pipeline.cloth.dynamics.body_motion
import vto_pipeline.cloth.dynamics.stepper
from vto_pipeline.cloth import MeshCollider, simulate
from vto_pipeline.cloth.collision.body.contacts import BodyCollider
from vto_pipeline.cloth.collision.response.projected_gauss_seidel import separate_pairs
from vto_pipeline.cloth.collision.self_collision.self_contact import SelfContact
from vto_pipeline.cloth.dynamics.body_motion import VariableSpeedBody, run_body_motion
from vto_pipeline.cloth.dynamics.stepper import StepConfig, Stepper
from vto_pipeline.cloth.model.build import at_rest, build_cloth
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.cpu_threads import limited_threads

FABRIC = fabric(stretch=1000.0, shear=200.0, bending=1e-5, density=0.2, friction=0.3)
REACH = 5e-4  # m


def crosses(positions, faces, body):
    """Whether cloth and body cross, or one of them itself, by the judge."""
    both = np.vstack([positions, body.vertices])
    mesh = np.vstack([faces, body.faces + len(positions)]).astype(np.int32)
    return ipctk.has_intersections(ipctk.CollisionMesh(both, ipctk.edges(mesh), mesh), both)


def cone(height=0.25):
    """A cone standing on y = 0."""
    mesh = trimesh.creation.cone(0.08, height, sections=24)
    return TriangleMesh(mesh.vertices[:, [1, 2, 0]], mesh.faces)


def block(size, center=(0.0, 0.0, 0.0)):
    """A box of twelve triangles."""
    mesh = trimesh.creation.box(size)
    return moved(TriangleMesh(mesh.vertices, mesh.faces), *center)


def keyframes(body, *shifts):
    """The body in several places."""
    return MovingBody(np.stack([body.vertices + np.asarray(shift) for shift in shifts]), body.faces)


def contact(cloth, body, seconds=0.0, reach=REACH, friction=0.3):
    """Contacts of a cloth that is crossed by nothing with a body."""
    body = body if isinstance(body, MovingBody) else MovingBody(body.vertices[None], body.faces)
    collider = BodyCollider(body, seconds, friction)
    return SelfContact(cloth.faces, np.full(len(cloth.vertices), reach), 0.3, bodies=[collider])


FEATURES = {"body_features": True}


def dropped(body, *, seconds=0.6, edge=0.04, height=0.02, settings=None, friction=0.3):
    """A coarse sheet that has fallen on a body."""
    rows = 10
    size = edge * (rows - 1)
    top = body.vertices[:, 1].max()
    mesh = moved(sheet(rows, rows, size, size, upright=False), 0.013 - size / 2, top + height, 0.017 - size / 2)
    ended = simulate(
        mesh,
        FABRIC,
        colliders=[MeshCollider(body, friction)],
        seconds=seconds,
        settings={**FEATURES, **(settings or {})},
    )
    return ended, mesh.faces


BODIES = {
    "cone": cone(),
    "box": block((0.2, 0.1, 0.2)),
    "finer than the cloth": ball(0.08, levels=3),
    "fence": block((0.5, 0.2, 0.004)),
}


@pytest.mark.parametrize("name", BODIES)
def test_coarse_cloth_falls_on_a_body_and_nothing_comes_through(name, monkeypatch):
    body = BODIES[name]
    ended, faces = dropped(body)
    assert not crosses(ended.positions, faces, body)
    assert ended.positions[:, 1].min() < body.vertices[:, 1].max() - 0.04  # it hangs down around it
    calm, _ = dropped(body, settings={"substeps": 8, "damping": 5.0})  # in steps as long as usual it jumps about
    assert calm.positions[:, 1].max() < body.vertices[:, 1].max() + 0.02  # and lies on it
    assert np.isfinite(ended.velocities).all()

    def planes_only(*given, bodies, **more):
        return SelfContact(*given, **more)

    monkeypatch.setattr(vto_pipeline.cloth.dynamics.stepper, "SelfContact", planes_only)
    ended, faces = dropped(body)
    through = ended.positions[:, 1].max() < body.vertices[:, 1].min()
    assert through or crosses(ended.positions, faces, body)  # so the test tests something


@pytest.mark.parametrize("solver", ["xpbd", "backward_euler"])
def test_whatever_the_solver(solver):
    ended, faces = dropped(BODIES["fence"], seconds=0.3, settings={"solver": solver})
    assert not crosses(ended.positions, faces, BODIES["fence"])


def wall(tall):
    """A triangle of cloth over the origin, larger than the body under it."""
    return TriangleMesh([[-0.3, tall, -0.2], [0.0, tall, 0.4], [0.3, tall, -0.2]], [[0, 1, 2]])


def tetrahedron():
    """A tip at the origin, pointing up."""
    points = [[0, 0, 0], [0.05, -0.1, 0.0], [-0.03, -0.1, 0.04], [-0.03, -0.1, -0.04]]
    mesh = trimesh.Trimesh(points, [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    mesh.fix_normals()
    return TriangleMesh(mesh.vertices, mesh.faces)


def test_a_tip_below_a_face_is_one_pair_at_its_distance():
    cloth = wall(3e-4)
    pairs = contact(cloth, tetrahedron()).find_pairs(cloth.vertices, cloth.vertices.copy(), 0.0)
    assert len(pairs.key) == 1
    assert_allclose(pairs.normal[0], [0, -1, 0], rtol=0, atol=1e-12)  # from the face to the tip
    way = np.einsum("s,sk->k", pairs.weights[0], cloth.vertices[pairs.vertices[0]]) + pairs.fixed[0]
    assert_allclose(way, [0, -3e-4, 0], rtol=0, atol=1e-15)  # rounding
    assert_allclose(pairs.gap, 3e-4, rtol=1e-9, atol=0)  # no recovery in no time
    assert_allclose(pairs.weights.sum(), -1.0, rtol=1e-12)  # of the cloth alone
    assert_allclose(pairs.friction, 0.3, rtol=0, atol=0)


@pytest.mark.parametrize("along", [0.0, 0.02])
def test_an_edge_across_an_edge_is_one_pair(along):
    strip = TriangleMesh([[-0.3, 3e-4, along], [0.3, 3e-4, along], [0.0, 0.5, along]], [[0, 1, 2]])
    roof = TriangleMesh(  # with its ridge along z
        [[0, 0, -0.1], [0, 0, 0.1], [-0.1, -0.1, -0.1], [-0.1, -0.1, 0.1], [0.1, -0.1, -0.1], [0.1, -0.1, 0.1]],
        [[0, 2, 3], [0, 3, 1], [0, 1, 5], [0, 5, 4], [0, 4, 2], [1, 3, 5], [2, 4, 5], [2, 5, 3]],
    )
    roof = TriangleMesh(roof.vertices, trimesh.Trimesh(roof.vertices, roof.faces).faces)
    pairs = contact(strip, roof).find_pairs(strip.vertices, strip.vertices.copy(), 0.0)
    assert len(pairs.key) == 1
    assert_allclose(pairs.normal[0], [0, 1, 0], rtol=0, atol=1e-12)
    below = strip.vertices - [0, 6e-4, 0]  # inside: planes lead it out
    assert len(contact(strip, roof).find_pairs(below, below.copy(), 0.0).key) == 0


def test_a_face_that_a_tip_has_come_through_is_free_to_go_back():
    cloth, back = wall(-3e-4), wall(5e-3).vertices
    held = contact(cloth, tetrahedron())
    assert len(held.find_pairs(cloth.vertices, cloth.vertices.copy(), 0.0).key) == 0
    assert_array_equal(held.collision_free(cloth.vertices, back)[0][:, 1], back[:, 1])


@pytest.mark.parametrize("speed", [-0.01, -0.3, -50.0])
def test_no_move_goes_through_a_tip(speed):
    cloth = wall(2e-3)
    held = contact(cloth, tetrahedron())
    there, met = held.collision_free(cloth.vertices, cloth.vertices + np.array([0.0, speed, 0.0]))
    assert not crosses(there, cloth.faces, tetrahedron())
    assert 0.0 < there[:, 1].max() < 1.9e-3  # a tenth of the way is left, at most; and it did go
    assert len(met.key) > 0
    assert held.counters.shortened == 3


@pytest.mark.parametrize("around", np.linspace(0.1, 6.2, 5))
def test_what_slides_over_a_thorn_from_beside_it_is_not_pierced(around):
    """Its edge begins a little below the tip and passes over it; the thorn's sides are steeper, so that is outside."""
    thorn = trimesh.creation.cone(0.006, 0.05, sections=12)
    thorn = TriangleMesh(thorn.vertices[:, [1, 2, 0]] - [0.0, 0.05, 0.0], thorn.faces)
    turn = trimesh.transformations.rotation_matrix(around, [0, 1, 0])[:3, :3]
    x = 1e-3 * np.array([[1.1, -0.05, -8.0], [1.1, -0.05, 8.0], [14.0, -8.5, 0.0]]) @ turn.T
    wanted = x + 1e-3 * turn @ [-2.6, 0.4, 0.0]
    assert not crosses(x, [[0, 1, 2]], thorn)
    assert crosses(wanted, [[0, 1, 2]], thorn)
    there, _ = contact(TriangleMesh(x, [[0, 1, 2]]), thorn).collision_free(x, wanted)
    assert not crosses(there, [[0, 1, 2]], thorn)


@pytest.mark.parametrize("seed", range(5))
def test_safe_moves_among_many_bodies_cross_nothing(seed):
    random = np.random.default_rng(seed)
    places = random.permutation(9)[:6]
    balls = together(
        *(ball(0.05, (0.13 * (k % 3 - 1), -0.1 - 0.01 * k, 0.13 * (k // 3 - 1)), levels=1) for k in places)
    )
    cloth = sheet(8, 8, 0.4, 0.4, upright=False)
    x = cloth.vertices - [0.2, 0.0, 0.2]
    wanted = x + np.array([0.0, -0.3, 0.0]) + random.normal(scale=0.05, size=x.shape)
    assert crosses(wanted, cloth.faces, balls)
    there, _ = contact(cloth, balls).collision_free(x, wanted)
    for share in (0.3, 0.7, 1.0):
        assert not crosses(x + share * (there - x), cloth.faces, balls)
    assert np.linalg.norm(there - x, axis=1).mean() > 0.02  # it does go


def test_a_body_far_away_changes_nothing():
    cloth, far = wall(0.0), moved(tetrahedron(), 0, -5.0, 0)
    held = contact(cloth, far)
    wanted = cloth.vertices + np.array([0.1, -0.2, 0.3])
    there, met = held.collision_free(cloth.vertices, wanted)
    assert_array_equal(there, wanted)
    assert len(met.key) == held.counters.impacts == 0


def test_a_moving_tip_is_foreseen_and_carries_what_it_would_meet():
    cloth = wall(4e-3)
    rising = keyframes(tetrahedron(), (0, 0, 0), (0.001, 0.006, 0))
    held = contact(cloth, rising, seconds=0.01)
    held.set_time_span(0.0, 0.01)
    pairs = held.find_pairs(cloth.vertices, cloth.vertices.copy(), 0.01)
    assert len(pairs.key) == 1
    assert_allclose(pairs.carried[0], [-0.001, -0.006, 0], rtol=0, atol=1e-12)  # weight 1 on the body, moved against
    assert_allclose(pairs.fixed[0], [0.001, 0.006, 0], rtol=0, atol=1e-12)
    there, met = held.collision_free(cloth.vertices, cloth.vertices.copy())
    assert len(met.key) == 1
    assert held.counters.uncut == 0
    assert not crosses(there, cloth.faces, TriangleMesh(rising.keyframes[-1], rising.faces))
    assert there[:, 1].max() < 4e-3 + 6e-3  # as far as needed, no farther than the tip


def test_where_bodies_close_on_cloth_it_is_said_and_what_rests_is_not_crossed():
    cloth, roof = wall(4e-3), block((0.05, 0.05, 0.05), (0, 0.03, 0))
    body = together(tetrahedron(), roof)
    risen = body.vertices + np.where(np.arange(len(body.vertices)) < 4, 0.006, 0.0)[:, None] * [0, 1, 0]
    held = contact(cloth, MovingBody(np.stack([body.vertices, risen]), body.faces), seconds=0.01)
    held.set_time_span(0.0, 0.01)
    there, _ = held.collision_free(cloth.vertices, cloth.vertices.copy())
    assert held.counters.uncut > 0
    assert not crosses(there, cloth.faces, roof)


@pytest.mark.parametrize("rough", [0.0, 2.0])
def test_a_moving_tip_lifts_a_face_and_takes_it_along_if_it_is_rough(rough):
    cloth = wall(1e-3)
    held = contact(cloth, keyframes(tetrahedron(), (0, 0, 0), (0.002, 0.003, 0)), seconds=0.01, friction=rough)
    held.set_time_span(0.0, 0.01)
    x = cloth.vertices.copy()
    separate_pairs(held.find_pairs(x, x, 0.01), np.ones(3), cloth.vertices, x)
    if rough == 0.0:
        assert_allclose(x[:, [0, 2]], cloth.vertices[:, [0, 2]], rtol=0, atol=1e-15)
    else:  # the place of the face over the tip has gone with it
        assert_allclose((x - cloth.vertices)[:, 0].mean(), 0.002, rtol=0, atol=1e-9)
    assert_allclose((x[:, 1]).mean(), 0.003 + REACH, rtol=0, atol=1e-9)  # the reach above it


def test_a_body_that_rises_takes_a_sheet_along():
    body = BODIES["cone"]
    rising = keyframes(body, (0, 0, 0), (0, 0.05, 0))
    size = 0.28
    mesh = moved(sheet(8, 8, size, size, upright=False), 0.013 - size / 2, 0.255, 0.017 - size / 2)
    ended = simulate(mesh, FABRIC, colliders=[MeshCollider(rising, 0.3, seconds=0.3)], seconds=0.6, settings=FEATURES)
    there = TriangleMesh(rising.keyframes[-1], rising.faces)
    assert not crosses(ended.positions, mesh.faces, there)
    assert ended.positions[:, 1].max() > there.vertices[:, 1].max()


@pytest.mark.parametrize(("aside", "seconds"), [(0.08, 0.02), (0.03, 0.02)])
@pytest.mark.parametrize("again", [True, False])
def test_fingers_that_spread_at_once_are_slowed_until_none_goes_through(aside, seconds, again, monkeypatch):
    if not again:
        monkeypatch.setattr(vto_pipeline.cloth.dynamics.body_motion, "_gone_through", lambda stepper: 0)
    fingers = together(moved(cone(), -0.09, 0, 0), moved(cone(), 0.09, 0, 0))
    apart = np.sign(fingers.vertices[:, :1]) * [aside, 0, 0] + [0, 0.1, 0]
    body = MovingBody(np.stack([fingers.vertices, fingers.vertices + apart]), fingers.faces)
    mesh = moved(sheet(9, 9, 0.5, 0.5, upright=False), 0.013 - 0.25, 0.253, 0.017 - 0.25)
    collider = VariableSpeedBody(body, seconds, 0.3)
    stepper = Stepper(
        build_cloth(mesh, RestShape(mesh.vertices), FABRIC), [collider], np.full(81, 2e-3), StepConfig(**FEATURES)
    )
    state = run_body_motion(stepper, at_rest(mesh.vertices), collider, 2e-3, lambda done: None)
    assert crosses(state.positions, mesh.faces, TriangleMesh(body.keyframes[-1], body.faces)) is not again
    assert (collider.ends > seconds) is again


@pytest.mark.parametrize("mend", [doubled, flipped, lambda mesh, _: soup(mesh)])
def test_an_unclean_body_is_held_like_a_clean_one(mend):
    clean = ball(0.08, levels=2)
    ended, faces = dropped(mend(clean, np.random.default_rng(0)), seconds=0.4)
    assert not crosses(ended.positions, faces, clean)


def test_what_lies_inside_a_body_holds_nothing():
    hidden = together(fine_box((0.2, 0.2, 0.2), edge=0.1), moved(tetrahedron(), 0, 0.05, 0))
    cloth = wall(0.051)
    assert len(contact(cloth, hidden).find_pairs(cloth.vertices, cloth.vertices.copy(), 0.0).key) == 0


def test_the_same_bits_with_one_thread_and_two():
    found = []
    for threads in (1, 2):
        with limited_threads(threads):
            found.append(dropped(BODIES["finer than the cloth"], seconds=0.3)[0].positions)
    assert_array_equal(found[0], found[1])
