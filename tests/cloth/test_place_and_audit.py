"""The growing body, the judge, and the last pass."""

import json
import time
from itertools import combinations

import numpy as np
import pytest
from cloth_scenes import ball, box, fabric, moved, sheet, tube
from numpy.testing import assert_allclose
from scipy.optimize import minimize

from vto_pipeline import cloth
from vto_pipeline.cloth.collision.body.contacts import BodyCollider
from vto_pipeline.cloth.constraints.sweep import add_forces
from vto_pipeline.cloth.dynamics.residual import elastic_energy
from vto_pipeline.cloth.dynamics.stepper import StepConfig, Stepper
from vto_pipeline.cloth.judge.audit import audit
from vto_pipeline.cloth.judge.gap import gaps_within
from vto_pipeline.cloth.judge.residual import ElasticEnergies, covers_all_energies
from vto_pipeline.cloth.judge.too_small import warn_if_too_small
from vto_pipeline.cloth.model.build import at_rest, build_cloth
from vto_pipeline.cloth.model.materials import Materials
from vto_pipeline.cloth.placement.body_growth import plan_body_growth
from vto_pipeline.cloth.placement.clear_body import clear_body_crossings
from vto_pipeline.cloth.rest_shape.from_hanging import RestShapeConfig, rest_shape
from vto_pipeline.geometry.intersections import intersecting_faces
from vto_pipeline.geometry.topology import edges
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh


def skittle():
    """A closed body with a waist at y = 0.6 and a foot at y = 0."""
    mesh = ball(1.0, levels=4)
    x, y, z = mesh.vertices.T
    girth = 0.15 - 0.09 * np.exp(-(((y - 0.2) / 0.25) ** 2))
    return TriangleMesh(np.column_stack([girth * x, 0.5 + 0.5 * y, girth * z]), mesh.faces)


def test_the_body_grows_from_where_it_no_longer_crosses():
    collar = tube(0.1, 0.3, 48, 24, base=0.35)  # cuts the skittle below its waist, where it is up to 0.15 m
    body = skittle()
    growth = plan_body_growth(body, collar, Job())
    motion = growth.body
    assert len(intersecting_faces(collar, body)) > 0
    assert len(intersecting_faces(growth.garment, TriangleMesh(motion.keyframes[0], body.faces))) == 0
    assert_allclose(motion.keyframes[-1], body.vertices, rtol=0, atol=0)
    radius = np.linalg.norm(motion.keyframes[:, :, [0, 2]], axis=2).mean(axis=1)
    assert (np.diff(radius) > 0).all()


def test_a_garment_through_the_heart_of_the_body_is_warned_of():
    job = Job()
    through = moved(sheet(40, 40, 0.6, 0.6, upright=False), -0.3, 0.5, -0.3)
    plan_body_growth(skittle(), through, job)
    assert "does not surround the body" in job.warnings[0]


def test_a_sliver_tells_no_strain():
    """Its height is a millionth of its length; all else is 5% longer than at rest."""
    rest = np.array([[0.0, 0, 0], [0.02, 0, 0], [0.01, 0.02, 0], [0.01, -1e-8, 0]])
    faces = np.array([[0, 1, 2], [0, 3, 1]], np.int32)
    draped = 1.05 * rest
    draped[3] += [0.0, -1e-3, 0.0]
    found = audit(TriangleMesh(draped, faces), RestShape(rest), None, settled=True, energy=0.0, residual=0.0)
    assert_allclose([found["largest_strain"], found["least_strain"]], 0.05, rtol=1e-9)
    job = Job()
    assert warn_if_too_small(TriangleMesh(draped, faces), RestShape(rest), 0.04, job)["too_small"]
    assert "by up to 5% near" in job.warnings[0]


def test_the_judge_sees_what_was_done_to_the_cloth():
    body = box((0.4, 0.1, 0.4))
    rest = sheet(9, 9, 0.2, 0.2, upright=False)
    mesh = TriangleMesh((rest.vertices - [0.1, 0, 0.1]) * [1.1, 1, 1] + [0, 0.04, 0], rest.faces)
    found = audit(mesh, RestShape(rest.vertices), body, settled=False, energy=1.5, residual=0.25)
    assert found["finite"] is True
    assert found["settled"] is False
    assert_allclose(found["penetration_mm"], 10.0, rtol=1e-9)  # 10 mm under the top of the box
    assert_allclose(found["min_clearance_mm"], -10.0, rtol=1e-9)
    assert_allclose(found["max_stretch"], 0.1, rtol=1e-9)
    assert_allclose(found["area_change"], 0.1, rtol=1e-9)
    assert found["body_intersections"] == 0  # wholly inside: no triangles cross
    assert found["self_intersections"] == 0
    lifted = moved(mesh, 0.25, 0, 0)  # now through the side
    assert audit(lifted, RestShape(rest.vertices), body, settled=True, energy=0, residual=0)["body_intersections"] > 0


