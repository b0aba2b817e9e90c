"""Patterns for the cutter: cut lines by closed form and distance, notches that meet, files as others read them."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from itertools import pairwise
from xml.etree import ElementTree

import numpy as np
import pytest
from ezdxf import recover

from vto_pipeline.bench.samples.patterns.tape import Tape
from vto_pipeline.bench.samples.patterns.wardrobe import PATTERNS
from vto_pipeline.errors import ConfigError
from vto_pipeline.garment.pattern.finish import finished
from vto_pipeline.io.patterns.loops import edges_area, edges_points
from vto_pipeline.io.patterns.read import PARSERS
from vto_pipeline.io.patterns.record import pattern_of, record_of
from vto_pipeline.io.patterns.write import SUFFIXES, write_pattern
from vto_pipeline.model.pattern import Edge, Panel, Pattern, Side, Stitch

ALLOWANCE = 0.012
TAPES = {"S": Tape(1.66, 0.86, 0.70, 0.92), "L": Tape(1.85, 1.08, 0.94, 1.06)}


def rectangle(name, width, height):
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=float)
    return Panel(name, tuple(Edge("polyline", corners[[k, (k + 1) % 4]]) for k in range(4)))


def of_two_sizes(name):
    """Return a sample pattern in two sizes, its edges named, with all that a cutter needs."""
    panels, stitches = [], ()
    for size, tape in TAPES.items():
        pattern = PATTERNS[name](tape)
        stitches = pattern.stitches
        for panel in pattern.panels:
            edges = tuple(replace(edge, label=f"{panel.name} {k}") for k, edge in enumerate(panel.edges))
            panels.append(replace(panel, edges=edges, size=size, notes=("QUANTITY: 1", "Größe, 2×")))
    return finished(Pattern(name, tuple(panels), stitches), ALLOWANCE)


def to_polyline(places, line):
    """Distance of places from a polyline, by brute force."""
    best = np.full(len(places), np.inf)
    for a, b in pairwise(line):
        share = np.clip((places - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(a + share[:, None] * (b - a) - places, axis=1))
    return best


def parsed(path):
    """Read a pattern without a process of its own for the parser."""
    return pattern_of(json.loads(str(PARSERS[path.suffix](str(path), "")["pattern"])), path.name)


def dense(line):
    """Points of a polyline, and eight between each two."""
    return np.concatenate([a + np.linspace(0.0, 1.0, 9, endpoint=False)[:, None] * (b - a) for a, b in pairwise(line)])


def shoelace(points):
    x, y = np.asarray(points).T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def test_cut_lines_by_closed_form():
    (cut,) = (panel.cut for panel in finished(Pattern("r", (rectangle("r", 0.3, 0.4),)), 0.01).panels)
    assert len(cut) == 4
    assert edges_area(cut) == pytest.approx(0.32 * 0.42, rel=1e-9)
    ends = np.array([[-0.2, 0.0], [0.2, 0.0]])
    disc = Panel("d", (Edge("polyline", ends), Edge("arc", ends[::-1], 1.0)))
    (round_cut,) = (panel.cut for panel in finished(Pattern("d", (disc,)), 0.01).panels)
    # a half disc of the larger radius, and a strip below it: where the arc ends it stands upright on the chord
    assert edges_area(round_cut) == pytest.approx(0.5 * np.pi * 0.21**2 + 0.01 * 0.42, rel=1e-4)


def test_notches_of_both_sides_meet_when_it_is_sewn():
    # one edge of 40 cm against 10 and 30 cm, and sides that run against each other
    wide, left, right = rectangle("wide", 0.4, 0.3), rectangle("left", 0.1, 0.2), rectangle("right", 0.3, 0.2)
    seam = Stitch((Side("wide", 2, False),), (Side("left", 0), Side("right", 0)))
    made = {panel.name: panel for panel in finished(Pattern("p", (wide, left, right), (seam,)), ALLOWANCE).panels}
    found = {name: sorted(n.position.tolist() for n in panel.notches) for name, panel in made.items()}
    assert found["wide"] == pytest.approx(np.array([[0.1, 0.3 + ALLOWANCE], [0.2, 0.3 + ALLOWANCE]]))
    assert found["left"] == []  # its end is where the notch at a quarter goes
    assert found["right"] == pytest.approx(np.array([[0.1, -ALLOWANCE]]))  # 10 cm on from the end of the other
    (notch,) = made["right"].notches
    assert (notch.angle, notch.depth) == (pytest.approx(np.pi / 2), pytest.approx(0.5 * ALLOWANCE))
    assert made["wide"].grain == pytest.approx(np.array([[0.2, 0.03], [0.2, 0.27]]))


def test_what_a_panel_has_stays_and_no_allowance_is_refused():
    ready = finished(Pattern("r", (rectangle("r", 0.3, 0.4),)), 0.01)
    assert record_of(finished(ready, 0.02)) == record_of(ready)
    for wrong in (0.0, -0.01, 0.2):
        with pytest.raises(ConfigError, match="seam allowance"):
            finished(ready, wrong)


@pytest.mark.parametrize("name", PATTERNS)
def test_cut_lines_lie_outside_by_the_allowance(name):
    for panel in of_two_sizes(name).panels:
        outline, cut = (edges_points(edges, 1e-5) for edges in (panel.edges, panel.cut))
        away = to_polyline(dense(cut), outline)
        assert away.min() == pytest.approx(ALLOWANCE, abs=2e-5)
        assert away.max() <= 2.0 * ALLOWANCE + 1e-5
        assert to_polyline(dense(outline), cut).min() >= ALLOWANCE - 2e-5
        assert all(to_polyline(n.position[None], cut) < 1e-4 for n in panel.notches)
        assert len(panel.notches) >= 2
        assert panel.grain[0, 0] == panel.grain[1, 0]


@pytest.mark.parametrize("name", PATTERNS)
def test_nothing_is_lost_in_files(name, tmp_path):
    pattern = of_two_sizes(name)
    for suffix in SUFFIXES:
        write_pattern(tmp_path / f"p{suffix}", pattern)
        back = parsed(tmp_path / f"p{suffix}")
        assert (back.name, back.sizes, back.stitches) == (pattern.name, pattern.sizes, pattern.stitches)
        for now, was in zip(back.panels, pattern.panels, strict=True):
            assert (now.name, now.size, now.notes) == (was.name, was.size, was.notes)
            assert [edge.label for edge in now.edges] == [edge.label for edge in was.edges]
            for a, b in ((now.edges, was.edges), (now.cut, was.cut)):
                assert len(a) == len(b)
                for one, other in zip(a, b, strict=True):
                    assert one.points[[0, -1]] == pytest.approx(other.points[[0, -1]], abs=1e-9)
                a, b = (edges_points(edges, 1e-5) for edges in (a, b))
                assert max(to_polyline(a, b).max(), to_polyline(b, a).max()) < 3e-5
            assert now.grain == pytest.approx(was.grain, abs=1e-12)
            assert now.placement.translation == pytest.approx(was.placement.translation, abs=1e-12)
            for one, other in zip(now.notches, was.notches, strict=True):
                assert one.position == pytest.approx(other.position, abs=1e-12)
                assert (one.kind, one.depth) == (other.kind, pytest.approx(other.depth))
                assert one.angle == pytest.approx(other.angle, abs=1e-9)


def test_ezdxf_and_an_xml_parser_find_all_of_it(tmp_path):
    pattern = of_two_sizes("tee")
    for suffix in SUFFIXES:
        write_pattern(tmp_path / f"p{suffix}", pattern)
    document, auditor = recover.readfile(tmp_path / "p.dxf")
    assert not auditor.has_errors
    blocks = [document.blocks.get(insert.dxf.name) for insert in document.modelspace().query("INSERT")]
    groups = ElementTree.parse(tmp_path / "p.svg").getroot().findall("{http://www.w3.org/2000/svg}g")
    for panel, block, group in zip(pattern.panels, blocks, groups, strict=True):
        cut, outline = (1e3 * edges_points(edges, 1e-5)[:-1] for edges in (panel.cut, panel.edges))
        for layer, line in ((1, cut), (14, outline)):
            (drawn,) = block.query(f'POLYLINE[layer=="{layer}"]')
            points = np.array([(v.dxf.location.x, v.dxf.location.y) for v in drawn.vertices])
            assert drawn.is_closed
            assert shoelace(points) == pytest.approx(shoelace(line), rel=1e-6)
        notches = np.array([1e3 * n.position for n in panel.notches])
        points = [p.dxf.location for p in block.query('POINT[layer=="4"]')]
        assert np.array([(p.x, p.y) for p in points]) == pytest.approx(notches)
        (grain,) = block.query('LINE[layer=="7"]')
        assert [*grain.dxf.start, *grain.dxf.end] == pytest.approx([*1e3 * panel.grain[0], 0, *1e3 * panel.grain[1], 0])
        words = [text.dxf.text for text in block.query("TEXT")]
        assert {f"PIECE NAME: {panel.name}", f"SIZE: {panel.size}", *panel.notes} <= set(words)
        paths = [path.get("d") for path in group.iter("{http://www.w3.org/2000/svg}path")]
        ends = np.array([[float(x) for x in re.findall(r"[-\d.e]+", path)[:2]] for path in paths])
        corners = np.array([panel.edges[0].points[0], panel.cut[0].points[0], panel.grain[0]])
        expected = 1e3 * np.concatenate([corners, [n.position for n in panel.notches]]) * [1, -1]
        assert ends == pytest.approx(expected)
        straight = [path for path in paths if "A" not in path and "C" not in path and "Q" not in path]
        assert len(straight) == len(paths) - 1 if any(e.kind != "polyline" for e in panel.edges) else len(paths)
        assert group.find("{http://www.w3.org/2000/svg}text").text == f"{panel.name} {panel.size}"
    said = json.loads((tmp_path / "p.json").read_text())
    assert [one["cut"][0]["points"][0] for one in said["panels"]] == [
        p.cut[0].points[0].tolist() for p in pattern.panels
    ]
