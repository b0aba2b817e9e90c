"""vto pattern."""

from __future__ import annotations

import json
from pathlib import Path

import ezdxf
import numpy as np
import pytest

RADIUS_CM = 10.0


def write_discs(path: Path, chord_cm: float = 2 * RADIUS_CM) -> None:
    """Two half discs of GarmentCode, sewn along arc and chord, the second with another chord."""
    panels = {}
    for name, chord in (("left", 2 * RADIUS_CM), ("right", chord_cm)):
        edges = [
            {"endpoints": [0, 1]},
            {"endpoints": [1, 0], "curvature": {"type": "circle", "params": [RADIUS_CM, 0, 1]}},
        ]
        panels[name] = {"vertices": [[0, 0], [chord, 0]], "edges": edges}
    stitches = [[{"panel": "left", "edge": k}, {"panel": "right", "edge": k}] for k in (0, 1)]
    path.write_text(json.dumps({"pattern": {"panels": panels, "stitches": stitches}, "properties": {}}))


def test_panels_and_seams_are_measured(vto):
    write_discs(Path("discs.json"), 12.0)
    said = vto("pattern", "discs.json", "--json")
    assert said.code == 0
    left, _ = said.data["panels"]
    assert left["area_cm2"] == pytest.approx(0.5 * np.pi * RADIUS_CM**2, rel=1e-6)
    assert left["outline_mm"] == pytest.approx(10 * RADIUS_CM * (2 + np.pi), rel=1e-6)
    assert left["edges"] == {"straight": 1, "arc": 1}
    chord, arc = said.data["seams"]
    assert (chord["mismatch_mm"], chord["mismatch_share"]) == (pytest.approx(-80.0), pytest.approx(0.4))
    assert arc["lengths_mm"] == pytest.approx([100 * np.pi, 200 * np.arcsin(0.6)], rel=1e-6)
    lines = vto("pattern", "discs.json").out
    assert "-80.0 mm, 40.0%" in lines
    assert "100 units a metre, assumed" in lines


def test_a_pattern_is_made_ready_for_the_cutter(vto):
    write_discs(Path("discs.json"))
    said = vto("pattern", "discs.json", "--allowance", "10", "-o", "cut.dxf", "--json")
    assert said.code == 0
    assert [one["seam_allowance_mm"] for one in said.data["panels"]] == [pytest.approx(10.0, abs=0.05)] * 2
    blocks = [block for block in ezdxf.readfile("cut.dxf").blocks if block.name.startswith("P")]
    assert [len(block.query(f'*[layer=="{layer}"]')) for block in blocks for layer in (4, 7, 14)] == [2, 1, 1] * 2
    wrong = vto("pattern", "discs.json", "--allowance", "-3")
    assert (wrong.code, "a seam allowance of -3 mm" in wrong.err) == (2, True)
    assert vto("pattern", "discs.json", "--allowance", "10", "--sizes", "S,M").code == 2


def test_a_drawing_is_sewn_by_a_plan(vto):
    head = 'xmlns="http://www.w3.org/2000/svg" width="500mm" height="500mm" viewBox="0 0 500 500"'
    Path("d.svg").write_text(f'<svg {head}><path id="body" d="M0,0 L400,0 L400,300 L0,300 Z"/></svg>')
    said = vto("pattern", "d.svg").out
    assert "no stitches in the file" in said
    edges = [line.split() for line in said.splitlines() if line.startswith("body") and "straight" in line]
    lengths = {row[2]: row[1] for row in edges if len(row) > 6 and row[1].isdigit()}
    assert set(lengths) == {"400.0", "300.0"}
    panels = "{front: {of: body, at_m: [0, 1.0]}, back: {of: body, at_m: [0, 1.0]}}"
    sides = [row[1] for row in edges if row[2] == "300.0" and row[1].isdigit()]
    seams = [f"{{first: [front {a}], second: [back {b}]}}" for a, b in (sides, sides[::-1])]
    Path("p.yaml").write_text(f"schema: 1\npanels: {panels}\nseams: [{', '.join(seams)}]\n")
    made = vto("pattern", "d.svg", "--plan", "p.yaml", "-o", "tube.json", "--json")
    assert [seam["lengths_mm"] for seam in made.data["seams"]] == [pytest.approx([300.0, 300.0])] * 2
    assert [one["placement"]["translation"][2] for one in json.loads(Path("tube.json").read_text())["panels"]] == [
        pytest.approx(0.15),
        pytest.approx(-0.15),
    ]
    Path("p.yaml").write_text(f"schema: 1\npanels: {panels}\nseams: [{{first: [front 9], second: [back 0]}}]\n")
    refused = vto("pattern", "d.svg", "--plan", "p.yaml")
    assert refused.code == 3
    assert "front 9" in refused.err
    assert "p.yaml" in refused.err
    assert vto("pattern", "d.svg", "--plan", "p.yaml", "--sizes", "S,M").code == 2


