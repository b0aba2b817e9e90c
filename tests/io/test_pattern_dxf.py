"""DXF patterns: files of other programs, built by ezdxf or by hand, and ours as ezdxf reads them."""

from __future__ import annotations

import json
from dataclasses import replace

import ezdxf
import numpy as np
import pytest
from ezdxf import recover
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pattern_shapes import Foreign, half_disc, outline, panels, rich_pattern, shoelace

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.patterns.dxf.read import parse_dxf
from vto_pipeline.io.patterns.loops import edges_area, edges_length, edges_points
from vto_pipeline.io.patterns.read import read_pattern
from vto_pipeline.io.patterns.record import pattern_of
from vto_pipeline.io.patterns.write import write_pattern
from vto_pipeline.model.job import Job
from vto_pipeline.model.pattern import Edge, InnerLine, Notch, Panel, Pattern, Side, Stitch

SQUARE = [(0, 0), (300, 0), (300, 400), (0, 400)]


def one(path, job=None, **options):
    (panel,) = read_pattern(path, job=job, **options).panels
    return panel


def tags(*pairs):
    """Text of a DXF file from codes and values, as sparse as Gerber's are."""
    return "\n".join(f"{code:>3}\n{value}" for code, value in pairs) + "\n"


def polyline(layer, *points):
    head = [(0, "POLYLINE"), (8, layer), (66, 1), (70, 0)]
    rows = [pair for x, y in points for pair in ((0, "VERTEX"), (8, layer), (10, x), (20, y))]
    return [*head, *rows, (0, "SEQEND"), (8, layer)]


def gerber(*entities, name="FR_42", words=("Piece Name: FR", "SIZE: 42")):
    """A file without header or tables: open polylines from corner to corner, joined by nobody."""
    texts = [pair for w in words for pair in ((0, "TEXT"), (8, 1), (10, 1.0), (20, 1.0), (40, 0.25), (1, w))]
    start = [(0, "SECTION"), (2, "HEADER"), (0, "ENDSEC"), (0, "SECTION"), (2, "BLOCKS")]
    block = [(0, "BLOCK"), (8, 0), (2, name), (70, 64), (10, 0.0), (20, 0.0), *texts]
    end = [(0, "ENDBLK"), (0, "ENDSEC"), (0, "SECTION"), (2, "ENTITIES"), (0, "INSERT"), (8, 1), (2, name)]
    close = [(10, 0.0), (20, 0.0), (0, "TEXT"), (8, 1), (10, 0.0), (20, 0.0), (1, "UNITS: METRIC"), (0, "ENDSEC")]
    inner = [pair for entity in entities for pair in entity]
    return tags(*start, *block, *inner, *end, *close, (0, "EOF"))


