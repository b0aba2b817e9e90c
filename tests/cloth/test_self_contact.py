"""Cloth against itself: pairs against brute force, safe moves and whole scenes against ipctk, momentum."""

from dataclasses import replace

import ipctk
import numpy as np
import pytest
from cloth_scenes import fabric, moved, sheet
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.cloth import Plane, simulate
from vto_pipeline.cloth.collision.self_collision.self_contact import SelfContact
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.cpu_threads import limited_threads
from vto_pipeline.units import GRAVITY

FABRIC = fabric(stretch=1000.0, shear=200.0, bending=1e-5, density=0.2, friction=0.3)


POINTED = np.array([[0.0, 1e-3, 0.0], [-0.01, 0.04, 0.0], [0.01, 0.04, 0.003]])  # a triangle standing on its tip


def crosses(positions, faces):
    """Whether any edge meets any face, by the judge."""
    mesh = ipctk.CollisionMesh(positions, ipctk.edges(faces), faces)
    return ipctk.has_intersections(mesh, positions)


def stack(*meshes):
    """Several meshes as one."""
    first = np.cumsum([0, *(len(one.vertices) for one in meshes)])
    faces = [one.faces + np.int32(at) for one, at in zip(meshes, first, strict=False)]
    return TriangleMesh(np.vstack([one.vertices for one in meshes]), np.vstack(faces))


def triangles(count, seed, size=0.05):
    """Loose triangles in a box, none crossing another."""
    random = np.random.default_rng(seed)
    kept = np.empty((0, 3, 3))
    while len(kept) < count:
        corners = random.uniform(0, 0.2, (1, 1, 3)) + random.normal(scale=size, size=(1, 3, 3))
        tried = np.concatenate([kept, corners])
        if not crosses(tried.reshape(-1, 3), np.arange(3 * len(tried), dtype=np.int32).reshape(-1, 3)):
            kept = tried
    return kept.reshape(-1, 3), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


def triangle_distance(one, other):
    """Distance between two triangles (3, 3), from the judge's for their vertices, edges and faces."""
    found = [ipctk.point_triangle_distance(p, *other) for p in one] + [
        ipctk.point_triangle_distance(p, *one) for p in other
    ]
    sides = ((0, 1), (1, 2), (2, 0))
    found += [ipctk.edge_edge_distance(one[a], one[b], other[c], other[d]) for a, b in sides for c, d in sides]
    return np.sqrt(min(found))


@pytest.mark.parametrize("seed", range(6))
def test_pairs_say_how_near_any_two_triangles_are(seed):
    x, faces = triangles(25, seed)
    reach = 0.01
    pairs = SelfContact(faces, np.full(len(x), 0.5 * reach), 0.3).find_pairs(x, x.copy(), 0.0)
    way = np.einsum("ps,psk->pk", pairs.weights, x[pairs.vertices])
    length = np.linalg.norm(way, axis=1)
    assert_allclose(way, length[:, None] * pairs.normal, rtol=0, atol=1e-15)  # rounding
    assert_allclose(pairs.weights.sum(axis=1), 0.0, rtol=0, atol=1e-15)  # nothing happens to what moves together
    assert (np.diff(pairs.key) > 0).all()
    assert length.max() <= reach
    first = pairs.vertices[:, 0] // 3  # loose triangles: which two a pair is of
    last = pairs.vertices[:, 3] // 3
    near = 0
    for one in range(25):
        for other in range(one + 1, 25):
            known = triangle_distance(x[faces[one]], x[faces[other]])
            mine = length[(np.minimum(first, last) == one) & (np.maximum(first, last) == other)]
            if known < reach:
                assert_allclose(mine.min(), known, rtol=1e-9, atol=0)  # rounding
                near += 1
            else:
                assert len(mine) == 0
    assert near > 2


def test_a_fold_is_held_once():
    """Over an edge of a sheet several faces are as near; one of them answers."""
    mesh = stack(sheet(5, 5, 0.1, 0.1, upright=False), TriangleMesh(POINTED, [[0, 1, 2]]))
    at = len(mesh.vertices) - 3
    for under in (np.array([0.05, 0.0]), np.array([0.0375, 0.05])):  # over a vertex and over an edge of the sheet
        x = mesh.vertices.copy()
        x[at:, [0, 2]] += under - x[at, [0, 2]]
        pairs = SelfContact(mesh.faces, np.full(len(x), 5.1e-4), 0.3).find_pairs(x, x.copy(), 0.0)
        assert len(pairs.key) == 1


