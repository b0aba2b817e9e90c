"""Shapes as colliders: where they are, how they move, and that nothing goes through them."""

import numpy as np
import pytest
from cloth_scenes import ball, box, fabric, moved, sheet
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from vto_pipeline import cloth
from vto_pipeline.cloth.collision.body.contacts import BodyCollider
from vto_pipeline.cloth.collision.contacts import ContactSpan
from vto_pipeline.errors import InputError
from vto_pipeline.model.body import MovingBody

TURN = (0.3, -0.5, 0.2)
QUATERNION = tuple(Rotation.from_rotvec(TURN).as_quat())


def a_round(count, *, travel=10.0, skin=2e-3, move=None, seconds=1 / 60):
    return ContactSpan(0.0, seconds, travel, np.full(count, skin), 0.5, move)


def gaps(found, points):
    """Distance from each plane at the begin [m]."""
    return np.einsum("ij,ij->i", points - found.point[0, :, 0], found.normal[0, :, 0])


def body(mesh):
    return BodyCollider(MovingBody(mesh.vertices[None], mesh.faces), 0.0, 0.3)


@pytest.mark.parametrize("turn", [TURN, QUATERNION])
def test_box_and_ellipsoid_stand_where_they_are_put(turn):
    rng = np.random.default_rng(0)
    matrix = Rotation.from_rotvec(TURN).as_matrix()
    center, sizes = np.array([0.1, -0.2, 0.3]), np.array([0.3, 0.2, 0.1])
    local = rng.uniform(-0.4, 0.4, (200, 3))
    world = local @ matrix.T + center
    outside = (np.abs(local) > sizes).any(axis=1)
    found = cloth.Box(tuple(center), tuple(sizes), turn, 0.4).contacts(world, a_round(200))
    nearest = np.clip(local, -sizes, sizes)
    assert_allclose(gaps(found, world)[outside], np.linalg.norm(local - nearest, axis=1)[outside], atol=1e-12)
    assert_allclose(gaps(found, world)[~outside], (np.abs(local) - sizes).max(axis=1)[~outside], atol=1e-12)
    assert found.friction[0] == 0.4
    found = cloth.Ellipsoid(tuple(center), tuple(sizes), turn).contacts(world, a_round(200))
    on = (found.point[0, :, 0] - center) @ matrix
    assert_allclose(((on / sizes) ** 2).sum(axis=1), 1.0, rtol=1e-12)
    assert ((gaps(found, world) < 0) == (((local / sizes) ** 2).sum(axis=1) < 1)).all()


def test_impossible_shapes_and_paths_are_refused():
    for wrong in (
        lambda: cloth.Sphere((0, 0, 0), 0.0),
        lambda: cloth.Box((0, 0, 0), (0.1, -0.1, 0.1)),
        lambda: cloth.Ellipsoid((0, 0, 0), (0.1, np.nan, 0.1)),
        lambda: cloth.Path((0.0, 0.0), np.zeros((2, 3))),
        lambda: cloth.Path((0.0, 1.0), np.zeros((3, 3))),
        lambda: cloth.Path((0.0, 1.0), np.zeros((2, 3)), np.zeros((2, 4))),
        lambda: cloth.Path((0.0, 1.0), np.zeros((2, 3)), np.zeros((2, 2))),
    ):
        with pytest.raises(InputError):
            wrong()


def test_a_path_is_straight_with_an_even_turn_and_rests_at_its_ends():
    path = cloth.Path((1.0, 3.0), ((0, 0, 0), (0.2, 0, 0.4)), ((0, 0, 0), (0, np.pi / 2, 0)))
    middle = path.at(2.0)
    assert_allclose(middle.shift, [0.1, 0, 0.2], atol=1e-15)
    assert_allclose(middle.turn, Rotation.from_rotvec([0, np.pi / 4, 0]).as_matrix(), atol=1e-14)
    assert_allclose(path.at(0.0).turn, np.eye(3), atol=1e-15)
    assert_allclose(path.at(9.0).shift, [0.2, 0, 0.4], atol=1e-15)


SHAPES = {
    "sphere": cloth.Sphere((0.02, 0, 0), 0.1),
    "capsule": cloth.Capsule((-0.1, 0, 0), (0.1, 0.05, 0), 0.05),
    "ellipsoid": cloth.Ellipsoid((0, 0, 0), (0.15, 0.05, 0.1), TURN),
    "box": cloth.Box((0, 0, 0), (0.15, 0.05, 0.1), TURN),
    "plane": cloth.Plane((0, 0, 0), (0.2, 1, 0.1)),
    "mesh": body(box((0.3, 0.1, 0.2))),
}


