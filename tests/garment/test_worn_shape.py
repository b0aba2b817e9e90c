"""Found patterns sewn again: their cloth is where it was worn, folds and all, by surfaces in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from size_shapes import skirt
from unsewn_shapes import POPLIN, frustum

from vto_pipeline.errors import InputError
from vto_pipeline.garment.pattern.embed import in_shape
from vto_pipeline.garment.pattern.sew import SewConfig, sew
from vto_pipeline.garment.pattern.where import as_worn
from vto_pipeline.garment.sizes.grade import grade
from vto_pipeline.garment.sizes.rules import guess_rules
from vto_pipeline.garment.unsewn.recover import recover
from vto_pipeline.geometry.intersections import self_intersections
from vto_pipeline.geometry.topology import surface_area
from vto_pipeline.io.patterns.read import read_pattern
from vto_pipeline.io.patterns.write import write_pattern
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.pattern import Placement

RADIUS, DEEP, FLUTES = 0.2, 0.02, 6  # of a fluted skirt [m]


def fluted():
    """A tube of radius R + a cos 6θ."""
    tube = frustum(1.0, 1.0, 0.25, around=144, up=25)
    x, y, z = tube.vertices.T
    radius = RADIUS + DEEP * np.cos(FLUTES * np.arctan2(x, z))
    return TriangleMesh(np.column_stack([radius * x, y, radius * z]), tube.faces)


def off_flutes(mesh):
    """How far vertices are from that surface along the radius [m]."""
    x, _, z = mesh.vertices.T
    return np.hypot(x, z) - RADIUS - DEEP * np.cos(FLUTES * np.arctan2(x, z))


def without_folds(pattern):
    """The same, of which is known where its panels stood only."""
    panels = [replace(one, placement=replace(one.placement, worn_at=None)) for one in pattern.panels]
    return replace(pattern, panels=tuple(panels))


@pytest.mark.parametrize("edge_mm", [8.0, 12.0])
def test_cloth_is_sewn_where_it_was_worn(edge_mm):
    """A point is known in each square of s = 15 mm, so a circle without any is smaller than √2 s.

    So a triangle between them leaves a surface that bends by κ by less than κ s². A flute bends by less than
    a n²/r² + 1/r, where r is its least radius.
    """
    mesh = fluted()
    found = recover(mesh, "auto", POPLIN, "skirt", Job()).pattern
    again = in_shape(sew(found, SewConfig(edge_mm=edge_mm), Job()), Job(), found.worn)
    bend = DEEP * FLUTES**2 / (RADIUS - DEEP) ** 2 + 1.0 / (RADIUS - DEEP)
    most = 0.015**2 * bend
    assert np.abs(off_flutes(again)).max() < most
    assert np.abs(off_flutes(again)).mean() < 0.2 * most
    assert surface_area(again) == pytest.approx(surface_area(mesh), rel=0.02)
    assert np.ptp(again.vertices, axis=0) == pytest.approx(np.ptp(mesh.vertices, axis=0), abs=2e-3)
    assert len(self_intersections(again)) == 0
    flat = in_shape(sew(without_folds(found), SewConfig(edge_mm=12.0), Job()), Job(), True)
    assert np.abs(off_flutes(flat)).max() > 2.0 * most


def test_json_and_svg_keep_how_a_pattern_was_worn_and_dxf_where(tmp_path):
    """The middle of a cone stays where it was worn, too: corners of its flat panels stand higher than its rim."""
    mesh = frustum(0.3, 0.17, 0.5)
    found = recover(mesh, "auto", POPLIN, "cone", Job()).pattern
    for suffix in (".json", ".svg", ".dxf"):
        write_pattern(tmp_path / f"cone{suffix}", found)
        read = read_pattern(tmp_path / f"cone{suffix}", job=Job())
        assert read.worn
        assert read.of_size(read.sizes[0]).worn
        for one, other in zip(found.panels, read.panels, strict=True):
            known = other.placement.worn_at
            assert known is None if suffix == ".dxf" else (known == one.placement.worn_at).all()
    sewn = sew(read, SewConfig(edge_mm=20.0), Job())
    heights = [np.ptp(m.vertices[:, 1]) for m in (mesh, in_shape(sewn, Job(), worn=True))]
    tops = [in_shape(sewn, Job(), worn).vertices[:, 1].max() - mesh.vertices[:, 1].max() for worn in (True, False)]
    assert abs(tops[0]) < 0.01 < tops[1]
    assert heights[0] == pytest.approx(heights[1], rel=0.05)


def test_one_panel_that_was_never_worn_leaves_all_flat():
    """Half of it bent and half of it flat would be torn apart at the seams."""
    found = recover(fluted(), "auto", POPLIN, "skirt", Job()).pattern
    first, *others = found.panels
    mixed = replace(found, panels=(*without_folds(replace(found, panels=(first,), stitches=())).panels, *others))
    flat, half = (
        in_shape(sew(one, SewConfig(edge_mm=20.0), Job()), Job(), True) for one in (without_folds(found), mixed)
    )
    assert half.vertices == pytest.approx(flat.vertices, abs=1e-12)


def test_a_panel_reaches_past_what_is_known_of_it_in_its_own_plane():
    """A square bent about y: known in its left half only, the rest goes on as the panel stands."""
    given = skirt()
    plane = np.stack(np.meshgrid(np.linspace(-1.0, 0.0, 21), np.linspace(-1.0, 1.0, 41)), axis=2).reshape(-1, 2)
    lifted = np.column_stack([plane, plane, 0.3 + 0.0 * plane[:, 0]])
    panels = [replace(p, placement=Placement(np.eye(3), np.zeros(3), lifted)) for p in given.panels]
    loose = replace(given, panels=tuple(panels), stitches=())
    mesh = sew(loose, SewConfig(edge_mm=20.0), Job()).mesh
    assert mesh.vertices[:, 2] == pytest.approx(0.3, abs=1e-12)
    assert surface_area(mesh) == pytest.approx(
        0.5 * np.abs(np.linalg.det(np.diff(mesh.texture, axis=1))).sum(), rel=1e-9
    )


@pytest.mark.parametrize("known", [np.zeros((1, 2)), np.array([[0.0, 0.0], [0.1, 0.1], [0.2, 0.2]])])
def test_where_little_is_known_a_panel_is_as_it_stands(known):
    """From points of one line, or from one alone, nothing tells how it is bent."""
    points = np.random.default_rng(0).uniform(-0.2, 0.2, (50, 2))
    lifted = np.column_stack([known, known, np.full(len(known), 0.3)])
    expected = np.column_stack([points, np.full(50, 0.3)])
    assert as_worn(Placement(np.eye(3), np.zeros(3), lifted), points) == pytest.approx(expected, abs=1e-12)


def test_no_points_at_all_are_refused():
    with pytest.raises(InputError, match="worn places of a panel"):
        Placement(np.eye(3), np.zeros(3), np.zeros((0, 5)))


def test_a_graded_size_was_not_worn():
    """Its own size keeps how it was worn."""
    found = recover(fluted(), "auto", POPLIN, "skirt", Job()).pattern
    sizes, _ = grade(found, guess_rules(found)[0], "M", ["M", "L"])
    known = {panel.size: panel.placement.worn_at is not None for panel in sizes.panels}
    assert known == {"M": True, "L": False}