@pytest.mark.parametrize("seed", range(8))
def test_a_safe_move_crosses_nothing(seed):
    x, faces = triangles(40, seed)
    random = np.random.default_rng(seed)
    wanted = x + np.repeat(random.normal(scale=0.1, size=(40, 3)), 3, axis=0) + random.normal(scale=0.02, size=x.shape)
    assert crosses(wanted, faces)
    there, met = SelfContact(faces, np.zeros(len(x)), 0.3).collision_free(x, wanted)
    for share in (0.3, 0.7, 1.0):  # on the way, too
        assert not crosses(x + share * (there - x), faces)
    gone = np.linalg.norm(there - x, axis=1) / np.linalg.norm(wanted - x, axis=1)
    assert 0.1 < gone.mean() < 1.0  # it does go
    assert len(met.key) > 0


def test_what_is_held_up_is_not_passed_through_by_what_falls_on():
    """By itself all but the lowest triangle falls alike, so that nothing comes nearer to anything above it."""
    wide = np.array([[-1.0, 0.0, -1.0], [3.0, 0.0, -1.0], [-1.0, 0.0, 3.0]])
    narrow = np.array([[-0.9, 0.0, -0.9], [-0.5, 0.0, -0.9], [-0.9, 0.0, -0.5]])
    beside = np.array([[2.0, 0.5, -0.9], [2.4, 0.6, -0.9], [2.0, 0.7, -0.6]])  # over the wide one, not over the narrow
    far = [wide + np.array([0.0, 5.0 + k, 0.0]) for k in range(20)]
    x = np.vstack([narrow - [0.0, 0.01, 0.0], wide, beside, *far])
    faces = np.arange(len(x), dtype=np.int32).reshape(-1, 3)
    wanted = x - np.where(np.arange(len(x)) < 3, 0.0, 1.0)[:, None] * np.array([0.0, 1.0, 0.0])
    there, _ = SelfContact(faces, np.full(len(x), 1e-3), 0.3).collision_free(x, wanted)
    assert there[3:6, 1].min() > -0.01  # held up
    assert there[6:9, 1].min() > there[3:6, 1].max()  # and what is over it stays so
    assert_array_equal(there[9:], wanted[9:])  # too far up to come near


def test_what_meets_nothing_goes_all_the_way():
    x, faces = triangles(10, 3)
    wanted = x + np.array([50.0, 20.0, -9.0])
    contact = SelfContact(faces, np.zeros(len(x)), 0.3)
    there, met = contact.collision_free(x, wanted)
    assert_array_equal(there, wanted)
    assert len(met.key) == 0


def test_a_vertex_that_a_trial_flings_does_not_make_everything_near_everything():
    """Half a metre; the others stay. Their pairs are as few as before, and what it would pass through is found."""
    mesh = sheet(40, 40, 0.4, 0.4, upright=False)
    shelf = np.array([[0.1, 0.2, 0.1], [0.3, 0.2, 0.1], [0.2, 0.2, 0.3]])
    x = np.vstack([mesh.vertices - mesh.vertices.mean(axis=0) + [0.2, 0.0, 0.2], shelf])
    faces = np.vstack([mesh.faces, [[1600, 1601, 1602]]]).astype(np.int32)
    flung = x.copy()
    middle = int(np.argmin(np.linalg.norm(x[:1600] - [0.2, 0.0, 0.2], axis=1)))
    flung[middle, 1] += 0.5
    found = [SelfContact(faces, np.full(len(x), 1e-4), 0.3, force_all=brute) for brute in (False, True)]
    ends = [one.collision_free(x, flung)[0] for one in found]
    assert_array_equal(ends[0], ends[1])
    assert ends[0][middle, 1] < 0.2  # below the shelf
    assert found[0].counters.candidates < 4 * found[1].counters.candidates


def test_safe_moves_have_the_same_bits_with_one_thread_and_two():
    x, faces = triangles(60, 5)
    wanted = x + np.random.default_rng(1).normal(scale=0.1, size=x.shape)
    found = []
    for threads in (1, 2):
        with limited_threads(threads):
            found.append(SelfContact(faces, np.full(len(x), 0.002), 0.3).collision_free(x, wanted)[0])
    assert_array_equal(found[0], found[1])


