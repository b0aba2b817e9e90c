"""Patterns as JSON: ours back whole, GarmentCode's as its formulas have it, and clear words for what is broken."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given, settings
from pattern_shapes import panels, rich_pattern

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.patterns.loops import edges_area
from vto_pipeline.io.patterns.read import read_pattern
from vto_pipeline.io.patterns.record import pattern_of, record_of
from vto_pipeline.io.patterns.write import write_pattern
from vto_pipeline.model.job import Job
from vto_pipeline.model.pattern import Pattern, Side
from vto_pipeline.numerics.plane_curves import curve_at, curve_length


def garment_code(**panel):
    """A square with 30 cm sides, in a document of GarmentCode."""
    corners = [[0, 0], [30, 0], [30, 30], [0, 30]]
    edges = [{"endpoints": [k, (k + 1) % 4]} for k in range(4)]
    one = {"vertices": corners, "edges": edges, "translation": [10, 20, 30], "rotation": [0, 0, 0], **panel}
    return {"pattern": {"panels": {"front": one}, "stitches": []}, "properties": {"units_in_meter": 100}}


def read(tmp_path, data, job=None):
    path = tmp_path / "p_specification.json"
    path.write_text(json.dumps(data))
    return read_pattern(path, job=job)


def test_our_json_comes_back_bit_for_bit(tmp_path):
    write_pattern(tmp_path / "a.json", rich_pattern())
    assert record_of(read_pattern(tmp_path / "a.json")) == record_of(rich_pattern())


@settings(max_examples=40, deadline=None)
@given(panels())
def test_any_panel_comes_back_from_its_record(panel):
    record = record_of(Pattern("any", (panel,)))
    assert record_of(pattern_of(json.loads(json.dumps(record)), "x")) == record


def test_units_and_placement(tmp_path):
    job = Job()
    data = garment_code(rotation=[90, 0, 90], label="body")
    pattern = read(tmp_path, data, job)
    (front,) = pattern.panels
    assert (pattern.name, front.name, front.notes) == ("p", "front", ("label: body",))
    assert edges_area(front.edges) == pytest.approx(0.09, rel=1e-12)
    assert front.placement.translation == pytest.approx([0.1, 0.2, 0.3])
    # a quarter turn about x takes y to z, then one about z takes x to y
    assert front.placement.rotation @ [1, 0, 0] == pytest.approx([0, 1, 0], abs=1e-12)
    assert front.placement.rotation @ [0, 1, 0] == pytest.approx([0, 0, 1], abs=1e-12)
    data["properties"] = {"units_in_meter": 300}
    assert edges_area(read(tmp_path, data).panels[0].edges) == pytest.approx(0.01, rel=1e-12)


def test_curves_relative_to_their_chord(tmp_path):
    edges = garment_code()["pattern"]["panels"]["front"]["edges"]
    edges[0]["curvature"] = [0.5, -0.2]
    edges[1]["curvature"] = {"type": "cubic", "params": [[0.2, -0.1], [0.8, 0.3]]}
    edges[2]["curvature"] = {"type": "circle", "params": [25.0, 0, 0]}
    edges[3]["curvature"] = {"type": "circle", "params": [25.0, 1, 1]}
    quadratic, cubic, left, right = read(tmp_path, garment_code(edges=edges)).panels[0].edges
    assert quadratic.points[1] == pytest.approx([0.15, -0.06])  # a fifth of the chord to its right
    assert cubic.points[1:3] == pytest.approx(np.array([[0.33, 0.06], [0.21, 0.24]]))
    half = np.arcsin(0.6)
    assert curve_length("arc", left.points, left.bulge) == pytest.approx(0.25 * 2.0 * half, rel=1e-9)
    assert curve_length("arc", right.points, right.bulge) == pytest.approx(0.25 * 2.0 * (np.pi - half), rel=1e-9)
    assert curve_at("arc", left.points, left.bulge, np.array([0.5]))[0] == pytest.approx([0.15, 0.25])  # inside
    assert curve_at("arc", right.points, right.bulge, np.array([0.5]))[0] == pytest.approx([-0.45, 0.15])  # far outside


def test_absolute_curvature(tmp_path):
    data = garment_code()
    data["pattern"]["panels"]["front"]["edges"][0]["curvature"] = [15, -6]
    data["properties"]["curvature_coords"] = "absolute"
    assert read(tmp_path, data).panels[0].edges[0].points[1] == pytest.approx([0.15, -0.06])


def test_a_panel_that_shows_its_wrong_side_is_flipped_and_stands_where_it_stood(tmp_path):
    edges = [{"endpoints": [k, (k + 3) % 4]} for k in (0, 3, 2, 1)]
    edges[0]["curvature"] = {"type": "circle", "params": [25.0, 0, 0]}
    data = garment_code(edges=edges, rotation=[10, 20, 30], vertices=[[0, 0], [30, 0], [25, 30], [0, 30]])
    (panel,) = read(tmp_path, data).panels
    assert edges_area(panel.edges) > 0.0
    placed = panel.placement
    first = np.array([edge.points[0] for edge in panel.edges]) @ placed.rotation[:, :2].T + placed.translation
    still = read(tmp_path, garment_code(rotation=[10, 20, 30])).panels[0].placement
    corners = np.array([[0, 0], [0, 0.3], [0.25, 0.3], [0.3, 0]])
    assert first == pytest.approx(corners @ still.rotation[:, :2].T + still.translation, abs=1e-12)
    assert np.linalg.det(placed.rotation) == pytest.approx(1.0)
    middle = curve_at("arc", panel.edges[0].points, panel.edges[0].bulge, np.array([0.5]))[0]
    assert middle @ placed.rotation[:, :2].T + placed.translation == pytest.approx(
        np.array([-0.05, 0.15]) @ still.rotation[:, :2].T + still.translation, abs=1e-12
    )  # clockwise in the file, so outside of the square


def test_stitches_run_against_each_other_unless_a_wrong_side_is_sewn(tmp_path):
    data = garment_code()
    panel = data["pattern"]["panels"]["front"]
    data["pattern"]["panels"]["back"] = panel
    ends = [{"panel": "front", "edge": 1}, {"panel": "back", "edge": 3}]
    data["pattern"]["stitches"] = [ends, [*ends, "right_wrong"]]
    plain, wrong = read(tmp_path, data).stitches
    assert (plain.first, plain.second) == ((Side("front", 1, True),), (Side("back", 3, False),))
    assert wrong.second == (Side("back", 3, True),)


def change(data, keys, value):
    at = data
    for key in keys[:-1]:
        at = at[key]
    at[keys[-1]] = value
    return data


FRONT = ("pattern", "panels", "front")


@pytest.mark.parametrize(
    ("keys", "value", "said"),
    [
        ((*FRONT, "edges", 2, "endpoints"), [2, 9], "panel front, edge 2"),
        ((*FRONT, "edges", 2, "endpoints"), [2, 0], "edge 2 ends 300 mm from the start of the next"),
        ((*FRONT, "edges", 1, "curvature"), {"type": "spline", "params": []}, "'spline'"),
        ((*FRONT, "edges", 1, "curvature"), {"type": "circle", "params": [0, 0, 0]}, "radius 0"),
        ((*FRONT, "edges", 1, "curvature"), [0.5, "x"], "edge 1"),
        ((*FRONT, "vertices"), [[0, 0], [1]], "vertices"),
        ((*FRONT, "rotation"), [0, 0], "rotation"),
        (("properties", "units_in_meter"), 0, "units_in_meter is 0"),
        (("pattern", "stitches"), [[{"panel": "front", "edge": 1}]], "stitch 0"),
        (("pattern", "stitches"), [[{"panel": "front", "edge": 1}, {"panel": "bak", "edge": 1}]], "no panel 'bak'"),
        (("pattern", "stitches"), [[{"panel": "front", "edge": 1}, {"panel": "front", "edge": 7}]], "none is 7"),
        (("pattern", "panels"), {}, "without panels"),
    ],
)
def test_what_is_broken_is_named(tmp_path, keys, value, said):
    with pytest.raises(FormatError) as raised:
        read(tmp_path, change(garment_code(), keys, value))
    assert said in str(raised.value)


def test_our_json_refuses_unknown_keys_and_outlines_that_run_clockwise(tmp_path):
    record = record_of(rich_pattern())
    for edit, said in (
        (lambda r: r["panels"][0].update(colour="red"), "panels.0.colour"),
        (lambda r: r.pop("unit"), "unit"),
        (lambda r: r["panels"][1]["edges"][1].update(bulge=-1.0), "clockwise"),
        (lambda r: r["panels"][0]["edges"][0]["points"].pop(), "edge 0 ends"),
    ):
        broken = json.loads(json.dumps(record))
        edit(broken)
        (tmp_path / "b.json").write_text(json.dumps(broken))
        with pytest.raises(FormatError, match=said):
            read_pattern(tmp_path / "b.json")
    (tmp_path / "b.json").write_text("{}")
    with pytest.raises(FormatError, match="neither"):
        read_pattern(tmp_path / "b.json")
    with pytest.raises(InputError, match="no size"):
        rich_pattern().of_size("XXL")
    assert [panel.size for panel in rich_pattern().of_size("L").panels] == ["L"]
    assert rich_pattern().of_size("L").stitches == ()