def test_the_judge_counts_self_intersections():
    one = sheet(5, 5, 0.2, 0.2, upright=False)
    other = moved(sheet(5, 5, 0.2, 0.2), 0.013, 0.1, 0.11)
    both = TriangleMesh(np.vstack([one.vertices, other.vertices]), np.vstack([one.faces, other.faces + 25]))
    found = audit(both, RestShape(both.vertices), None, settled=True, energy=0.0, residual=0.0)
    assert found["self_intersections"] >= 4
    assert found["min_clearance_mm"] is None


def judged(mesh, rest=None, body=None, **more):
    """The findings, which must survive as JSON."""
    at_rest_ = RestShape(mesh.vertices if rest is None else rest)
    found = audit(mesh, at_rest_, body, settled=True, energy=0.0, residual=0.0, **more)
    return json.loads(json.dumps(found))


def crumpled(seed=0):
    """A sheet with warp across its grid, stretched, sheared and bent at random."""
    rest = sheet(9, 12, 0.2, 0.3)
    bent = rest.vertices * [1.05, 0.98, 1.0] + np.sin(rest.vertices[:, [1, 0, 1]] * [9, 7, 12]) * 0.02
    return rest, bent + np.random.default_rng(seed).normal(size=bent.shape) * 1e-3


def test_the_judge_says_where_triangles_cross():
    block, mesh = box((0.4, 0.1, 0.4)), moved(sheet(9, 9, 0.2, 0.2, upright=False), 0.1, 0.03, -0.1)
    found = judged(mesh, body=block)
    places = np.array(found["body_intersection_places"])
    assert 0 < len(places) <= 10
    assert_allclose(places[:, 0], 0.2, rtol=0, atol=0.025)  # through the side at x = 0.2, to a triangle's length
    assert found["penetrating_vertices"] == int((mesh.vertices[:, 0] < 0.2 - 1e-12).sum())
    other = moved(sheet(5, 5, 0.2, 0.2), 0.113, 0.1, 0.01)
    both = TriangleMesh(np.vstack([mesh.vertices, other.vertices]), np.vstack([mesh.faces, other.faces + 81]))
    found = judged(both)
    assert found["self_intersections"] > 0
    assert found["min_self_gap_mm"] == 0.0
    assert_allclose(np.array(found["self_intersection_places"])[:, 2], 0.01, rtol=0, atol=0.03)


def test_the_judge_tells_warp_weft_and_shear():
    rest = sheet(7, 7, 0.2, 0.2)  # warp is y, weft is x
    pulled = TriangleMesh(rest.vertices * [1.02, 1.05, 1.0], rest.faces)
    found = judged(pulled, rest.vertices)
    for name, wanted in (("warp_strain", 0.05), ("weft_strain", 0.02), ("shear_rad", 0.0)):
        assert_allclose(found[f"max_{name}"], wanted, rtol=0, atol=1e-12)
        assert_allclose(found[f"rms_{name}"], wanted, rtol=0, atol=1e-12)
    assert_allclose([found["largest_strain"], found["least_strain"]], [0.05, 0.02], rtol=0, atol=1e-12)
    sheared = rest.vertices.copy()
    sheared[:, 0] += 0.1 * sheared[:, 1]
    found = judged(TriangleMesh(sheared, rest.faces), rest.vertices)
    assert_allclose(found["max_shear_rad"], np.arctan(0.1), rtol=1e-9)
    principal = np.sqrt(np.linalg.eigvalsh(np.array([[1.0, 0.1], [0.1, 1.01]]))) - 1  # of FᵀF
    assert_allclose([found["least_strain"], found["largest_strain"]], principal, rtol=1e-9)


