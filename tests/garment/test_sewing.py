"""Patterns sewn: samples that match across seams, triangles with the area of the panels, and shapes known in space."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from vto_pipeline.cloth.rest_shape.from_panels import find_panels
from vto_pipeline.errors import GarmentError, InputError
from vto_pipeline.garment.pattern.embed import in_shape
from vto_pipeline.garment.pattern.figures import panel_figures
from vto_pipeline.garment.pattern.sampling import sample_edges
from vto_pipeline.garment.pattern.sew import SewConfig, sew
from vto_pipeline.garment.pattern.triangulate import triangulate_panel
from vto_pipeline.geometry.topology import boundary_loops, face_area_vectors
from vto_pipeline.model.job import Job
from vto_pipeline.model.pattern import Edge, InnerLine, Panel, Pattern, Placement, Side, Stitch
from vto_pipeline.numerics.plane_curves import at_shares

AHEAD = np.eye(3)
EDGE = SewConfig(edge_mm=20.0)


def polygon(name, corners, **more):
    """A panel with straight edges."""
    points = np.asarray(corners, dtype=float)
    edges = [Edge("polyline", np.stack([a, b])) for a, b in zip(points, np.roll(points, -1, axis=0), strict=True)]
    return Panel(name, tuple(edges), **more)


def turned(degrees):
    """The rotation about y."""
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def tube(count=4, width=0.2, height=0.3):
    """A prism of rectangles that face outwards, each sewn to the next."""
    panels, stitches = [], []
    for k in range(count):
        rotation = turned(360.0 * k / count)
        place = Placement(rotation, rotation @ [-width / 2, 0.0, 0.3])
        corners = [(0, 0), (width, 0), (width, height), (0, height)]
        panels.append(polygon(f"p{k}", corners, placement=place))
        stitches.append(Stitch((Side(f"p{k}", 1),), (Side(f"p{(k + 1) % count}", 3, False),)))
    return Pattern("tube", tuple(panels), tuple(stitches))


def perimeter(mesh, loop):
    points = mesh.vertices[loop]
    return float(np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1).sum())


def test_a_tube_has_two_openings_as_long_as_its_panels_and_their_area():
    job = Job()
    sewn = sew(tube(), EDGE, job)
    mesh = in_shape(sewn, job)
    loops = boundary_loops(mesh)
    assert [perimeter(mesh, loop) for loop in loops] == pytest.approx([0.8, 0.8], rel=1e-2)
    area = np.linalg.norm(face_area_vectors(mesh), axis=1)
    assert area.sum() == pytest.approx(4 * 0.2 * 0.3, rel=1e-2)
    flat = 0.5 * np.linalg.det(mesh.texture[:, 1:] - mesh.texture[:, :1])
    assert flat.sum() == pytest.approx(0.24, rel=1e-9)
    assert np.bincount(sewn.panel, flat) == pytest.approx([0.06] * 4)
    assert max(abs(job.metrics[f"stretch_p{p}_share"]) for p in ("01", "99")) < 2e-2
    out = (face_area_vectors(mesh)[:, [0, 2]] * mesh.vertices[mesh.faces].mean(axis=1)[:, [0, 2]]).sum(axis=1)
    assert (out > 0.0).all()  # the right side is outside
    around = np.hypot(*mesh.vertices[np.abs(mesh.vertices[:, 1] - 0.15) < 0.05][:, [0, 2]].T)
    assert around == pytest.approx(0.8 / (2 * np.pi), rel=0.05)  # blown up, a prism is round
    assert (job.metrics["pieces"], job.metrics["seams"]) == (1, 4)


def test_panels_lie_side_by_side_with_their_grain_upright():
    pattern = tube(3)
    slanted = replace(pattern.panels[1], grain=np.array([[0.1, 0.1], [0.2, 0.1]]))
    sewn = sew(replace(pattern, panels=(pattern.panels[0], slanted, pattern.panels[2])), EDGE, Job())
    mesh = in_shape(sewn, Job())
    places = [mesh.texture[sewn.panel == k].reshape(-1, 2) for k in range(3)]
    boxes = [(place.min(axis=0), place.max(axis=0)) for place in places]
    assert [high - low for low, high in boxes] == [
        pytest.approx(size) for size in ([0.2, 0.3], [0.3, 0.2], [0.2, 0.3])
    ]  # the grain of the middle one runs across
    assert all(one[1][0] < other[0][0] for one, other in pairwise(boxes))
    normal = np.linalg.det(mesh.texture[:, 1:] - mesh.texture[:, :1])
    assert (normal > 0.0).all()
    found = find_panels(mesh)
    assert (found.doubt, found.unit, found.pieces) == ("", "m", 3)


def test_a_dart_makes_a_cone():
    """A sector sewn to itself: around its tip there is as much cloth as in the plane."""
    radius, angle = 0.3, np.deg2rad(325.0)
    end = radius * np.array([np.cos(angle), np.sin(angle)])
    edges = (
        Edge("polyline", np.array([[0.0, 0.0], [radius, 0.0]])),
        Edge("arc", np.array([[radius, 0.0], end]), float(np.tan(angle / 4.0))),
        Edge("polyline", np.array([end, [0.0, 0.0]])),
    )
    sector = Panel("sector", edges, placement=Placement(AHEAD, np.zeros(3)))
    cone = Pattern("cone", (sector,), (Stitch((Side("sector", 0),), (Side("sector", 2, False),)),))
    sewn = sew(cone, EDGE, Job())
    mesh = in_shape(sewn, Job())
    (rim,) = boundary_loops(mesh)
    assert perimeter(mesh, rim) == pytest.approx(radius * angle, rel=3e-2)
    (tip,) = np.unique(mesh.faces[np.isclose(mesh.texture, [radius, 0.0], rtol=0, atol=1e-3).all(axis=2)])
    # the rim of a cone is a circle of radius r a / 2 pi, at the depth that the slanted side leaves
    across = np.linalg.norm(mesh.vertices[rim] - mesh.vertices[rim].mean(axis=0), axis=1)
    assert across.mean() == pytest.approx(radius * angle / (2 * np.pi), rel=0.03)
    assert np.linalg.norm(mesh.vertices[rim] - mesh.vertices[tip], axis=1) == pytest.approx(radius, rel=0.03)


def test_chains_of_many_edges_are_sampled_alike_on_both_sides():
    """Three edges against two of another length, one of them run through backwards."""
    low = polygon("low", [(0, 0), (0.5, 0), (0.5, 0.2), (0.35, 0.2), (0.1, 0.2), (0, 0.2)])
    high = polygon("high", [(0, 0.3), (0.417, 0.3), (0.6, 0.3), (0.6, 0.5), (0, 0.5)])
    chain = (Side("low", 2), Side("low", 3), Side("low", 4))
    pattern = Pattern("x", (low, high), (Stitch(chain, (Side("high", 1, False), Side("high", 0, False))),))
    samples = sample_edges(pattern, 0.02)
    panels = {"low": low, "high": high}
    places = {"low": [], "high": []}
    for pair in samples.links:
        for (name, edge), number in pair:
            curve = panels[name].edges[edge]
            shares = samples.shares[name, edge]
            places[name].append(at_shares(curve.kind, curve.points, curve.bulge, shares)[number])
    left, right = np.array(places["low"])[:, 0], np.array(places["high"])[:, 0]
    assert len(left) == len(right) > 25
    assert (left[0], left[-1], right[0], right[-1]) == pytest.approx((0.5, 0.0, 0.6, 0.0))
    assert (np.diff(left) < 0.0).all()
    assert (np.diff(right) < 0.0).all()
    assert left / 0.5 == pytest.approx(right / 0.6, abs=0.02)  # in proportion, but for ends of edges nearly opposite
    for own, ends in ((left, (0.35, 0.1)), (right, (0.417,))):
        for end in ends:
            assert np.abs(own - end).min() < 1e-9
    steps = np.abs(np.concatenate([np.diff(left), np.diff(right)]))
    assert 0.005 < steps.min() <= steps.max() < 0.031


def test_a_panel_with_a_hole_has_good_triangles():
    edges = (
        Edge("polyline", np.array([[-0.3, 0.0], [0.3, 0.0]])),
        Edge("arc", np.array([[0.3, 0.0], [-0.3, 0.0]]), 1.0),
    )
    square = np.array([[-0.05, 0.1], [0.05, 0.1], [0.05, 0.2], [-0.05, 0.2], [-0.05, 0.1]])
    panel = Panel("half", edges, lines=(InnerLine("cutout", (Edge("polyline", square),)),))
    samples = sample_edges(Pattern("x", (panel,)), 0.015)
    flat = triangulate_panel(panel, samples, 0.015)
    corners = flat.points[flat.faces]
    areas = 0.5 * np.linalg.det(corners[:, 1:] - corners[:, :1])
    assert (areas > 0.0).all()
    assert areas.sum() == pytest.approx(0.5 * np.pi * 0.09 - 0.01, rel=2e-3)  # chords cut the arc
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    assert 0.011 < np.median(sides) < 0.019
    assert np.rad2deg(flat.angles.min()) > 15.0
    assert np.rad2deg(np.quantile(flat.angles, 0.01)) > 25.0
    law = np.arccos((sides[:, 0] ** 2 + sides[:, 1] ** 2 - sides[:, 2] ** 2) / (2 * sides[:, 0] * sides[:, 1]))
    assert (flat.angles <= law + 1e-12).all()
    x, y = flat.points[: flat.outline].T
    assert (np.isclose(y, 0.0, atol=1e-12) | np.isclose(np.hypot(x, y), 0.3, atol=1e-9)).all()
    for k, shares in enumerate(samples.shares["half", e] for e in range(2)):
        curve = panel.edges[k]
        there = [flat.points[flat.vertex(k, n)] for n in range(len(shares))]
        assert np.array(there) == pytest.approx(at_shares(curve.kind, curve.points, curve.bulge, shares), abs=1e-12)


def test_an_open_jacket_stays_as_it_is_laid_out():
    """Free to turn, cloth bent without stretch does; then it is turned back, its top as high as its panels'."""
    whole = tube(6, 0.12, 0.5)
    sewn = sew(replace(whole, stitches=whole.stitches[:-1]), EDGE, Job())
    mesh = in_shape(sewn, Job())
    now, placed = (x - x.mean(axis=0) for x in (mesh.vertices, sewn.mesh.vertices))
    u, _, v = np.linalg.svd(now.T @ placed)  # Kabsch 1976
    assert np.trace(u @ v) == pytest.approx(3.0, abs=1e-9)
    assert mesh.vertices[:, 1].max() == pytest.approx(0.5, abs=1e-9)