@pytest.mark.parametrize("name", SHAPES)
def test_planes_ride_along_rigidly(name):
    shape = SHAPES[name]
    path = cloth.Path((0.0, 1 / 60), ((0, 0, 0), (0.01, 0.02, -0.01)), ((0, 0, 0), (0.02, 0.05, 0.1)))
    points = np.random.default_rng(1).uniform(-0.2, 0.2, (100, 3))
    last = path.at(1.0)
    along = last.world(points) - points  # cloth that moves with the shape: nothing comes at it
    found = cloth.Moving(shape, path).contacts(points, a_round(100, move=along))
    still = shape.contacts(points, a_round(100))
    assert found.active.all()
    assert_allclose(found.point[:, :, 0], still.point[:, :, 0], rtol=0, atol=1e-12)
    assert_allclose(found.normal[:, :, 0], still.normal[:, :, 0], rtol=0, atol=1e-9)
    assert_allclose(found.point[:, :, 1], last.world(still.point[:, :, 1]), rtol=0, atol=1e-12)
    assert_allclose(found.normal[:, :, 1], last.world_direction(still.normal[:, :, 1]), rtol=0, atol=1e-9)


THIN = {
    "plate": cloth.Box((0, 0, 0), (0.2, 1e-3, 0.2)),
    "turned plate": cloth.Box((0, 0, 0), (1e-3, 0.2, 0.2), (0, 0, np.pi / 2)),
    "marble": cloth.Sphere((0, 0, 0), 0.02),
    "needle": cloth.Capsule((-0.2, 0, 0), (0.2, 0, 0), 1e-3),
    "disc": cloth.Ellipsoid((0, 0, 0), (0.2, 1e-3, 0.2)),
    "mesh plate": body(box((0.4, 2e-3, 0.4))),
    "mesh marble": body(ball(0.02)),
}


@pytest.mark.parametrize("name", THIN)
@pytest.mark.parametrize("who", ["shape", "cloth"])
def test_nothing_passes_through_a_thin_shape_within_a_round(name, who):
    """At 8 m/s, 133 mm in a round: a vertex that obeys its plane ends on the side it came from."""
    rng = np.random.default_rng(2)
    over = 0.004 if name == "needle" else 0.05
    points = np.column_stack([rng.uniform(-0.1, 0.1, 300), rng.uniform(0.03, 0.1, 300), rng.uniform(-over, over, 300)])
    fall = np.array([0.01, -8.0 / 60, -0.008])
    if who == "shape":
        path = cloth.Path((0.0, 1 / 60), ((0, 0, 0), -fall))
        found = cloth.Moving(THIN[name], path).contacts(points, a_round(300, travel=5e-3))
        end = points + fall  # in the frame of the shape
        gap = np.einsum("ij,ij->i", points - found.point[0, :, 1], found.normal[0, :, 1])
    else:
        found = THIN[name].contacts(points, a_round(300, travel=5e-3, move=np.broadcast_to(fall, points.shape)))
        end = points + fall
        gap = np.einsum("ij,ij->i", end - found.point[0, :, 1], found.normal[0, :, 1])
    way = points[:, None] + np.linspace(0, 1, 400)[None, :, None] * (end - points)[:, None]
    shape = SHAPES_DISTANCE[name](way.reshape(-1, 3)).reshape(300, 400).min(axis=1)
    hits, misses = shape < -1e-4, shape > 4e-3
    assert hits.sum() > 15
    assert found.active[0, hits].all()
    assert (gap[hits] < 0.0).all()  # where it ends, the plane does not let it be
    normal = found.normal[0, hits, 0]
    assert (np.einsum("ij,j->i", normal, fall) < 0.0).all()  # pushed back, not on
    assert (gap[misses] > 0.0).all()  # what passes by is let pass
    if name not in ("plate", "turned plate", "mesh plate", "disc"):
        assert misses.sum() > 15


def plate(p):
    return np.abs(p[:, 1]) - 1e-3 + np.maximum(np.abs(p[:, [0, 2]]).max(axis=1) - 0.2, 0.0)


SHAPES_DISTANCE = {
    "plate": plate,
    "turned plate": plate,
    "mesh plate": plate,
    "mesh marble": lambda p: np.linalg.norm(p, axis=1) - 0.02,
    "marble": lambda p: np.linalg.norm(p, axis=1) - 0.02,
    "needle": lambda p: np.linalg.norm(p - np.clip(p, [-0.2, 0, 0], [0.2, 0, 0]), axis=1) - 1e-3,
    "disc": lambda p: (np.sqrt(((p / [0.2, 1e-3, 0.2]) ** 2).sum(axis=1)) - 1) * 1e-3,
}


