"""A size between two: against the size that the maker of both made itself."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from size_shapes import FOREIGN, foreign, tee, with_parameter

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.errors import InputError
from vto_pipeline.garment.sizes.between import mesh_between, pattern_between
from vto_pipeline.io.patterns.loops import edges_length, edges_points
from vto_pipeline.model.body import Measurements
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.pattern import Edge, Notch
from vto_pipeline.numerics.plane_curves import at_shares

BAR_M = 3e-3


def off(one, other):
    """Mean distance between the outlines of all panels at the same shares of each edge [m]."""
    shares = np.linspace(0.0, 1.0, 51)
    away = [
        np.linalg.norm(
            at_shares(a.kind, a.points, a.bulge, shares) - at_shares(b.kind, b.points, b.bulge, shares), axis=1
        )
        for p, q in zip(one.panels, other.panels, strict=True)
        for a, b in zip(p.edges, q.edges, strict=True)
    ]
    return float(np.mean(away))


def test_what_is_linear_in_the_sizes_comes_out_exact():
    made = pattern_between(tee(chest=0.44, sleeve=0.2), tee(chest=0.52, sleeve=0.24), 0.25)
    truth = tee(chest=0.46, sleeve=0.21)
    for one, other in zip(made.panels[:2], truth.panels[:2], strict=True):
        for a, b in zip(one.edges, other.edges, strict=True):
            assert_allclose(a.points, b.points, rtol=0, atol=1e-12)
    assert made.panels[0].notches[0].position == pytest.approx(truth.panels[0].notches[0].position)
    assert off(made, truth) < 1e-3  # but for the width of the caps, which is a square root
    assert off(pattern_between(tee(chest=0.44), tee(chest=0.52), 0.0), tee(chest=0.44)) == 0.0


def test_curves_of_different_points_and_angles_across_the_turn():
    """A half circle as lines, of 40 points in one size and of 60 in the other; a notch that points left in both."""

    def disc(radius, count, angle):
        turn = np.linspace(0, np.pi, count)
        arc = Edge("polyline", radius * np.stack([np.cos(turn), np.sin(turn)], axis=1))
        flat = Edge("polyline", np.stack([arc.points[-1], arc.points[0]]))
        panel = replace(tee().panels[0], edges=(flat, arc), notches=(Notch(arc.points[3], angle),), grain=None)
        return replace(tee(), panels=(panel,), stitches=())

    made = pattern_between(disc(0.1, 40, 3.1), disc(0.2, 60, -3.1), 0.5).panels[0]
    assert np.linalg.norm(edges_points(made.edges[1:], 1e-4), axis=1) == pytest.approx(0.15, rel=2e-3)
    assert edges_length(made.edges[1:]) == pytest.approx(0.15 * np.pi, rel=2e-3)
    assert abs(made.notches[0].angle) == pytest.approx(np.pi, abs=1e-9)
    arcs = [Edge("arc", np.array([[0, 0], [1.0, 0]]), np.tan(angle / 4)) for angle in (0.4, 1.2)]
    panels = [replace(tee().panels[0], edges=(a, Edge("polyline", a.points[::-1])), notches=()) for a in arcs]
    small, large = (replace(tee(), panels=(one,), stitches=()) for one in panels)
    assert 4 * np.arctan(pattern_between(small, large, 0.5).panels[0].edges[0].bulge) == pytest.approx(0.8)


def test_patterns_of_another_make_are_refused():
    one = tee()
    with pytest.raises(InputError, match="only one of the patterns has: back"):
        pattern_between(one, replace(one, panels=one.panels[:1] + one.panels[2:], stitches=()), 0.5)
    with pytest.raises(InputError, match="seams of the two"):
        pattern_between(one, replace(one, stitches=one.stitches[1:]), 0.5)
    without = replace(one.panels[0], notches=())
    with pytest.raises(InputError, match="'front': 1 and 0 notches"):
        pattern_between(one, replace(one, panels=(without, *one.panels[1:])), 0.5)
    with pytest.raises(InputError, match="triangles of the meshes differ"):
        mesh_between(TriangleMesh(np.eye(3), [[0, 1, 2]]), TriangleMesh(np.eye(3), [[0, 2, 1]]), 0.5)


def test_a_mesh_between_two_sizes_is_that_of_the_size_between():
    """Bodies of the project's own maker, S, M and L of EN 13402, that all have the same triangles."""
    bodies = [
        fit_measurements(
            Measurements({"chest_girth": chest, "waist_girth": chest - 0.18, "stature": 1.68}, sex="female")
        ).mesh
        for chest in (0.86, 0.94, 1.025)
    ]
    small, true, large = bodies
    made = mesh_between(small, large, (0.94 - 0.86) / (1.025 - 0.86))
    away = np.linalg.norm(made.vertices - true.vertices, axis=1)
    apart = np.linalg.norm(large.vertices - small.vertices, axis=1)
    assert away.mean() < BAR_M
    assert away.mean() < 0.1 * apart.mean()  # a bar that the small size itself would not pass
    assert_allclose(mesh_between(small, large, 0.0).vertices, small.vertices, rtol=0, atol=0)


TEMPLATES = sorted(FOREIGN.rglob("*.json"))
RUNS = [
    ("tee", {"wideness": (0.93, 1.0, 1.07), "low_wide": (0.95, 1.0, 1.05), "length": (0.96, 1.0, 1.04)}),
    ("jacket_hood", {"wideness": (0.93, 1.0, 1.07), "sllength": (-9.0, 0.0, 9.0), "hood_height": (0.98, 1.0, 1.02)}),
    (
        "pants_flare",
        {"up_length": (-1.0, 0.0, 1.0), "knee_length": (0.97, 1.0, 1.03), "low_wideness": (-1.0, 0.0, 1.0)},
    ),
    ("skirt_8_panels", {"wideness": (0.9, 1.0, 1.1), "length": (0.95, 1.0, 1.05)}),
    ("dress", {"wideness": (1.0, 1.08, 1.16), "waist_wideness": (0.95, 1.0, 1.05), "top_wideness": (0.95, 1.0, 1.05)}),
]


@pytest.mark.real_data
@pytest.mark.skipif(not TEMPLATES, reason="shared data absent")
@pytest.mark.parametrize(("name", "parameters"), RUNS, ids=[name for name, _ in RUNS])
def test_m_between_s_and_l_of_a_template_of_others(name, parameters):
    """Sizes by the template's own parameters, several at once, of which each works on what the one before left."""
    (path,) = (path for path in TEMPLATES if path.stem == name)
    sizes = []
    for k in range(3):
        data = json.loads(path.read_text())
        for parameter, values in parameters.items():
            data = with_parameter(data, parameter, values[k])
        sizes.append(foreign(data, name))
    small, true, large = sizes
    assert off(pattern_between(small, large, 0.5), true) < BAR_M
    assert off(small, true) > BAR_M
