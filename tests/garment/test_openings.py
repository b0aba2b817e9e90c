"""Openings kept, scan holes filled, on tubes round a cylinder and on the dressed form."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.openings import OpeningsConfig, close_scan_holes, list_openings
from vto_pipeline.garment.rims import drop_flaps, smooth_curve, trim_ledges
from vto_pipeline.garment.simulation_mesh import SimulationMeshConfig, reason_to_skip_remeshing, remesh_for_simulation
from vto_pipeline.garment.subtraction.subtract import SubtractConfig, extract_garment, label_garment
from vto_pipeline.geometry.remeshing.repair import is_manifold
from vto_pipeline.geometry.remeshing.rims import perimeter
from vto_pipeline.geometry.rigid import transform_mesh
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_loops, face_components, submesh
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

RADIUS, HEIGHT = 0.1, 0.4


def sleeve(radius=RADIUS, height=HEIGHT, around=120, along=80, ragged=0.0, seed=0):
    """A tube about +Y from y = 0 to its height."""
    turn = np.linspace(0, 2 * np.pi, around, endpoint=False)[:, None]
    up = np.linspace(0, height, along)[None, :]
    rim = np.zeros((around, along))
    rim[:, [0, -1]] = np.random.default_rng(seed).normal(0, ragged, (around, 2))
    flat = 0.0 * (turn + up)
    vertices = np.stack([radius * np.sin(turn) + flat, up + rim + flat, radius * np.cos(turn) + flat], -1)
    at = np.arange(around * along).reshape(around, along)
    beside = np.roll(at, -1, axis=0)
    a, b, c, d = at[:, :-1].ravel(), beside[:, :-1].ravel(), beside[:, 1:].ravel(), at[:, 1:].ravel()
    return TriangleMesh(vertices.reshape(-1, 3), np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])]))


def arm(radius=0.08, low=-0.2, high=0.6):
    """A closed cylinder about +Y."""
    side = sleeve(radius, high - low, 60, 60)
    vertices = np.vstack([side.vertices + np.array([0, low, 0]), [[0, low, 0], [0, high, 0]]])
    last = len(side.vertices)
    ends = [np.column_stack([np.roll(loop, -1), loop, np.full(60, 0)]) for loop in boundary_loops(side)]
    for cap in ends:
        cap[:, 2] = last + (side.vertices[cap[0, 0], 1] > 0.1)
    return TriangleMesh(vertices, np.vstack([side.faces, *ends]))


def punched(mesh, spots, radius):
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    near = np.any([np.linalg.norm(middle - spot, axis=1) < radius for spot in spots], axis=0)
    return submesh(mesh, ~near)[0]


SPOTS = ([0.1, 0.2, 0.0], [-0.1, 0.1, 0.0], [0.0, 0.3, 0.1])


@pytest.mark.parametrize("radius", [0.01, 0.03, 0.055])
@pytest.mark.parametrize("form", [True, False], ids=["on form", "alone"])
def test_holes_are_filled_and_the_two_ends_stay(radius, form):
    """The largest hole is more than half as wide as the tube itself."""
    job = Job()
    torn = punched(sleeve(), SPOTS[:2] if radius > 0.04 else SPOTS, radius)
    closed, openings, observed = close_scan_holes(torn, arm() if form else None, OpeningsConfig(), job)
    assert [round(o.center[1], 2) for o in openings] == [HEIGHT, 0.0]  # highest first
    assert_allclose([o.normal for o in openings], [[0, 1, 0], [0, -1, 0]], atol=0.02)
    assert_allclose([o.perimeter for o in openings], 2 * np.pi * RADIUS, rtol=0.01)
    assert len(boundary_loops(closed)) == 2
    assert is_manifold(closed)
    assert face_components(closed)[0] == 1
    filling = closed.vertices[~observed]
    assert len(filling) > 0
    assert_allclose(np.hypot(filling[:, 0], filling[:, 2]), RADIUS, atol=0.001 if radius < 0.05 else 0.012)
    assert bool(job.warnings) != form  # without the form it is a guess, and said so


def half_seen():
    """A tube with four windows, and which share of the whole tube is left of it."""
    torn = punched(sleeve(), [[0.1, 0.12, 0], [-0.1, 0.12, 0], [0, 0.28, 0.1], [0, 0.28, -0.1]], 0.07)
    a, b, c = torn.vertices[torn.faces].transpose(1, 0, 2)
    return torn, np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / (4 * np.pi * RADIUS * HEIGHT)


def test_a_garment_that_was_hardly_seen_is_refused():
    torn, share = half_seen()
    assert 0.6 < share < 0.79
    with pytest.raises(GarmentError, match=r"only 7\d\.\d % of the garment was seen") as refused:
        close_scan_holes(torn, arm(), OpeningsConfig(), Job())
    assert_allclose(float(str(refused.value).split()[2]), 100 * share, atol=1)
    assert refused.value.exit_code == 4
    assert "openings.least_seen" in refused.value.hint


@pytest.mark.parametrize("given", [{"keep": 2}, {"least_seen": 0.5}])
def test_who_answers_for_it_gets_the_garment_that_was_hardly_seen(given):
    torn, share = half_seen()
    job = Job()
    _, openings, _ = close_scan_holes(torn, arm(), OpeningsConfig(**given), job)
    assert len(openings) == 2
    assert_allclose(1 - job.metrics["unobserved_share"], share, atol=0.01)
    assert any("of the garment was seen" in text for text in job.warnings) == ("keep" in given)


def test_a_hole_as_big_as_a_cuff_is_no_cuff():
    cuff = sleeve(0.045, 0.25, 90, 70)
    torso_hole = punched(sleeve(0.16, 0.5, 200, 110), [[0.16, 0.25, 0.0]], 0.045)
    closed, openings, _ = close_scan_holes(torso_hole, arm(0.13, -0.2, 0.8), OpeningsConfig(), Job())
    assert len(openings) == 2
    kept, openings, _ = close_scan_holes(cuff, arm(0.03), OpeningsConfig(), Job())
    assert len(openings) == 2
    assert len(kept.faces) <= len(cuff.faces)
    assert len(closed.faces) > len(torso_hole.faces)


def test_a_sleeve_longer_than_the_arm_is_still_open():
    _, openings, _ = close_scan_holes(sleeve(), arm(high=0.37), OpeningsConfig(), Job())
    assert len(openings) == 2


@pytest.mark.parametrize(("keep", "heights"), [(1, [HEIGHT]), (2, [HEIGHT, 0.0]), (3, [HEIGHT, 0.2, 0.0])])
def test_as_many_openings_stay_as_are_asked_for(keep, heights):
    """Evidence first: the two ends; then the longest of the others, here the larger of two holes in the side."""
    larger, smaller = punched(sleeve(), [[0.1, 0.2, 0.0]], 0.04), [[-0.1, 0.3, 0.0]]
    torn = punched(larger, smaller, 0.015)
    job = Job()
    _, openings, _ = close_scan_holes(torn, arm(), OpeningsConfig(keep=keep, least_perimeter_mm=0), job)
    assert_allclose([o.center[1] for o in openings], heights, rtol=0, atol=0.01)
    assert any("against the evidence" in note for note in job.notes) == (keep != 2)


def test_more_openings_than_there_are_loops_cannot_be_kept():
    with pytest.raises(GarmentError, match="only 2 boundary loops"):
        close_scan_holes(sleeve(), arm(), OpeningsConfig(keep=3), Job())


def test_another_count_than_expected_is_an_error_that_lists_them():
    with pytest.raises(GarmentError, match="2 openings found, expected 4: opening of 628 mm"):
        close_scan_holes(sleeve(), arm(), OpeningsConfig(expected=4, fair_mm=0), Job())


def test_a_ragged_rim_becomes_as_long_as_it_should_be():
    ragged = sleeve(ragged=0.002)
    before = max(perimeter(ragged, loop) for loop in boundary_loops(ragged))
    assert before > 1.1 * 2 * np.pi * RADIUS
    _, openings, _ = close_scan_holes(ragged, arm(), OpeningsConfig(), Job())
    assert_allclose([o.perimeter for o in openings], 2 * np.pi * RADIUS, rtol=0.04)


def test_a_bay_in_a_rim_is_bridged_where_the_rim_would_run():
    torn = punched(sleeve(), [[0.1, 0.39, 0.0], [0.1, 0.36, 0.0], [0.1, 0.33, 0.0]], 0.035)
    job = Job()
    closed, openings, observed = close_scan_holes(torn, arm(), OpeningsConfig(), job)
    assert job.metrics["filled_notches"] == 1
    assert_allclose([o.perimeter for o in openings], 2 * np.pi * RADIUS, rtol=0.04)
    filling = closed.vertices[~observed]
    assert_allclose(np.hypot(filling[:, 0], filling[:, 2]), RADIUS, atol=0.006)
    assert filling[:, 1].max() < HEIGHT + 0.004


def test_the_way_round_a_flat_tube_is_no_bay():
    """From front to back across the form is short, and between them the rim dips; but the form is in the way."""
    pipe, form = sleeve(), arm(0.096)
    flatten = np.array([1.6, 1.0, 0.5])
    dip = 0.03 * (pipe.vertices[:, [0]] / RADIUS) ** 2 * (2.0 * pipe.vertices[:, [1]] / HEIGHT - 1.0)
    flat = TriangleMesh(pipe.vertices * flatten - dip * [0, 1, 0], pipe.faces)
    job = Job()
    _, openings, _ = close_scan_holes(flat, TriangleMesh(form.vertices * flatten, form.faces), OpeningsConfig(), job)
    assert len(openings) == 2
    assert job.metrics["filled_notches"] == 0


def test_a_ledge_to_the_form_is_trimmed_and_the_cloth_is_not():
    pipe = sleeve()
    low = pipe.vertices[np.abs(pipe.vertices[:, 1]) < 1e-9]
    inner = low * [0.8, 1.0, 0.8]
    ring = np.arange(len(low))
    outer_index = np.flatnonzero(np.abs(pipe.vertices[:, 1]) < 1e-9)
    inner_index = len(pipe.vertices) + ring
    following = np.roll(ring, -1)
    ledge = np.vstack(
        [
            np.column_stack([outer_index[following], outer_index[ring], inner_index[ring]]),
            np.column_stack([outer_index[following], inner_index[ring], inner_index[following]]),
        ]
    )
    bent = TriangleMesh(np.vstack([pipe.vertices, inner]), np.vstack([pipe.faces, ledge]))
    trimmed = trim_ledges(bent, arm(0.079), 0.04)
    assert len(trimmed.faces) == len(pipe.faces)
    assert_allclose(np.hypot(trimmed.vertices[:, 0], trimmed.vertices[:, 2]), RADIUS, rtol=1e-9)


def test_flaps_go_and_the_rest_stays():
    pipe = sleeve()
    count = len(pipe.vertices)
    rim = pipe.vertices[boundary_loops(pipe)[0][:2]]
    tip = rim.mean(axis=0) * [1, 0, 1] + [0, -0.05 if rim[0, 1] < 0.1 else HEIGHT + 0.05, 0]
    a, b = boundary_loops(pipe)[0][:2]
    spiked = TriangleMesh(np.vstack([pipe.vertices, tip]), np.vstack([pipe.faces, [[b, a, count]]]))
    clean = drop_flaps(spiked, 0.02, 0.12)
    assert clean.vertices[:, 1].min() > -0.02
    assert clean.vertices[:, 1].max() < HEIGHT + 0.02
    assert_allclose(area(clean), 2 * np.pi * RADIUS * HEIGHT, rtol=0.02)
    assert drop_flaps(spiked, 0.0, 0.12) is spiked  # flap_edges may be 0


def area(mesh):
    return np.linalg.norm(np.cross(*np.diff(mesh.vertices[mesh.faces], axis=1).transpose(1, 0, 2)), axis=1).sum() / 2


def test_cloth_between_small_holes_is_no_flap_and_a_strip_beside_a_large_one_is():
    """Holes 23 mm wide every 31 mm leave cloth 8 mm wide; beside a window of 12 cm a strip 6 mm wide hangs on it."""
    turns = np.arange(-4, 5) * 0.31
    heights = 0.06 + 0.031 * np.arange(9)
    spots = [[RADIUS * np.sin(t), y, RADIUS * np.cos(t)] for t in turns for y in heights]
    patchy = punched(sleeve(around=300, along=200), spots, 0.0115)
    assert len(boundary_loops(patchy)) == 2 + len(spots)
    assert_allclose(area(drop_flaps(patchy, 0.012, 0.12)), area(patchy), rtol=0.002)  # corners of the two ends
    x, y, z = patchy.vertices[patchy.faces].mean(axis=1).T
    window = (z < -0.05) & (np.abs(y - 0.2) < 0.06) & (np.abs(x) > 0.003)
    barred = submesh(patchy, ~window)[0]
    clean = drop_flaps(barred, 0.012, 0.12)
    strip = (clean.vertices[:, 2] < -0.09) & (np.abs(clean.vertices[:, 1] - 0.2) < 0.05)
    assert not strip.any()
    assert_allclose(area(clean), area(barred) - 0.12 * 0.006, rtol=0.005)


def test_a_smoothed_circle_is_that_circle():
    turn = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    circle = 0.1 * np.column_stack([np.cos(turn), 0 * turn, np.sin(turn)])
    assert_allclose(smooth_curve(circle, 0.025), circle, atol=1e-5)  # one wave per turn keeps 1 - 2e-6 of itself
    zigzag = circle + 0.002 * np.column_stack([0 * turn, np.cos(100 * turn), 0 * turn])
    assert np.abs(smooth_curve(zigzag, 0.025)[:, 1]).max() < 3e-4  # of 2 mm


def test_the_dressed_form_end_to_end(scene):
    surface = transform_mesh(scene.scan, scene.mannequin_from_surface)
    labels = label_garment(surface, scene.form, SubtractConfig(), Job())
    shell = extract_garment(surface, labels, SubtractConfig(), Job())
    job = Job()
    garment, openings, observed = close_scan_holes(shell, scene.form, OpeningsConfig(expected=4), job)
    assert len(boundary_loops(garment)) == 4
    assert is_manifold(garment)
    assert [round(o.center[1], 1) for o in openings] == [0.8, 0.5, 0.5, 0.2]
    assert 0.5 < observed.mean() < 1.0
    there, _, _ = sample_surface(scene.shirt, 5000, 0)
    back, _, _ = sample_surface(garment, 5000, 0)
    for error in (
        SurfaceDistance(garment).nearest(there).distance,
        SurfaceDistance(scene.shirt).nearest(back).distance,
    ):
        assert 1e-5 < np.median(error) < 1e-3  # the demo's bar
        assert np.percentile(error, 95) < 8e-3  # one cell: the synthetic scan's ledges are as coarse


def test_a_mesh_of_another_size_is_remeshed():
    fine, config, job = sleeve(), SimulationMeshConfig(edge_mm=15.0), Job()
    even = remesh_for_simulation(fine, config, job)
    assert_allclose(np.median(lengths(even)), 0.015, rtol=config.tolerance)
    assert len(list_openings(even)) == 2
    assert not job.left_out


def test_a_good_mesh_is_used_as_it_is_unless_nothing_may_be_left_out():
    flat, config, job = dressed_triangles(), SimulationMeshConfig(edge_mm=10.0), Job()
    assert remesh_for_simulation(flat, config, job) is flat
    assert [what for what, _ in job.left_out] == ["remeshing"]
    assert "10.0 mm at the median and no angle is below 60°" in dict(job.left_out)["remeshing"]
    job = Job(force_all=True)
    again = remesh_for_simulation(flat, config, job)
    assert again is not flat
    assert again.vertices.shape != flat.vertices.shape or np.abs(again.vertices - flat.vertices).max() > 1e-6
    assert not job.left_out


def test_one_sharp_triangle_is_enough_to_be_remeshed():
    flat = dressed_triangles()
    vertices = flat.vertices.copy()
    vertices[27] += 0.95 * (vertices[28] - vertices[27])
    assert reason_to_skip_remeshing(TriangleMesh(vertices, flat.faces), SimulationMeshConfig(edge_mm=10.0)) is None


def lengths(mesh):
    """Of the sides of all faces [m]."""
    corners = mesh.vertices[mesh.faces]
    return np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)


def dressed_triangles(step=0.01, rows=8):
    """A flat sheet of equilateral triangles."""
    i, j = np.meshgrid(np.arange(rows), np.arange(rows), indexing="ij")
    vertices = np.column_stack([(i + 0.5 * j).ravel() * step, (np.sqrt(0.75) * j).ravel() * step, 0.0 * i.ravel()])
    at = np.arange(rows * rows).reshape(rows, rows)
    a, b, c, d = at[:-1, :-1].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel(), at[:-1, 1:].ravel()
    return TriangleMesh(vertices, np.vstack([np.column_stack([a, b, d]), np.column_stack([b, c, d])]))


def test_an_opening_is_not_filled_right_through_the_arm_in_it():
    with pytest.raises(GarmentError, match="runs through the mannequin"):
        close_scan_holes(sleeve(), arm(), OpeningsConfig(least_perimeter_mm=5000), Job())