def test_a_half_of_open_lines_is_joined_and_opened_at_its_fold(tmp_path):
    curve = [(200.0, 0.0), (203.0, 100.0), (203.0, 100.0), (199.0, 200.0), (180.0, 300.0)]
    text = gerber(
        polyline(1, *curve),
        polyline(1, (0.0, 320.0), (180.0, 300.0)),  # against the others
        polyline(1, (0.0, 320.0), (0.0, 0.0)),
        polyline(1, (0.0, 0.0), (200.0, 0.0)),
        [(0, "LINE"), (8, 6), (10, 0.0), (20, 0.0), (11, 0.0), (21, 320.0)],
        [(0, "LINE"), (8, 7), (10, 50.0), (20, 10.0), (11, 50.0), (21, 200.0)],
        [(0, "LINE"), (8, 5), (10, 50.0), (20, 10.0), (11, 50.0), (21, 200.0)],
        [(0, "POINT"), (8, 4), (10, 203.0), (20, 100.0), (50, 170.0), (39, 4.0)],
        [(0, "POINT"), (8, 13), (10, 40.0), (20, 60.0)],
    )
    (tmp_path / "g.dxf").write_text(text)
    job = Job()
    panel = one(tmp_path / "g.dxf", job)
    half = shoelace(np.array([(0, 0), *curve, (0, 320)]))
    assert edges_area(panel.edges) == pytest.approx(2e-6 * half, rel=1e-9)
    assert (panel.name, panel.size, len(panel.edges)) == ("FR", "42", 6)
    points = edges_points(panel.edges, 1e-3)
    assert points.min(axis=0) == pytest.approx([-0.203, 0.0])
    assert panel.grain == pytest.approx(np.array([[0.05, 0.01], [0.05, 0.2]]))
    left, right = sorted(panel.notches, key=lambda notch: notch.position[0])
    assert (left.position, right.position) == (pytest.approx([-0.203, 0.1]), pytest.approx([0.203, 0.1]))
    ten = np.deg2rad(10.0)
    assert (np.cos(left.angle), np.sin(left.angle)) == (pytest.approx(np.cos(ten)), pytest.approx(np.sin(ten)))
    assert (np.cos(right.angle), np.sin(right.angle)) == (pytest.approx(-np.cos(ten)), pytest.approx(np.sin(ten)))
    assert right.depth == pytest.approx(0.004)
    assert sorted(panel.drills.tolist()) == pytest.approx(np.array([[-0.04, 0.06], [0.04, 0.06]]))
    assert any("opened at its mirror line" in note for note in job.notes)
    assert any("layer 5" in note and "grade reference" in note for note in job.notes)


@pytest.mark.parametrize(
    ("texts", "header", "scale", "unit", "how"),
    [
        (("UNITS: METRIC",), None, 1.0, "mm", "text"),
        (("Units: English",), None, 1 / 25.4, "in", "text"),
        ((), 5, 0.1, "cm", "$INSUNITS"),
        ((), None, 1.0, "mm", "guessed"),
        (("UNITS: FURLONG",), None, 1.0, "mm", "guessed"),
    ],
)
def test_the_unit_is_found(tmp_path, texts, header, scale, unit, how):
    file = Foreign(*texts, version="R2000")
    file.document.header["$INSUNITS"] = header or 0
    outline(file.block("A"), scale * np.array(SQUARE))
    pattern = read_pattern(file.save(tmp_path / "u.dxf"))
    assert edges_area(pattern.panels[0].edges) == pytest.approx(0.12, rel=1e-9)
    assert pattern.unit.startswith(f"{unit}, ")
    assert how in pattern.unit


def test_a_unit_that_could_be_two_is_asked_for(tmp_path):
    file = Foreign()
    outline(file.block("A"), np.array(SQUARE) / 10.0)  # 40 cm or 40 in
    path = file.save(tmp_path / "u.dxf")
    with pytest.raises(InputError, match="fits cm and in") as raised:
        read_pattern(path)
    assert "--unit" in raised.value.hint
    assert edges_area(one(path, unit="cm").edges) == pytest.approx(0.12, rel=1e-9)
    twice = Foreign("UNITS: METRIC", "UNITS: ENGLISH")
    outline(twice.block("A"), SQUARE)
    with pytest.raises(FormatError, match="ENGLISH, METRIC"):
        read_pattern(twice.save(tmp_path / "t.dxf"))


def test_sizes_in_blocks_and_names_that_are_there_twice(tmp_path):
    file = Foreign("UNITS: METRIC")
    for run in ("REGULAR", "TALL"):
        for size in ("S", "M"):
            block = file.block(f"FRONT_{size}_{run}", "PIECE NAME: FRONT", f"SIZE: {size}", "QUANTITY: 2")
            outline(block, SQUARE)
    outline(file.block("BACK_S", "PIECE NAME: BACK", "SIZE: S"), SQUARE)
    job = Job()
    pattern = read_pattern(file.save(tmp_path / "s.dxf"), job=job)
    assert pattern.sizes == ("S", "M")
    assert [p.name for p in pattern.of_size("S").panels] == ["FRONT_S_REGULAR", "FRONT_S_TALL", "BACK"]
    assert pattern.panels[0].notes == ("QUANTITY: 2",)
    assert sum("named after the block" in note for note in job.notes) == 4