def test_the_judge_finds_one_overstretched_triangle():
    rest = sheet(9, 9, 0.2, 0.2)
    x = rest.vertices.copy()
    x[40] += [0.0, 0.01, 0.0]  # 40 % of an edge
    found = judged(TriangleMesh(x, rest.faces), rest.vertices)
    assert_allclose(found["max_warp_strain"], 0.4, rtol=1e-9)
    assert found["rms_warp_strain"] < 0.1


@pytest.mark.parametrize("distance", [0.5e-3, 2e-3, 4.9e-3])
def test_the_judge_measures_the_gap_between_layers(distance):
    one = sheet(9, 9, 0.2, 0.2, upright=False)
    other = moved(one, 0.013, distance, 0.007)
    both = TriangleMesh(np.vstack([one.vertices, other.vertices]), np.vstack([one.faces, other.faces + 81]))
    apart = np.vstack([one.vertices, moved(other, 0, 0.1, 0).vertices])
    assert_allclose(judged(both, apart)["min_self_gap_mm"], 1e3 * distance, rtol=1e-9)
    assert judged(TriangleMesh(apart, both.faces))["min_self_gap_mm"] is None
    assert judged(one)["min_self_gap_mm"] is None


def test_gaps_are_those_of_brute_force():
    rng, within = np.random.default_rng(0), 0.008
    x = rng.uniform(0, 0.02, (8, 1, 3)) + rng.uniform(0, 0.008, (8, 3, 3))
    x = x.reshape(-1, 3)
    faces = np.arange(24).reshape(-1, 3)
    pairs, gaps = gaps_within(x, 10.0 * x, faces, within)
    corner = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]])
    known = {tuple(pair): gap for pair, gap in zip(np.sort(pairs, axis=1).tolist(), gaps, strict=True)}
    checked = 0
    for i, j in combinations(range(8), 2):

        def apart(w, i=i, j=j):  # two points by barycentric weights
            p, q = (w[:3] @ x[faces[i]], w[3:] @ x[faces[j]])
            return 1e4 * np.sum((p - q) ** 2)

        sums = [{"type": "eq", "fun": lambda w, s=s: w[s : s + 3].sum() - 1} for s in (0, 3)]
        starts = [np.concatenate([a, b]) for a in corner for b in corner]
        least = min(
            minimize(apart, s, bounds=[(0, 1)] * 6, constraints=sums, method="SLSQP", tol=1e-12).fun for s in starts
        )
        if least > 1e-6:  # triangles that cross have no gap; that is counted elsewhere
            distance = np.sqrt(least / 1e4)
            assert ((i, j) in known) == (distance < within)
            if (i, j) in known:
                assert_allclose(known[i, j], distance, rtol=1e-3, atol=1e-7)
                checked += 1
    assert 5 < checked < 25


@pytest.mark.parametrize("bending", ["shape_operator", "hinge"])
@pytest.mark.parametrize("rigidity", [1e-4, 1e2])  # stretch rules, bending rules
def test_energy_and_forces_of_judge_and_solver_agree(bending, rigidity):
    rest, x = crumpled()
    weave = fabric(stretch=1500, weft=900, shear=60, poisson=0.2, bending=rigidity)
    model = build_cloth(rest, RestShape(rest.vertices), weave, materials=Materials(bending=bending))
    mine = ElasticEnergies(rest, RestShape(rest.vertices), weave, bending)
    wanted = np.zeros_like(x)
    add_forces(x, model.constraints, wanted)
    assert_allclose(mine.energy(x), elastic_energy(model, x), rtol=1e-9)
    assert_allclose(mine.forces(x), wanted, rtol=0, atol=1e-6 * np.abs(wanted).max())  # central differences
    assert_allclose(mine.mass, model.mass, rtol=1e-12)
    assert mine.energy(x) > 1e-3


def test_the_judge_knows_what_it_does_not_know():
    assert covers_all_energies(Materials())
    for other in ({"membrane": "green"}, {"bending": "isometric"}, {"strain_limit": 0.1}, {"hysteresis": True}):
        assert not covers_all_energies(Materials(**other))


