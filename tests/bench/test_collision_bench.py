"""The scenes of the collision bench: clean starts, measures against closed forms, and a second judge of crossings."""

from dataclasses import replace

import ipctk
import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose

from vto_pipeline.bench.bench import Watch
from vto_pipeline.bench.collision import left_out, scenes
from vto_pipeline.bench.collision.contact_scene import ContactScene, contact_errors
from vto_pipeline.bench.collision.penetration import penetration
from vto_pipeline.bench.collision.sheets import folded_twice, funnel, square, stacked
from vto_pipeline.bench.plots.collision_plot import draw_collision
from vto_pipeline.cloth import Box, Capsule, MeshCollider, Moving, Path, Plane, Sphere, Trajectory
from vto_pipeline.cloth.collision.self_collision.counters import CollisionCounters
from vto_pipeline.errors import InputError
from vto_pipeline.geometry.topology import edges
from vto_pipeline.model.mesh import TriangleMesh

QUICK = [make() for make in scenes._scenes(True)]


def crosses(mesh):
    """The other judge."""
    return ipctk.has_intersections(
        ipctk.CollisionMesh(mesh.vertices, ipctk.edges(mesh.faces), mesh.faces), mesh.vertices
    )


@pytest.mark.parametrize("scene", QUICK, ids=lambda scene: scene.name)
def test_scenes_start_clean(scene):
    assert not crosses(scene.mesh)
    found = contact_errors(scene, Trajectory(scene.mesh.vertices, 0.0 * scene.rest, {}))
    assert found["crossings"] == 0
    assert found["kinetic_j"] == 0.0
    assert max(penetration(shape, scene.mesh, 0.0).deepest for shape in scene.colliders or [FAR]) == 0.0
    assert found["rms_stretch"] < 0.2  # a coarse fold's edges are chords of its turns
    if scene.pin_path is not None:
        assert_allclose(scene.pin_path(0.0), scene.mesh.vertices[list(scene.pinned)], rtol=0, atol=1e-12)


FAR = Sphere((9.0, 9.0, 9.0), 1.0)


@pytest.mark.parametrize("count", [16, 48])
def test_a_towel_folded_twice_is_not_stretched(count):
    start, flat, faces = folded_twice(count, 0.5, 0.25, 0.012)
    ends = edges(TriangleMesh(start, faces))
    chord, arc = (np.linalg.norm(x[ends[:, 1]] - x[ends[:, 0]], axis=1) for x in (start, flat))
    assert (chord < arc * (1.0 + 1e-6)).all()  # chords of straights and half circles
    assert (np.abs(chord / arc - 1.0) < 1e-6).mean() > 0.6
    assert_allclose(start[:, 1].min(), 0.006, rtol=1e-9)
    assert_allclose(start[:, 1].max(), 0.042, rtol=1e-6)
    assert np.ptp(start[:, 0]) < 0.3 * np.ptp(flat[:, 0])
    level = np.round(start[:, 1] / 0.006).astype(int)
    assert all((level == k).sum() > 0.1 * len(level) for k in (1, 3, 5, 7))  # four layers


def test_a_stack_keeps_its_gaps():
    points, faces = stacked(3, square(5, 0.2), 0.01)
    assert_allclose(np.unique(np.round(points[:, 1], 12)), [0.005, 0.015, 0.025])
    assert len(faces) == 3 * 32
    assert not crosses(TriangleMesh(points, faces))
    assert np.abs(points[25:50, [0, 2]] - points[:25, [0, 2]]).max() > 1e-3  # turned


def test_the_funnel_is_a_solid_with_a_hole():
    mesh = funnel()
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert solid.is_watertight
    assert solid.volume > 0.0  # outward
    assert solid.euler_number == 0  # a ring
    assert not crosses(mesh)


LEVEL = TriangleMesh(square(5, 0.2)[0], square(5, 0.2)[1])


@pytest.mark.parametrize(
    ("shape", "deepest", "vertices"),
    [
        (Plane((0.0, 0.03, 0.0), (0.0, 2.0, 0.0)), 0.03, 25),
        (Plane((0.0, -0.03, 0.0), (0.0, 1.0, 0.0)), 0.0, 0),
        (Sphere((0.0, 0.05, 0.0), 0.06), 0.01, 1),
        (Sphere((0.025, 0.05, 0.01), 0.06), 0.01, 2),  # between vertices, and no less deep
        (Capsule((-1.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.02), 0.02, 5),
        (Box((0.0, -0.01, 0.0), (0.06, 0.03, 0.06)), 0.02, 9),
        (MeshCollider(TriangleMesh(*[np.array(a) for a in (trimesh.creation.box((0.12,) * 3).vertices,
                                                            trimesh.creation.box((0.12,) * 3).faces)])), 0.06, 9),
        (Moving(Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0)), Path([0.0, 1.0], [[0, -1, 0], [0, 0.01, 0]])), 0.01, 25),
    ],
    ids=["under", "over", "ball", "ball between", "rod", "box", "mesh", "lifted floor"],
)  # fmt: skip
def test_depth_in_shapes(shape, deepest, vertices):
    found = penetration(shape, LEVEL, 1.0)
    assert_allclose(found.deepest, deepest, rtol=0, atol=1e-9)
    assert found.vertices == vertices