def table(kind, speed, way, seconds):
    """A cloth on a table 20 mm thick, held 50 mm beyond its edge by a row of vertices, and the table pulled away."""
    mesh = moved(sheet(13, 9, 0.6, 0.4, upright=False), -0.3, 0.003, -0.2)
    half, center = np.array([0.4, 0.01, 0.3]), np.array([-0.15, -0.01, 0.0])
    top = cloth.Box((0, 0, 0), tuple(half)) if kind == "box" else cloth.MeshCollider(box(2 * half))
    end = center + speed * seconds * np.array(way)
    found = cloth.simulate(
        mesh,
        fabric(bending=1e-5),
        pinned=tuple(np.flatnonzero(mesh.vertices[:, 0] > 0.299)),
        colliders=[cloth.Moving(top, cloth.Path((0.0, seconds), (center, end)))],
        seconds=seconds,
        settings={"skin_mm": 2.0},
    )
    return found.positions - end, half


@pytest.mark.parametrize("kind", ["box", "mesh"])
@pytest.mark.parametrize("speed", [1.0, 2.0, 4.0, 8.0])
def test_a_table_cloth_pulled_over_the_edge_is_never_on_the_wrong_side(kind, speed):
    for way, length in (((-1, 0, 0), 0.4), ((0, 1, 0), 0.2), ((-0.7, 0.7, 0), 0.3)):
        local, half = table(kind, speed, way, length / speed)
        # what was over the last 50 mm, one edge of the cloth, may have slipped around the rim and swing under it
        over = (np.abs(local[:, [0, 2]]) < half[[0, 2]] - 0.05).all(axis=1)
        assert (local[over, 1] >= half[1] - 1e-6).all()
        assert not (np.abs(local) < half - 1e-6).all(axis=1).any()  # and nothing is in it
        assert np.isfinite(local).all()
        assert over.any() or way == (-1, 0, 0)


def test_a_marble_shot_through_a_hanging_sheet_takes_it_along():
    mesh = moved(sheet(13, 13, 0.3, 0.3), -0.15, 0.15, 0.0)
    path = cloth.Path((0.0, 0.05), ((0.004, 0.006, -0.15), (0.004, 0.006, 0.25)))  # 8 m/s
    found = cloth.simulate(
        mesh,
        fabric(),
        colliders=[cloth.Moving(cloth.Sphere((0, 0, 0), 0.03), path)],
        seconds=0.05,
        settings={"gravity": (0, 0, 0)},
    )
    middle = np.linalg.norm(mesh.vertices[:, :2], axis=1) < 0.03
    assert middle.sum() >= 4
    assert (found.positions[middle, 2] > 0.25).all()  # before the marble, not behind it
    assert np.linalg.norm(found.positions - [0.004, 0.006, 0.25], axis=1).min() > 0.03


@pytest.mark.parametrize("kind", ["box", "mesh", "keyframes"])
def test_a_moving_table_takes_cloth_along_by_friction(kind):
    mesh = moved(sheet(6, 6, 0.1, 0.1, upright=False), -0.05, 0.002, -0.05)
    half, center, seconds = np.array([0.2, 0.05, 0.2]), np.array([0.0, -0.05, 0.0]), 0.5
    block = box(2 * half)
    end = np.array([0.1, -0.05, 0.0])
    if kind == "keyframes":
        frames = np.stack([block.vertices + center, block.vertices + end])
        top = cloth.MeshCollider(MovingBody(frames, block.faces), 0.6, seconds)
    else:
        shape = cloth.Box((0, 0, 0), tuple(half), friction=0.6) if kind == "box" else cloth.MeshCollider(block, 0.6)
        top = cloth.Moving(shape, cloth.Path((0.0, seconds), (center, end)))
    found = cloth.simulate(mesh, fabric(), colliders=[top], seconds=seconds, settings={"skin_mm": 2.0})
    # from rest at μ g it is up to speed after v²/2μg = 3.4 mm of slip
    slip = 0.2**2 / (2 * 0.6 * 9.80665)
    assert_allclose(
        found.positions - mesh.vertices, np.broadcast_to([0.1 - slip, 0, 0], mesh.vertices.shape), atol=2e-3
    )


def test_a_turning_ball_of_triangles_keeps_its_tree():
    shape = body(ball(0.1))
    path = cloth.Path((0.0, 1.0), np.zeros((2, 3)), ((0, 0, 0), (0, 2.0, 0)))
    tree = shape._surface.searched.tree
    before = [np.array(part, copy=True) for part in tree if isinstance(part, np.ndarray)]
    points = np.random.default_rng(3).normal(size=(50, 3)) * 0.1
    for k in range(5):
        cloth.Moving(shape, path).contacts(points, a_round(50)._replace(start=0.2 * k, end=0.2 * k + 0.2))
    assert shape._surface.searched.tree is tree
    for one, other in zip(before, [part for part in tree if isinstance(part, np.ndarray)], strict=True):
        assert (one == other).all()