def test_corners_end_edges_and_turn_points_do_so_where_there_are_any(tmp_path):
    turns = np.linspace(0.0, np.pi, 31)
    arch = [(150 + 150 * np.cos(t), 400 + 150 * np.sin(t)) for t in turns]
    for points, count in (((), 2), ([(0, 0), (300, 0), arch[10], arch[20]], 4), ([(0, 0), arch[30]], 2)):
        file = Foreign("UNITS: METRIC")
        block = file.block("A")
        outline(block, [(0, 0), (300, 0), *arch])
        for point in points:
            block.add_point(point, dxfattribs={"layer": "2"})
        panel = one(file.save(tmp_path / "c.dxf"))
        assert len(panel.edges) == count
        assert edges_length(panel.edges) == pytest.approx(1.1 + 0.15 * np.pi, rel=1e-3)  # 30 chords for an arc


def test_splines_arcs_bulges_and_nested_blocks(tmp_path):
    file = Foreign("UNITS: METRIC", version="R2000")
    block = file.block("A")
    on_one = {"layer": "1"}
    block.add_lwpolyline([(0, 0, 0, 0, 0), (300, 0, 0, 0, 1.0), (300, 400, 0, 0, 0)], dxfattribs=on_one)
    block.add_arc((150, 400), 150, 0, 180, dxfattribs=on_one)
    inner = file.document.blocks.new("SIDE")
    inner.add_open_spline([(0, 0), (20, 50), (-20, 150), (0, 200)], dxfattribs={"layer": "0"})
    block.add_blockref("SIDE", (0, 0), dxfattribs={"layer": "1", "xscale": 2, "yscale": 2})
    panel = one(file.save(tmp_path / "n.dxf"))
    discs = 0.5 * np.pi * (200**2 + 150**2)
    assert edges_area(panel.edges) == pytest.approx(1e-6 * (300 * 400 + discs), rel=1e-6)  # the spline's bows cancel
    assert sorted(edge.shape for edge in panel.edges) == ["arc", "arc", "cubic", "straight"]


def test_a_seam_line_is_the_outline_and_the_boundary_the_cut(tmp_path):
    file = Foreign("UNITS: METRIC")
    block = file.block("A")
    outline(block, [(-10, -10), (310, -10), (310, 410), (-10, 410)])
    outline(block, SQUARE, 14)
    outline(block, [(50, 50), (80, 50), (80, 80)], 11)
    outline(block, [(0, 200), (300, 200)], 8, closed=False)
    outline(block, SQUARE, 84)
    job = Job()
    panel = one(file.save(tmp_path / "w.dxf"), job)
    assert edges_area(panel.edges) == pytest.approx(0.12, rel=1e-9)
    assert edges_area(panel.cut) == pytest.approx(0.32 * 0.42, rel=1e-9)
    assert [line.kind for line in panel.lines] == ["internal", "cutout"]
    assert any("layer 84" in note for note in job.notes)


def test_doubled_lines_count_once(tmp_path):
    file = Foreign("UNITS: METRIC")
    block = file.block("A")
    for start, end in zip(SQUARE, SQUARE[1:] + SQUARE[:1], strict=True):
        block.add_line(start, end, dxfattribs={"layer": "1"})
    block.add_line(SQUARE[1], SQUARE[0], dxfattribs={"layer": "1"})
    job = Job()
    assert edges_area(one(file.save(tmp_path / "d.dxf"), job).edges) == pytest.approx(0.12, rel=1e-9)
    assert any("block A: LINE" in note and "repeats" in note for note in job.notes)


def broken_open(file):
    outline(file.block("SLEEVE_M"), SQUARE, closed=False)


