"""Garments taken apart: developable surfaces, a cap by plate theory, patterns sewn, garments of others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from size_shapes import skirt
from unsewn_shapes import EVEN, POPLIN, cap, frustum

from vto_pipeline.bench.unsewn.compare import compare
from vto_pipeline.cloth.rest_shape.from_panels import find_panels
from vto_pipeline.errors import GarmentError, InputError
from vto_pipeline.garment.pattern.embed import in_shape
from vto_pipeline.garment.pattern.figures import panel_figures, seam_figures
from vto_pipeline.garment.pattern.sew import SewConfig, sew
from vto_pipeline.garment.unsewn.cut import cut_apart, runs
from vto_pipeline.garment.unsewn.flatten import flat_areas, flatten, stretches
from vto_pipeline.garment.unsewn.noise import noise_of, without_noise
from vto_pipeline.garment.unsewn.outline import crosses_itself, sharp_corners, smoothed
from vto_pipeline.garment.unsewn.recover import recover
from vto_pipeline.garment.unsewn.trace import trace
from vto_pipeline.geometry.topology import boundary_loops, face_area_vectors, half_edges
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.io.patterns.panels_obj import write_panels_obj
from vto_pipeline.io.patterns.seam_lines import read_seam_lines
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.plane_curves import at_shares

BERKELEY = Path(__file__).parents[3] / "shared" / "data" / "garments" / "berkeley"
NOWHERE = np.zeros(3)


def unknown(mesh):
    """No warp for any face."""
    return np.zeros((len(mesh.faces), 3))


def edge_lengths(panel):
    return [float(np.linalg.norm(np.diff(edge.points, axis=0), axis=1).sum()) for edge in panel.edges]


def area_of(mesh):
    return float(np.linalg.norm(face_area_vectors(mesh), axis=1).sum())


def test_a_tube_is_a_skirt_of_two_rectangles():
    """The prism of 96 sides has a girth of 96 chords; cut at both sides, two panels of half of that."""
    radius, height = 0.15, 0.4
    girth = 96 * 2.0 * radius * np.sin(np.pi / 96)
    found = recover(frustum(radius, radius, height), "auto", POPLIN, "tube", Job())
    assert found.pattern.name == "tube skirt"
    assert sorted(panel.name for panel in found.pattern.panels) == ["skirt_back", "skirt_front"]
    for panel in found.pattern.panels:
        figures = panel_figures(panel)
        assert figures.area == pytest.approx(0.5 * girth * height, rel=1e-3)  # smoothing of what is not noise
        assert sorted(edge_lengths(panel)) == pytest.approx([height] * 2 + [0.5 * girth] * 2, rel=2e-3)
        low, high = (f(np.concatenate([e.points for e in panel.edges]), axis=0) for f in (np.min, np.max))
        assert high - low == pytest.approx([0.5 * girth, height], rel=2e-3)  # upright: the warp runs along y
        assert panel.placement.rotation[:, 1] == pytest.approx([0.0, 1.0, 0.0], abs=0.02)
    front = next(panel for panel in found.pattern.panels if panel.name == "skirt_front")
    assert front.placement.rotation[:, 2] == pytest.approx([0.0, 0.0, 1.0], abs=0.02)  # its right side looks ahead
    seams = seam_figures(found.pattern)
    assert len(seams) == 2
    assert max(abs(seam.mismatch) for seam in seams) < 1e-4
    assert max(piece.stretch[1] for piece in found.pieces) < 2e-3


def test_a_cone_is_a_sector():
    """Of angle 2 pi sin a about its tip, cut along a line that was drawn beside it."""
    low, high, height = 0.30, 0.10, 0.35
    slant = float(np.hypot(low - high, height))
    share = np.linspace(0.0, 1.0, 40)[:, None]
    line = (1.0 - share) * [0.005, 0.0, low] + share * [0.005, height, high]
    mesh = frustum(low, high, height)
    found = recover(mesh, {"back": line}, POPLIN, "cone", Job())
    (panel,) = found.pattern.panels
    assert panel_figures(panel).area == pytest.approx(np.pi * (low + high) * slant, rel=3e-3)
    assert sorted(edge_lengths(panel)) == pytest.approx([slant, slant, 2 * np.pi * high, 2 * np.pi * low], rel=5e-3)
    outline = np.concatenate([edge.points[:-1] for edge in panel.edges])
    # all of an arc is as far from the tip as the cone's side is long there
    long = max(panel.edges, key=lambda e: np.linalg.norm(np.diff(e.points, axis=0), axis=1).sum()).points
    around = np.column_stack([2.0 * long, np.ones(len(long))])
    x, y, c = np.linalg.lstsq(around, (long**2).sum(axis=1), rcond=None)[0]
    assert np.sqrt(c + x * x + y * y) == pytest.approx(low * slant / (low - high), rel=5e-3)
    assert np.linalg.norm(outline - [x, y], axis=1).min() == pytest.approx(high * slant / (low - high), rel=5e-3)
    (stitch,) = found.pattern.stitches
    assert (stitch.first[0].forward, stitch.second[0].forward) == (True, False)


def test_a_cap_is_stretched_as_plate_theory_has_it():
    """A disc bent to a sphere with no load at its rim: by Airy's function, Ka²/16 in the middle, -Ka²/8 along the rim.

    From the equation of Foeppl for a shallow cap of curvature K, sigma_r = EK(a² - r²)/16, sigma_t = EK(a² - 3r²)/16.
    """
    radius, reach = 0.5, 0.1
    mesh = cap(radius, reach)
    flat = flatten(mesh, unknown(mesh), EVEN)
    curvature = (reach / radius) ** 2
    off = stretches(mesh, flat) - 1.0
    out = np.linalg.norm(flat[mesh.faces].mean(axis=1) - flat.mean(axis=0), axis=1) / reach
    middle, rim = off[out < 0.15], off[out > 0.96]
    assert middle.mean() == pytest.approx(curvature / 16.0, rel=0.05)  # terms of the next order: K a² is 4 %
    assert rim[:, 1].mean() == pytest.approx(-curvature / 8.0, rel=0.08)  # faces there end before the rim
    assert rim[:, 0].mean() == pytest.approx(0.0, abs=0.1 * curvature / 8.0)


def test_cloth_that_shears_easily_is_sheared_before_it_is_stretched():
    mesh = cap(0.5, 0.25)
    soft = replace(EVEN, shear=5.0)
    left = []
    for fabric in (EVEN, soft):
        flat = flatten(mesh, unknown(mesh), fabric)
        sides = np.swapaxes(mesh.vertices[mesh.faces][:, 1:] - mesh.vertices[mesh.faces][:, :1], 1, 2)
        laid = flat[mesh.faces]
        to_space = sides @ np.linalg.inv(np.swapaxes(laid[:, 1:] - laid[:, :1], 1, 2))
        left.append(np.abs(np.linalg.norm(to_space, axis=1) - 1.0).mean(axis=0))  # along weft and warp
        assert (flat_areas(flat, mesh.faces) > 0.0).all()
    assert (left[1] < 0.5 * left[0]).all()


def test_a_panel_does_not_turn_its_warp_to_where_cloth_gives_way():
    """A barrel is stretched along and around; cloth cut on the bias would rather be sheared by that."""
    share, angle = np.meshgrid(np.linspace(-1.0, 1.0, 41), np.linspace(-1.0, 1.0, 25), indexing="ij")
    radius = 0.12 + 0.06 * np.cos(1.5 * share)
    x, z = radius * np.sin(angle), radius * np.cos(angle)
    vertices = np.stack([x, 0.2 * share, z], axis=2).reshape(-1, 3)
    k = (25 * np.arange(40)[:, None] + np.arange(24)).ravel()
    faces = np.concatenate([np.stack([k, k + 1, k + 26], axis=1), np.stack([k, k + 26, k + 25], axis=1)])[:, [0, 2, 1]]
    mesh = TriangleMesh(vertices, faces[:, [0, 2, 1]].astype(np.int32))
    up = np.broadcast_to([0.0, 1.0, 0.0], mesh.faces.shape)
    flat = flatten(mesh, up, replace(EVEN, shear=5.0))
    top, low = flat[-25:].mean(axis=0), flat[:25].mean(axis=0)
    x, y = top - low
    assert np.arctan2(x, y) == pytest.approx(0.0, abs=np.deg2rad(1.0))


def test_more_than_half_a_ball_goes_flat_without_a_fold():
    mesh = cap(0.1, 0.1 * np.deg2rad(140.0))
    flat = flatten(mesh, unknown(mesh), POPLIN)
    assert (flat_areas(flat, mesh.faces) > 0.0).all()


def test_no_corner_of_a_rough_piece_flies_off():
    """The strain of a triangle that grows without end is a half: small ones at the rim went ten times as far."""
    for seed in (24, 25, 26):
        even = cap(0.5, 0.1, rings=10)
        rough = replace(even, vertices=even.vertices + np.random.default_rng(seed).normal(0.0, 3e-3, (331, 3)))
        up = np.broadcast_to([0.0, 1.0, 0.0], rough.faces.shape)
        flat = flatten(rough, up, POPLIN)
        sides = [
            np.linalg.norm(x[rough.faces] - x[np.roll(rough.faces, 1, axis=1)], axis=2) for x in (flat, rough.vertices)
        ]
        assert (sides[0] / sides[1]).max() < 5.0


def test_a_sliver_of_a_scan_does_no_harm():
    mesh = cap(0.5, 0.1, rings=10)
    a, b, c = mesh.faces[200]
    vertices = mesh.vertices.copy()
    vertices[c] = 0.4 * vertices[a] + 0.6 * vertices[b] + 1e-9 * (vertices[c] - vertices[a])
    thin = replace(mesh, vertices=vertices)
    flat = flatten(thin, unknown(thin), POPLIN)
    assert np.isfinite(flat).all()
    assert flat_areas(flat, thin.faces).sum() == pytest.approx(area_of(thin), rel=5e-3)


def test_the_warp_of_charts_ends_up_along_y():
    mesh = frustum(0.15, 0.15, 0.4)
    angle = np.arctan2(mesh.vertices[:, 0], mesh.vertices[:, 2])[mesh.faces]
    keep = np.ptp(angle, axis=1) < np.pi  # without the column where the angle jumps, the tube is a strip
    strip = TriangleMesh(mesh.vertices, mesh.faces[keep])
    around = 0.15 * angle[keep]
    laid = np.stack([mesh.vertices[mesh.faces[keep]][:, :, 1], -around], axis=2)  # v runs around
    found = recover(TriangleMesh(strip.vertices, strip.faces, texture=laid), "auto", POPLIN, "strip", Job())
    (panel,) = found.pattern.panels
    outline = np.concatenate([edge.points for edge in panel.edges])
    assert np.ptp(outline, axis=0) == pytest.approx([0.4, 0.15 * 2 * np.pi * 95 / 96], rel=2e-3)


def test_a_sewn_pattern_comes_apart_into_the_same_panels():
    """Two panels with a dart each."""
    given = skirt()
    sewn = sew(given, SewConfig(edge_mm=20.0), Job())
    mesh = in_shape(sewn, Job())
    job = Job()
    found = recover(mesh, "auto", POPLIN, "skirt", job)
    assert "true scale" in job.notes[0]
    assert len(found.pattern.panels) == len(given.panels)
    assert len(found.pattern.stitches) == len(given.stitches)
    true_areas = sorted(panel_figures(panel).area for panel in given.panels)
    # bent in space, it is stretched by less than 2 %, and mostly by much less
    assert sorted(one.area for one in found.pieces) == pytest.approx(true_areas, rel=1e-2)
    for one in compare(found, mesh):
        assert abs(one.area) < 1e-2
        assert one.outline_mean < 2e-3
        assert np.abs(one.seams).max() < 5e-3
    again = in_shape(sew(found.pattern, SewConfig(edge_mm=20.0), Job()), Job())
    loops = [len(boundary_loops(x)) for x in (mesh, again)]
    assert loops[0] == loops[1]
    assert area_of(again) == pytest.approx(area_of(mesh), rel=1e-2)


def test_the_panels_are_a_rest_shape(tmp_path):
    found = recover(frustum(0.15, 0.12, 0.4), "auto", POPLIN, "skirt", Job())
    write_panels_obj(tmp_path / "skirt.obj", found.mesh)
    read = read_mesh(tmp_path / "skirt.obj", unit="m")
    assert read.vertices == pytest.approx(found.mesh.vertices, abs=1e-7)
    judged = find_panels(read)
    assert (judged.doubt, judged.unit, judged.pieces) == ("", "m", 2)


def test_noise_is_measured_and_taken_off():
    mesh = frustum(0.15, 0.15, 0.4, around=190, up=80)
    rng = np.random.default_rng(0)
    rough = replace(mesh, vertices=mesh.vertices + rng.normal(0.0, 5e-4, mesh.vertices.shape))
    noise = noise_of(rough)
    assert noise == pytest.approx(5e-4, rel=0.1)
    smooth = without_noise(rough, noise)
    off = [np.hypot(*x.vertices[:, [0, 2]].T) - 0.15 for x in (rough, smooth)]
    assert np.sqrt(np.mean(off[1] ** 2)) < 0.6 * np.sqrt(np.mean(off[0] ** 2))
    assert area_of(rough) > 1.01 * area_of(mesh)  # rough is larger
    assert area_of(smooth) == pytest.approx(area_of(mesh), rel=3e-3)


def test_noise_goes_and_folds_stay():
    """A tube in 30 folds, 31 mm from one to the next and 4 mm to either side: its area is that of its own mesh."""
    tube = frustum(0.15, 0.15, 0.16, around=240, up=40)
    angle = np.arctan2(tube.vertices[:, 0], tube.vertices[:, 2])
    radius = 0.15 + 0.004 * np.cos(30 * angle)
    folded = np.column_stack([radius * np.sin(angle), tube.vertices[:, 1], radius * np.cos(angle)])
    mesh = replace(tube, vertices=folded)
    rough = replace(mesh, vertices=folded + np.random.default_rng(0).normal(0.0, 5e-4, folded.shape))
    smooth = without_noise(rough, noise_of(rough))
    assert area_of(rough) > 1.02 * area_of(mesh)
    assert area_of(smooth) == pytest.approx(area_of(mesh), rel=4e-3)  # 1 % too small where folds resist as all else


def test_corners_are_where_an_outline_turns():
    square = at_shares(
        "polyline", np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]], float), 0.0, np.linspace(0, 1, 201)
    )
    sharp = sharp_corners(square[:-1])
    assert np.flatnonzero(sharp).tolist() == [0, 50, 100, 150]
    angle = 2.0 * np.pi * np.arange(400) / 400
    assert not sharp_corners(0.2 * np.column_stack([np.cos(angle), np.sin(angle)])).any()
    assert not crosses_itself(square[:-1])
    assert crosses_itself(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]))


def test_a_noisy_line_is_smoothed_and_keeps_its_ends():
    rng = np.random.default_rng(0)
    angle = np.linspace(0.0, 1.0, 120)
    true = 0.4 * np.column_stack([np.cos(angle), np.sin(angle)])
    noisy = true + rng.normal(0.0, 5e-4, true.shape)
    found = smoothed(noisy, 5e-4)
    assert (found[[0, -1]] == noisy[[0, -1]]).all()
    assert np.sqrt(np.mean((found - true) ** 2)) < 0.6 * 5e-4
    long, short, right = (np.linalg.norm(np.diff(x, axis=0), axis=1).sum() for x in (noisy, found, true))
    assert abs(short - right) < 0.3 * abs(long - right)
    assert (smoothed(noisy, 0.0) == noisy).all()


def test_a_drawn_line_runs_along_edges_and_the_surface_stays():
    mesh = frustum(0.15, 0.15, 0.4)
    share = np.linspace(0.0, 1.0, 60)
    angle = 0.3 + 1.1 * share  # a helix
    line = np.column_stack([0.15 * np.sin(angle), 0.4 * share, 0.15 * np.cos(angle)])
    cut, seam = trace(mesh, [line])
    ends = cut.vertices[half_edges(cut)[seam == 0]]
    length = 0.5 * np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum()  # each side once
    assert length == pytest.approx(np.hypot(0.4, 0.15 * 1.1), rel=5e-3)
    there = np.arctan2(ends[..., 0], ends[..., 2]) - 0.3 - 1.1 * ends[..., 1] / 0.4
    assert np.abs(0.15 * there).max() < 2e-3
    assert area_of(cut) == pytest.approx(area_of(mesh), rel=2e-3)
    assert (np.einsum("fd,fd->f", face_area_vectors(cut), face_area_vectors(mesh)) > 0.0).all()


def test_a_line_across_folds_takes_no_cloth_out_of_them():
    """A tube in 40 folds of six vertices each, 8 mm deep; the middle of its neighbours takes a vertex off its fold."""
    tube = frustum(0.15, 0.15, 0.1, around=240, up=25)
    angle = np.arctan2(tube.vertices[:, 0], tube.vertices[:, 2])

    def folded(angle, height):
        radius = 0.15 + 0.004 * np.cos(40 * angle)
        return np.column_stack([radius * np.sin(angle), height, radius * np.cos(angle)])

    mesh = replace(tube, vertices=folded(angle, tube.vertices[:, 1]))
    around = np.linspace(0.0, 2.0 * np.pi, 721)
    cut, seam = trace(mesh, [folded(around, np.full(721, 0.0512))])
    assert (seam >= 0).any()
    assert area_of(cut) == pytest.approx(area_of(mesh), rel=2e-3)


def test_a_line_with_sharp_turns_is_one_seam():
    """A tube cut up along one zigzag: the panel has two ends of the tube, and each side of the zigzag as one edge."""
    share = np.linspace(0.0, 1.0, 201)
    angle = 0.3 * np.abs((4.0 * share) % 2.0 - 1.0)  # turns by 84 degrees, three times
    line = np.column_stack([0.15 * np.sin(angle), 0.2 * share, 0.15 * np.cos(angle)])
    found = recover(frustum(0.15, 0.15, 0.2, around=190, up=40), {"zigzag": line}, POPLIN, "tube", Job())
    (panel,) = found.pattern.panels
    girth, side = 2.0 * np.pi * 0.15, 4.0 * float(np.hypot(0.045, 0.05))
    assert sorted(edge_lengths(panel)) == pytest.approx(sorted([side, side, girth, girth]), rel=0.02)
    assert len(found.pattern.stitches) == 1


def test_a_corner_of_one_side_ends_the_other_side_of_the_seam_too():
    mesh = frustum(0.15, 0.15, 0.4, around=40, up=8)
    angle = np.arctan2(mesh.vertices[:, 0], mesh.vertices[:, 2])
    on = np.isclose(angle, 0.0) | np.isclose(np.abs(angle), np.pi)
    seam = on[half_edges(mesh)].all(axis=1)
    pieces = cut_apart(mesh, seam)
    assert len(pieces) == 2
    sharp = [np.zeros(len(piece.start), np.bool_) for piece in pieces]
    whole = runs(mesh, pieces, sharp)
    assert sorted(run.count for run in whole) == [8] * 4 + [20] * 4
    upright = next(run for run in whole if run.sewn >= 0 and run.piece == 0)
    sharp[0][(upright.first + 3) % len(sharp[0])] = True
    found = runs(mesh, pieces, sharp)
    assert sorted(run.count for run in found if run.sewn >= 0) == [3, 3, 5, 5, 8, 8]
    for number, run in enumerate(found):
        if run.sewn >= 0:
            assert found[run.sewn].sewn == number
            assert found[run.sewn].count == run.count


def test_a_dart_is_sewn_side_to_side():
    """A cap slit from its rim to its pole, 24 edges deep: no corner is given, and its tip parts the two sides."""
    mesh = cap(0.2, 0.15)
    slit = np.zeros(len(mesh.vertices), np.bool_)
    slit[np.flatnonzero((np.abs(mesh.vertices[:, 1]) < 1e-12) & (mesh.vertices[:, 0] >= -1e-12))] = True
    assert slit.sum() == 25
    (piece,) = pieces = cut_apart(mesh, slit[half_edges(mesh)].all(axis=1))
    found = runs(mesh, pieces, [np.zeros(len(piece.start), np.bool_)])
    assert sorted((run.count, run.sewn >= 0) for run in found) == [(24, True), (24, True), (6 * 24, False)]
    one, other = (number for number, run in enumerate(found) if run.sewn >= 0)
    assert (found[one].sewn, found[other].sewn) == (other, one)


def test_what_cannot_come_apart_is_refused():
    tube = frustum(0.15, 0.15, 0.4)
    with pytest.raises(GarmentError, match="has 2 rims"):
        recover(replace(tube, texture=tube.vertices[tube.faces][:, :, :2]), "charts", POPLIN, "x", Job())
    with pytest.raises(InputError, match="no texture coordinates"):
        recover(tube, "charts", POPLIN, "x", Job())
    with pytest.raises(GarmentError, match="its 1 openings"):
        recover(cap(0.3, 0.2), "auto", POPLIN, "x", Job())
    far = np.array([[2.0, 0.0, 0.0], [2.0, 0.4, 0.0]])
    with pytest.raises(GarmentError, match="far side: the surface has no way"):
        recover(tube, {"far side": far}, POPLIN, "x", Job())


def test_drawn_seams_are_read_in_their_unit(tmp_path):
    path = tmp_path / "seams.yaml"
    path.write_text("schema: 1\nunit: cm\nseams:\n  - {name: side, points: [[0, 0, 15], [0, 40, 15]]}\n")
    assert read_seam_lines(path)["side"] == pytest.approx(np.array([[0, 0, 0.15], [0, 0.4, 0.15]]))
    for text, said in (
        ("schema: 1\nseams: []\n", "seams"),
        ("schema: 1\nunit: yard\nseams:\n  - {name: a, points: [[0, 0, 0], [1, 0, 0]]}\n", "'yard'"),
        ("schema: 1\nseams:\n  - {name: a, points: [[0, 0, 0]]}\n", "points"),
        ("schema: 1\nseams:\n" + 2 * "  - {name: a, points: [[0, 0, 0], [1, 0, 0]]}\n", "two of them"),
        ("schema: 1\nlines: []\nseams:\n  - {name: a, points: [[0, 0, 0], [1, 0, 0]]}\n", "unknown key"),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=said):
            read_seam_lines(path)


@pytest.mark.real_data
@pytest.mark.skipif(not BERKELEY.exists(), reason="garments of others are not part of the repository")
@pytest.mark.parametrize("name", ["tshirt", "pants"])
def test_garments_of_others_come_apart_into_their_panels(name):
    """Worn, they are stretched a little, which their flat panels are not: that part of the error is not ours."""
    mesh = read_mesh(BERKELEY / name / f"{name}-iso.obj", unit="m")
    found = recover(mesh, "auto", POPLIN, name, Job())
    errors = compare(found, mesh)
    assert len(errors) == {"tshirt": 6, "pants": 4}[name]
    for one in errors:
        assert abs(one.area - one.worn) < 5e-3
        assert one.outline_mean < 3e-3