def test_eased_seams_are_warned_of_and_closed():
    pattern = tube(3)
    wide = polygon("p1", [(0, 0), (0.2, 0), (0.2, 0.33), (0, 0.33)], placement=pattern.panels[1].placement)
    job = Job()
    sewn = sew(replace(pattern, panels=(pattern.panels[0], wide, pattern.panels[2])), EDGE, job)
    assert len(boundary_loops(sewn.mesh)) == 2
    assert sum("+30 mm" in text or "-30 mm" in text for text in job.warnings) == 2


def test_what_cannot_be_sewn_is_named():
    good = tube(3)
    bow = polygon("bow", [(0, 0), (0.3, 0.3), (0.3, 0), (0, 0.4)], placement=good.panels[0].placement)
    cases = [
        (replace(good, panels=(replace(good.panels[0], placement=None), *good.panels[1:])), "stand in space: p0"),
        (replace(good, stitches=(*good.stitches, good.stitches[0])), "edge 1 of panel 'p0' is in stitch 0 and in"),
        (
            replace(good, stitches=(Stitch((Side("p0", 1),), (Side("p1", 3, True),)), *good.stitches[1:])),
            "right side to a wrong side",
        ),
        (Pattern("x", (bow,)), "'bow': the outline crosses itself"),
    ]
    for pattern, said in cases:
        with pytest.raises(GarmentError, match=said):
            sew(pattern, EDGE, Job())
    with pytest.raises(InputError, match="no size 'M'"):
        sew(good, SewConfig(size="M"), Job())


def test_figures_of_a_panel():
    inner = polygon("x", [(0, 0), (0.3, 0), (0.3, 0.4), (0, 0.4)])
    outer = polygon("x", [(-0.01, -0.01), (0.31, -0.01), (0.31, 0.41), (-0.01, 0.41)])
    tilted = np.array([[0.1, 0.1], [0.1 - 0.1 * np.sin(0.2), 0.1 + 0.1 * np.cos(0.2)]])
    for grain in (tilted, tilted[::-1]):
        found = panel_figures(replace(inner, cut=outer.edges, grain=grain))
        assert (found.area, found.outline) == (pytest.approx(0.12), pytest.approx(1.4))
        assert found.allowance == pytest.approx(0.01, abs=1e-4)
        assert found.grain == pytest.approx(0.2)