def test_a_shape_without_a_distance_is_refused():
    from vto_pipeline.cloth import Ellipsoid

    with pytest.raises(InputError, match="Ellipsoid"):
        penetration(Ellipsoid((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), LEVEL, 0.0)


def test_both_judges_see_what_crosses():
    points, faces = stacked(2, square(4, 0.2), 0.01)
    points[16:, 1] += 0.05 * points[16:, 0]
    scene = replace(scenes.pile(4), mesh=TriangleMesh(points, faces), rest=points)
    ended = Trajectory(points, np.full_like(points, 2.0), {})
    assert contact_errors(scene, ended)["crossings"] == 0
    points[16:, 1] -= 0.01
    found = contact_errors(scene, Trajectory(points, np.full_like(points, 2.0), {}))
    assert found["crossings"] > 0
    assert crosses(TriangleMesh(points, faces))
    mass = 2 * 0.2**2 * scene.fabric.areal_density
    assert_allclose(found["kinetic_j"], 0.5 * mass * 12.0, rtol=1e-3)  # the leaning square is a little larger
    assert_allclose(found["mean_height_m"], points[:, 1].mean(), rtol=0, atol=1e-4)
    assert found["rms_stretch"] == 0.0


def test_the_ball_stops_where_ten_layers_have_room():
    scene = scenes.ball_on_sheets(4)
    ball = scene.colliders[1]
    radius = ball.shape.radius
    assert ball.path.at(0.0).shift[1] - radius > scene.rest[:, 1].max() + 0.1
    low = ball.path.at(9.0).shift[1] - radius
    assert scenes.SHEETS * scene.fabric.thickness < low < scene.rest[:, 1].max()


def test_a_pile_ends_free_of_crossings():
    scene = scenes.pile(5, 0.2)
    ended = scene.run()
    found = contact_errors(scene, ended)
    assert found["crossings"] == 0
    assert not crosses(TriangleMesh(ended.positions, scene.mesh.faces))
    assert found["penetration_mm"] == 0.0
    assert found["mean_height_m"] < 0.9 * scene.rest[:, 1].mean()  # it came down
    assert contact_errors(scene, scene.run(self_collision=False))["crossings"] > 0  # the bench can tell


def test_left_out_compares_with_all_of_it(monkeypatch):
    """The difference is that of the farthest vertex; only of what is never looked at, proofs are told apart."""

    def run(self, **settings):
        shift = np.zeros_like(self.rest)
        shift[3] = [0.0, 3e-5, 4e-5] if settings.get("force_all") else [0.0, 0.0, 0.0]
        if self.name.startswith("hang"):
            counters = CollisionCounters(asked=8, out_of_reach=8)
        else:
            counters = CollisionCounters(asked=8, out_of_reach=3, searched=5, impacts=6, impacts_known=2)
        return Trajectory(self.rest + shift, 0.0 * self.rest, {"self_contact": counters.as_report()})

    monkeypatch.setattr(ContactScene, "run", run)
    rows = list(left_out.collision_left_out_rows(True, Watch()))
    assert len(rows) == 2
    for row in rows:
        assert_allclose(row.errors["difference_mm"], 0.05, rtol=1e-9)
        assert row.errors["saved_share"] < 1.0
    assert [row.errors["impacts_left_out_share"] for row in rows] == [0.0, 0.25]
    assert [row.errors["searches_left_out_share"] for row in rows] == [1.0, 0.375]
    assert ["proof_share" in row.errors for row in rows] == [True, False]


def plain(scene, method="ours", seconds=0.1, vertices=100, **errors):
    return {
        "scene": scene,
        "method": method,
        "settings": {},
        "vertices": vertices,
        "seconds": seconds,
        "errors": errors,
    }


def test_each_kind_of_rows_has_its_panel():
    kinds = [
        [plain("vertex-face", per_second=1e6, missed=0)],
        [plain("step", vertices=n, pairs=n, seconds=1e-6 * n) for n in (100, 1000)],
        [plain("sphere 32", crossings=0), plain("sphere 32", method="xpbd", crossings=3)],
        [plain("sleeve", pairs_left=0)],
        [plain("hang 64", saved_share=0.3, difference_mm=0.0)],
        [plain("incline 0.3", error_share=0.0, allowed_share=0.005)],
    ]
    whole = draw_collision({"bench": "collision", "rows": [row for kind in kinds for row in kind]})
    assert whole.startswith(b"\x89PNG")
    for kind in kinds:
        one = draw_collision({"bench": "collision", "rows": kind})
        assert one.startswith(b"\x89PNG")
        assert len(one) < len(whole)
    with pytest.raises(InputError, match="none with a figure"):
        draw_collision({"bench": "collision", "rows": [plain("hang", status="failed")]})