def test_the_judge_sees_balance_and_the_want_of_it():
    mesh = sheet(7, 13, 0.1, 0.3)
    weave = fabric(stretch=60.0, shear=60.0)
    top = tuple(range(7))
    found = cloth.simulate(
        mesh, weave, pinned=top, seconds=20.0, settings={"until": "rest", "target_error_mm": 4.0, "damping": 8.0}
    )
    hung = TriangleMesh(found.positions, mesh.faces)
    calm = judged(hung, mesh.vertices, fabric=weave, pinned=top)
    assert_allclose(calm["judged_residual"], found.report["residual"], rtol=1e-3)  # differences of rounded energies
    assert calm["judged_residual"] < 0.1
    assert_allclose(calm["judged_energy_j"], found.report["energy_j"], rtol=1e-9)
    x = hung.vertices.copy()
    x[45] += [0.002, 0, 0]
    assert judged(TriangleMesh(x, mesh.faces), mesh.vertices, fabric=weave, pinned=top)["judged_residual"] > 0.5
    assert judged(hung, mesh.vertices, fabric=weave)["judged_residual"] > 1.0  # the pins bear all of it
    assert calm["judged_residual_left_out"] == len(top)
    assert judged(hung, mesh.vertices, fabric=weave)["judged_residual_left_out"] == 0


def test_the_judge_says_how_many_vertices_it_leaves_out():
    """What other cloth may bear is not judged, here where two layers 0.5 mm apart overlap; nor are loose points."""
    one = sheet(9, 9, 0.2, 0.2, upright=False)
    high = moved(one, 0.1 + 1e-4, 5e-4, 0.0)  # half of it covers half of the other
    loose = [[1.0, 1.0, 1.0]]
    both = TriangleMesh(np.vstack([one.vertices, high.vertices, loose]), np.vstack([one.faces, high.faces + 81]))
    apart = np.vstack([one.vertices, moved(high, 0, 0.1, 0).vertices, loose])
    covered = np.sum(one.vertices[:, 0] > 0.1 - 0.025 - 1e-9) + np.sum(high.vertices[:, 0] < 0.2 + 0.026)
    found = judged(both, apart, fabric=fabric(), skin=1e-3)
    assert found["judged_residual_left_out"] == covered + 1
    assert judged(TriangleMesh(apart, both.faces), apart, fabric=fabric(), skin=1e-3)["judged_residual_left_out"] == 1


@pytest.mark.parametrize(("friction", "bears"), [(0.6, True), (0.3, False)])
def test_a_body_bears_what_lies_on_it_within_the_cone_of_friction(friction, bears):
    tilt = np.arctan(0.5)
    turn = np.array([[np.cos(tilt), -np.sin(tilt), 0], [np.sin(tilt), np.cos(tilt), 0], [0, 0, 1]])
    block = box((0.4, 0.1, 0.4))
    block = TriangleMesh(block.vertices @ turn.T, block.faces)
    mesh = moved(sheet(7, 7, 0.2, 0.2, upright=False), -0.1, 0.052, -0.1)
    lying = TriangleMesh(mesh.vertices @ turn.T, mesh.faces)
    found = judged(lying, mesh.vertices, block, fabric=fabric(), friction=friction)
    wanted = 0.0 if bears else np.sin(tilt) - friction * np.cos(tilt)
    assert_allclose(found["judged_residual"], wanted, rtol=0, atol=1e-6)
    lifted = moved(lying, 0, 0.02, 0)
    found = judged(lifted, mesh.vertices, block, fabric=fabric(), friction=friction)
    assert_allclose(found["judged_residual"], 1.0, rtol=0, atol=1e-6)  # 20 mm above it, nothing bears


@pytest.mark.slow
def test_the_judge_is_quick():
    mesh, form = tube(0.12, 0.6, 80, 64, base=0.2), skittle()
    weave, rest = fabric(bending=1e-5), RestShape(mesh.vertices)
    assert len(mesh.faces) > 10000
    took = []
    for _ in range(3):
        began = time.perf_counter()
        audit(mesh, rest, form, settled=True, energy=0.0, residual=0.0, fabric=weave)
        took.append(time.perf_counter() - began)
    assert min(took) < 1.0


def test_a_spike_between_the_vertices_is_cleared():
    block = box((0.4, 0.1, 0.4))
    vertices = block.vertices.copy()
    vertices[np.linalg.norm(vertices - [0, 0.05, 0], axis=1).argmin(), 1] += 0.02
    spiked = TriangleMesh(vertices, block.faces)
    mesh = sheet(4, 4, 0.15, 0.15, upright=False)
    mesh = moved(mesh, -0.075, 0.055, -0.075)
    model = build_cloth(mesh, RestShape(mesh.vertices), fabric())
    body = MovingBody(spiked.vertices[None], spiked.faces)
    stepper = Stepper(model, [BodyCollider(body, 0.0, 0.3)], np.full(16, 1e-3), StepConfig(), damping=5.0)
    state = stepper.run(at_rest(mesh.vertices), 0.2)
    assert len(intersecting_faces(TriangleMesh(state.positions, mesh.faces), spiked)) > 0
    state, pairs = clear_body_crossings(stepper, state, mesh.vertices, mesh.faces, spiked, 40)
    assert len(pairs) == 0
    assert len(intersecting_faces(TriangleMesh(state.positions, mesh.faces), spiked)) == 0
    assert 1e-3 < stepper.skin.max() < 0.03