def test_a_sheet_that_falls_on_edge_folds_up_and_crosses_nothing():
    upright = sheet(12, 12, 0.2, 0.2)
    points = upright.vertices + np.array([0.0, 0.21, 0.0])
    points[:, 2] += 1e-3 * np.sin(40.0 * points[:, 1])
    mesh = TriangleMesh(points, upright.faces)
    colliders = [Plane((0, 0, 0), (0, 1, 0), 0.3)]
    free = simulate(mesh, FABRIC, colliders=colliders, seconds=1.0, settings={"self_collision": False})
    held = simulate(mesh, FABRIC, colliders=colliders, seconds=1.0)
    assert crosses(free.positions, mesh.faces)  # so the test tests something
    assert not crosses(held.positions, mesh.faces)
    assert held.positions[:, 1].mean() < 0.05  # and it did fall


@pytest.mark.parametrize("solver", ["newton", "xpbd", "backward_euler"])
def test_two_sheets_lie_one_on_the_other(solver):
    thick = FABRIC.thickness
    low, high = sheet(7, 7, 0.1, 0.1, upright=False), sheet(6, 6, 0.08, 0.08, upright=False)
    mesh = stack(moved(low, 0, 0.005, 0), moved(high, 0.013, 0.02, 0.011))
    ended = simulate(
        mesh, FABRIC, colliders=[Plane((0, 0, 0), (0, 1, 0), 0.3)], seconds=0.5, settings={"solver": solver}
    )
    assert not crosses(ended.positions, mesh.faces)
    above = ended.positions[len(low.vertices) :, 1].mean() - ended.positions[: len(low.vertices), 1].mean()
    assert 0.5 * thick < above < 1.5 * thick
    assert np.abs(ended.velocities).max() < 0.02


def test_sheets_that_collide_keep_their_momentum():
    mesh = stack(sheet(6, 6, 0.1, 0.1, upright=False), moved(sheet(6, 6, 0.1, 0.1, upright=False), 0.013, 0.004, 0.02))
    count = len(mesh.vertices) // 2
    from vto_pipeline.cloth.dynamics.stepper import StepConfig, Stepper
    from vto_pipeline.cloth.model.build import ClothState, build_cloth
    from vto_pipeline.model.garment import RestShape

    model = build_cloth(mesh, RestShape(mesh.vertices), FABRIC, gravity=(0.0, 0.0, 0.0))
    velocities = np.zeros((2 * count, 3))
    velocities[count:, 1] = -1.0
    stepper = Stepper(model, [], np.zeros(2 * count), StepConfig())
    ended = stepper.run(ClothState(mesh.vertices.copy(), velocities), 0.1)
    before, after = model.mass @ velocities, model.mass @ ended.velocities
    assert not crosses(ended.positions, mesh.faces)
    assert (model.mass[:count] @ ended.velocities[:count])[1] < 0.2 * before[1]  # some of it was handed over
    assert_allclose(after, before, rtol=0, atol=1e-9 * np.abs(before).max())  # solved to rounding for a free piece


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_cloth_slides_on_cloth_as_on_a_plane(friction):
    """Edges and corners of the cloth beneath do not catch what slides over them, by up to an edge a step."""
    slope, seconds = np.arctan(0.6), 0.2
    floor = sheet(31, 31, 0.5, 0.5, upright=False)
    patch = moved(sheet(7, 7, 0.1, 0.1, upright=False), 0.2033, 3e-4, 0.2217)
    level, count = stack(floor, patch), len(floor.vertices)
    axes = np.array([[np.cos(slope), -np.sin(slope), 0.0], [np.sin(slope), np.cos(slope), 0.0], [0.0, 0.0, 1.0]])
    tilted = TriangleMesh(level.vertices @ axes, level.faces)
    found = simulate(
        tilted,
        replace(FABRIC, friction=friction),
        pinned=np.arange(count),
        seconds=seconds,
        settings={"solver": "newton", "substeps": 1},
    )
    way = (found.positions - tilted.vertices)[count:].mean(axis=0) @ axes[0]
    fall = 0.5 * GRAVITY * seconds**2 * (1 + 1 / found.report["steps"])
    # measured off by 1e-4 in steps of 1/60 s; a hundred times that would be an edge that catches
    assert_allclose((np.sin(slope) - way / fall) / np.cos(slope), friction, rtol=0, atol=3e-4)