def broken_branch(file):
    block = file.block("SLEEVE_M")
    for end in ((300, 0), (0, 300), (300, 300)):
        block.add_line((0, 0), end, dxfattribs={"layer": "1"})


def broken_two(file):
    block = file.block("SLEEVE_M")
    outline(block, SQUARE)
    outline(block, np.add(SQUARE, (500, 0)))


def broken_circle(file):
    outline(file.block("SLEEVE_M"), SQUARE)
    file.document.blocks.get("SLEEVE_M").add_blockref("SLEEVE_M", (0, 0))


def broken_layer(file):
    outline(file.block("SLEEVE_M"), SQUARE, 3)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (broken_open, r"open: begun with POLYLINE #\w+, it ends at \(0.0, 400.0\) mm, 400.00 mm from its start"),
        (broken_branch, r"branches near \(0.0, 0.0\) mm: LINE"),
        (broken_two, r"two outlines on layer 1; POLYLINE #\w+ begins the second"),
        (broken_circle, r"SLEEVE_M"),
        (broken_layer, r"no block has an outline on layer 1"),
    ],
)
def test_what_cannot_be_a_panel_is_refused_with_block_and_entity(tmp_path, spoil, said):
    file = Foreign("UNITS: METRIC")
    spoil(file)
    with pytest.raises(FormatError, match=said) as raised:
        read_pattern(file.save(tmp_path / "b.dxf"))
    if spoil not in (broken_layer, broken_circle):
        assert "block SLEEVE_M" in raised.value.where


def test_garbage_is_refused(tmp_path):
    for data in (b"no DXF at all\n" * 9, b"\0\1\2" * 50, b"  0\nSECTION\n  2\nENTITIES\n  0\nEOF\n"):
        (tmp_path / "g.dxf").write_bytes(data)
        with pytest.raises(FormatError):
            read_pattern(tmp_path / "g.dxf")


def test_ours_as_ezdxf_reads_it(tmp_path):
    pattern = Pattern("disc", (half_disc(0.3, "left", -1.0), half_disc(0.2, "right", 1.0)))
    write_pattern(tmp_path / "o.dxf", pattern)
    assert (tmp_path / "o.dxf").read_bytes().isascii()
    document, auditor = recover.readfile(tmp_path / "o.dxf")
    assert not auditor.has_errors
    assert "UNITS: METRIC" in [text.dxf.text for text in document.modelspace().query("TEXT")]
    inserts = document.modelspace().query("INSERT")
    for insert, radius in zip(inserts, (300.0, 200.0), strict=True):
        block = document.blocks.get(insert.dxf.name)
        (line,) = block.query('POLYLINE[layer=="1"]')
        points = np.array([(v.dxf.location.x, v.dxf.location.y) for v in line.vertices])
        assert line.is_closed
        assert shoelace(points) == pytest.approx(0.5 * np.pi * radius**2, rel=1e-4)  # flat to a hundredth of a mm
        assert len(block.query('POINT[layer=="2"]')) == 2
        assert len(block.query('POINT[layer=="3"]')) == len(points) - 2


def test_all_that_dxf_holds_comes_back(tmp_path):
    write_pattern(tmp_path / "r.dxf", rich_pattern())
    back = read_pattern(tmp_path / "r.dxf")
    assert (back.name, back.stitches) == (rich_pattern().name, rich_pattern().stitches)
    for now, was in zip(back.panels, rich_pattern().panels, strict=True):
        assert (now.name, now.size, now.notes) == (was.name, was.size, was.notes)
        assert (now.placement is None) == (was.placement is None)
        if was.placement is not None:
            assert now.placement.rotation == pytest.approx(was.placement.rotation, abs=1e-9)
            assert now.placement.translation == pytest.approx(was.placement.translation, abs=1e-12)
        assert len(now.edges) == len(was.edges)
        assert len(now.cut) == len(was.cut)
        for a, b in zip((*now.edges, *now.cut), (*was.edges, *was.cut), strict=True):
            assert a.points[0] == pytest.approx(b.points[0], abs=1e-9)
            assert edges_length([a]) == pytest.approx(edges_length([b]), abs=2e-5)
        assert [line.kind for line in now.lines] == [line.kind for line in was.lines]
        if was.grain is not None:
            assert now.grain == pytest.approx(was.grain)
            assert now.drills == pytest.approx(was.drills)
        for a, b in zip(now.notches, was.notches, strict=True):
            assert a.position == pytest.approx(b.position)
            assert (a.kind, a.depth) == (b.kind, pytest.approx(b.depth))
            assert a.angle == (None if b.angle is None else pytest.approx(b.angle))