def test_a_steep_bump_is_cleared_without_stretching_the_cloth_over_it():
    """Rough cloth has its vertices on the flanks of a cone, its top in a triangle: as it is lifted it must slide."""
    ground = moved(sheet(61, 61, 0.3, 0.3, upright=False), -0.15, 0.0, -0.15)
    x, _, z = ground.vertices.T
    cone = 0.03 * np.maximum(0.0, 1.0 - np.hypot(x - 0.005, z - 0.003) / 0.02)
    ground = TriangleMesh(ground.vertices + np.column_stack([0 * x, cone, 0 * x]), ground.faces)
    mesh = moved(sheet(7, 7, 0.09, 0.09, upright=False), -0.045, 0.034, -0.045)
    model = build_cloth(mesh, RestShape(mesh.vertices), fabric(stretch=100.0, shear=30.0, friction=0.8))
    body = BodyCollider(MovingBody(ground.vertices[None], ground.faces), 0.0, 0.8)
    stepper = Stepper(model, [body], np.full(49, 1e-3), StepConfig(), damping=5.0)
    state = stepper.run(at_rest(mesh.vertices), 0.5)
    assert len(intersecting_faces(TriangleMesh(state.positions, mesh.faces), ground)) > 0
    state, pairs = clear_body_crossings(stepper, state, mesh.vertices, mesh.faces, ground, 40)
    assert len(pairs) == 0
    ends = edges(mesh)
    was, now = (np.linalg.norm(at[ends[:, 1]] - at[ends[:, 0]], axis=1) for at in (mesh.vertices, state.positions))
    assert (now / was - 1.0).max() < 0.02
    assert not stepper.loose.any()


def test_what_a_thicker_skin_only_stretches_is_left_as_it_was():
    """Each round makes the sheet through a ball a half longer."""
    mesh = sheet(12, 12, 0.4, 0.4)
    mesh = TriangleMesh(mesh.vertices - mesh.vertices.mean(axis=0), mesh.faces)

    class Stretcher:
        skin, loose, contact_memory = np.full(144, 1e-3), np.zeros(144, np.bool_), "before"

        def run(self, state, seconds):
            self.contact_memory = "after"
            return at_rest(1.5 * state.positions)

    stepper, state = Stretcher(), at_rest(mesh.vertices)
    found, pairs = clear_body_crossings(stepper, state, mesh.vertices, mesh.faces, ball(0.1, levels=2), 30)
    assert found is state
    assert len(pairs) > 0
    assert (stepper.skin == 1e-3).all()
    assert stepper.contact_memory == "before"
    assert not stepper.loose.any()


def test_rest_shape_as_scanned():
    mesh, job = sheet(3, 3, 1, 1), Job()
    found = rest_shape(mesh, RestShapeConfig(), job)
    assert found.mode == "as_scanned"
    assert_allclose(found.positions, mesh.vertices, rtol=0, atol=0)
    assert "as scanned" in job.notes[0]


@pytest.mark.parametrize("bending", ["shape_operator", "hinge"])
def test_a_triangle_of_no_size_is_no_cloth(bending):
    rest, x = crumpled()
    weave = fabric(stretch=1500, weft=900, shear=60, poisson=0.2, bending=1e-3)
    corner, count = 1e-10 * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.9, 0.0]]), len(x)
    faces = np.vstack([rest.faces, count + np.arange(3), [count, count + 2, rest.faces[0, 0]]]).astype(np.int32)
    more = TriangleMesh(np.vstack([rest.vertices, rest.vertices[rest.faces[0, 0]] + corner]), faces)
    found = ElasticEnergies(more, RestShape(more.vertices), weave, bending)
    without = ElasticEnergies(rest, RestShape(rest.vertices), weave, bending)
    assert_allclose(found.energy(np.vstack([x, x[rest.faces[0, 0]] + corner])), without.energy(x), rtol=1e-12)