def test_one_size_is_written_and_nothing_overwritten(vto):
    document = ezdxf.new("R12")
    document.modelspace().add_text("UNITS: METRIC")
    for size, side in (("S", 300), ("M", 320)):
        block = document.blocks.new(f"FRONT_{size}")
        block.add_text(f"SIZE: {size}", dxfattribs={"layer": "1"})
        block.add_polyline2d([(0, 0), (side, 0), (0, side)], close=True, dxfattribs={"layer": "1"})
    document.saveas("f.dxf")
    assert vto("pattern", "f.dxf", "--size", "M", "-o", "m.svg").code == 0
    assert [p["area_cm2"] for p in vto("pattern", "m.svg", "--json").data["panels"]] == pytest.approx([512.0])
    assert vto("pattern", "f.dxf", "--size", "XL").code == 3
    before = Path("f.dxf").read_bytes()
    assert vto("pattern", "f.dxf", "-o", "./f.dxf").code == 2
    assert Path("f.dxf").read_bytes() == before
    assert vto("pattern", "f.dxf", "-o", "f.pdf").code == 2
    assert vto("pattern", "f.dxf", "--unit", "in", "--json").data["unit"] == "in, as requested"


def test_a_folder_gives_a_row_for_each_file(vto):
    Path("all/deep").mkdir(parents=True)
    write_discs(Path("all/deep/discs.json"), 12.0)
    Path("all/bad.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg" width="9mm" viewBox="0 0 9 9"/>')
    said = vto("pattern", "all", "--json")
    assert said.code == 0
    bad, good = said.data["files"]
    assert "no line is a panel" in bad["refused"]
    assert (good["panels"], good["stitches"]) == (2, 2)
    assert good["worst_mismatch_mm"] == pytest.approx(200 * (np.pi / 2 - np.arcsin(0.6)), rel=1e-6)
    shown = vto("pattern", "all").out
    assert "refused" in shown
    assert "deep/discs.json" in shown
    assert "all/deep" not in shown
    Path("none").mkdir()
    assert vto("pattern", "none").code == 3
    assert vto("pattern", "all", "-o", "x.svg").code == 2


def write_skirt(path: Path) -> None:
    """Two trapezoids of GarmentCode, 36 cm wide at the waist, 50 cm at the hem, 60 cm long, sewn along their sides."""
    corners = [[-25, 0], [25, 0], [18, 60], [-18, 60]]
    edges = [{"endpoints": [k, (k + 1) % 4]} for k in range(4)]
    panels = {name: {"vertices": corners, "edges": edges} for name in ("front", "back")}
    stitches = [[{"panel": "front", "edge": a}, {"panel": "back", "edge": 4 - a}] for a in (1, 3)]
    path.write_text(json.dumps({"pattern": {"panels": panels, "stitches": stitches}, "properties": {}}))


def test_flat_measurements_are_printed_where_the_type_is_known(vto):
    write_skirt(Path("skirt.json"))
    flat = vto("pattern", "skirt.json", "--json").data["flat"]
    assert (flat["type"], flat["because"]) == ("skirt", "'skirt' is in its name")
    measured = {name: one["mm"] for name, one in flat["sizes"][""].items()}
    assert measured == pytest.approx({"waist": 360, "hem": 500, "hip": 360 + 140 / 3, "length": 600})
    assert "waist       360.0   upper edge of front, back, half of it" in vto("pattern", "skirt.json").out
    assert vto("info", "skirt.json", "--json").data["flat_waist_m"] == pytest.approx(0.36)
    Path("skirt.json").rename("P1043.json")
    assert "unknown" in vto("pattern", "P1043.json", "--json").data["flat"]
    assert "state it with --type" in vto("pattern", "P1043.json").out
    assert vto("pattern", "P1043.json", "--type", "skirt", "--json").data["flat"]["because"] == "as stated"
    assert vto("pattern", "P1043.json", "--type", "trousers").code == 4
    assert vto("pattern", "P1043.json", "--type", "skort").code == 2


def test_sizes_are_written_with_their_chart(vto):
    write_skirt(Path("skirt.json"))
    said = vto("pattern", "skirt.json", "--sizes", "L,S", "-o", "run", "--format", "dxf", "--json")
    assert said.code == 0
    assert [Path(one).name for one in said.data["written"]] == ["skirt_S.dxf", "skirt_L.dxf", "size_chart.json"]
    chart = json.loads(Path("run/size_chart.json").read_text())
    waists = {size: row["flat_mm"]["waist"] for size, row in chart["sizes"].items()}
    assert waists == pytest.approx({"S": 360 - 40, "L": 360 + 42.5}, abs=0.1)  # EN 13402: bust 86 and 102.5, M 94 cm
    read = vto("pattern", "run/skirt_L.dxf", "--json").data["flat"]["sizes"]["L"]
    assert read["waist"]["mm"] == pytest.approx(402.5, abs=0.1)
    Path("tape.yaml").write_text("measurements: {waist_girth: 79}\n")  # the waist of L is 80.5 cm
    assert vto("advise", "run/size_chart.json", "--measurements", "tape.yaml", "--json").data["best"] == "L"
    assert "at most 0.0 mm from what the rules ask for" in vto("pattern", "skirt.json", "--sizes", "S,M").out
    assert vto("pattern", "skirt.json", "--sizes", "S", "-o", "skirt.json").code == 2


def write_tube(path: Path, radius: float = 0.15, height: float = 0.4, around: int = 60, up: int = 16) -> None:
    angle = 2.0 * np.pi * np.arange(around) / around
    with path.open("w") as stream:
        for k in range(up + 1):
            for a in angle:
                stream.write(f"v {radius * np.sin(a):.6f} {height * k / up:.6f} {radius * np.cos(a):.6f}\n")
        for k in range(up):
            for i in range(around):
                a, b = k * around + i + 1, k * around + (i + 1) % around + 1
                stream.write(f"f {a} {b} {b + around}\nf {a} {b + around} {a + around}\n")


def test_a_garment_in_space_becomes_a_pattern(vto):
    write_tube(Path("skirt.obj"))
    said = vto("pattern", "skirt.obj", "-o", "flat.json", "-o", "flat.svg", "-o", "flat.dxf", "-o", "p.obj", "--json")
    assert said.code == 0
    assert said.data["written"] == ["flat.json", "flat.svg", "flat.dxf", "p.obj"]
    half = 60 * 0.15 * np.sin(np.pi / 60)
    assert [one["area_cm2"] for one in said.data["laid_flat"]] == pytest.approx([1e4 * half * 0.4] * 2, rel=2e-3)
    assert said.data["flat"]["sizes"][""]["hem"]["mm"] == pytest.approx(1e3 * half, rel=3e-3)
    assert len(said.data["seams"]) == 2
    for name in ("flat.json", "flat.svg", "flat.dxf"):
        again = vto("pattern", name, "--json").data
        assert [p["area_cm2"] for p in again["panels"]] == pytest.approx([1e4 * half * 0.4] * 2, rel=2e-3)
    lines = vto("pattern", "p.obj").out
    assert "panels at true scale" in lines
    assert "stretch left" in lines


def test_a_garment_that_cannot_come_apart_is_refused(vto):
    write_tube(Path("skirt.obj"))
    Path("seams.yaml").write_text("schema: 1\nseams:\n  - {name: far, points: [[2, 0, 0], [2, 1, 0]]}\n")
    Path("broken.yaml").write_text("schema: 1\nseams: 3\n")
    assert vto("pattern", "skirt.obj", "--seams", "seams.yaml").code == 4
    assert vto("pattern", "skirt.obj", "--seams", "broken.yaml").code == 3
    assert vto("pattern", "skirt.obj", "--seams", "somewhere").code == 2
    assert vto("pattern", "skirt.obj", "--seams", "charts").code == 3
    assert vto("pattern", "skirt.obj", "-o", "skirt.obj").code == 2
    assert vto("pattern", "skirt.obj", "-o", "a.pdf").code == 2
    assert vto("pattern", "skirt.obj", "--size", "M").code == 2