@settings(max_examples=25, deadline=None)
@given(panels())
def test_any_outline_comes_back(tmp_path_factory, panel):
    path = tmp_path_factory.mktemp("any") / "a.dxf"
    write_pattern(path, Pattern("any", (panel,)))
    (back,) = pattern_of(json.loads(str(parse_dxf(str(path), "")["pattern"])), "a").panels
    assert len(back.edges) == len(panel.edges)
    assert edges_area(back.edges) == pytest.approx(edges_area(panel.edges), abs=1e-5 * edges_length(panel.edges))
    assert ezdxf.readfile(path).dxfversion


WORDS = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=12).filter(
    lambda text: text == text.strip() and ":" not in text
)


@settings(max_examples=30, deadline=None)
@given(WORDS, WORDS, WORDS)
@example("a\nb", "\U0001f600 x", "\\U+0041 \\M+1 %%d ^J")
@example("^", "^ ^", "a^")
def test_any_words_come_back(tmp_path_factory, name, label, note):
    path = tmp_path_factory.mktemp("words") / "a.dxf"
    (first, *rest) = half_disc(0.3, name).edges
    panel = Panel(name, (replace(first, label=label), *rest), size=label, notes=(note,))
    write_pattern(path, Pattern(name, (panel,), (Stitch((Side(name, 0),), (Side(name, 1),)),)))
    assert path.read_bytes().isascii()
    back = pattern_of(json.loads(str(parse_dxf(str(path), "")["pattern"])), "a")
    (now,) = back.panels
    assert (back.name, now.name, now.size, now.notes) == (name, name, label, (note,))
    assert [edge.label for edge in now.edges] == [label, ""]
    assert back.stitches[0].first == (Side(name, 0),)


def test_notches_and_sewing_lines_keep_their_kind(tmp_path):
    kinds = [("slit", 0.0), ("v", np.pi), ("v", None), ("t", -0.5)]
    notches = tuple(Notch(np.array([0.1 * k, 0.0]), angle, 0.003, kind) for k, (kind, angle) in enumerate(kinds))
    pocket = np.array([[0.0, 0.1], [0.05, 0.1], [0.05, 0.15], [0.0, 0.1]])
    lines = (InnerLine("sew", (Edge("polyline", pocket),)), InnerLine("sew", (Edge("polyline", pocket[:3] - 0.05),)))
    disc = half_disc(0.3)
    plain = Panel("plain", disc.edges, notches=notches, lines=lines)
    wide = Panel("wide", disc.edges, lines=lines, cut=half_disc(0.35).edges)
    write_pattern(tmp_path / "k.dxf", Pattern("k", (plain, wide)))
    for now, was in zip(read_pattern(tmp_path / "k.dxf").panels, (plain, wide), strict=True):
        assert [(n.kind, n.angle) for n in now.notches] == [
            (n.kind, None if n.angle is None else pytest.approx(n.angle)) for n in was.notches
        ]
        assert [len(line.curves[0].points) for line in now.lines if line.kind == "sew"] == [4, 3]
        assert edges_area(now.edges) == pytest.approx(0.5 * np.pi * 0.3**2, rel=1e-4)
        assert bool(now.cut) == bool(was.cut)
