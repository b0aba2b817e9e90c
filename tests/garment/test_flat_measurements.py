"""Flat measurements: of patterns drawn to measure, and of templates of others whose parameters say what changes."""

from __future__ import annotations

import json

import numpy as np
import pytest
from size_shapes import FOREIGN, foreign, skirt, tee, trousers, with_parameter

from vto_pipeline.errors import ConfigError, GarmentError
from vto_pipeline.garment.sizes.flat import flat_measurements
from vto_pipeline.garment.sizes.rules import guess_rules, read_rules, rule_names
from vto_pipeline.garment.sizes.widths import width_at
from vto_pipeline.io.patterns.read import read_pattern
from vto_pipeline.io.patterns.write import write_pattern
from vto_pipeline.model.pattern import Pattern


def flat(pattern):
    return {name: one.value for name, one in flat_measurements(pattern, guess_rules(pattern)[0]).items()}


def test_a_t_shirt_measures_as_it_was_drawn():
    assert flat(tee()) == pytest.approx(
        {
            "chest": 0.48,
            "hem": 0.50,
            "length": 0.70,
            "shoulder": np.hypot(0.13, 0.03),
            "armhole_depth": 0.24,
            "sleeve": 0.21,
            "cuff": 0.17,
        }
    )
    assert flat(tee(sleeve=0.3, chest=0.6, cuff=0.1)) == pytest.approx(
        flat(tee()) | {"sleeve": 0.3, "chest": 0.6, "cuff": 0.1}
    )


def test_a_dart_is_no_part_of_the_waist():
    # 20 cm below the waist, the side is a third of the way to the hem
    assert flat(skirt()) == pytest.approx(
        {"waist": 0.36, "hem": 0.52, "length": 0.60, "hip": 2 * (0.19 + (0.26 - 0.19) / 3)}
    )


def test_trousers_measure_as_they_were_drawn():
    found = flat(trousers())
    inner = np.hypot(0.19 + 0.06 - 0.22, 0.72)
    hip = 2 * (0.19 + 0.06 * (1 - 0.075 / 0.28))
    assert found == pytest.approx(
        {"waist": 0.38, "hem": 0.22, "rise": 0.28, "inseam": inner, "thigh": 0.25, "hip": hip, "length": 1.0}
    )


def test_a_turned_panel_measures_the_same(tmp_path):
    """Without a place in space, and by way of DXF, whose grain line and stitches say it all."""
    write_pattern(tmp_path / "tee.dxf", tee())
    assert flat(read_pattern(tmp_path / "tee.dxf")) == pytest.approx(flat(tee()), abs=1e-5)


def test_width_at_a_level_leaves_gaps_out():
    u_shape = np.array([(0, 0), (5, 0), (5, 4), (4, 4), (4, 1), (1, 1), (1, 4), (0, 4)], dtype=float)
    assert [width_at(u_shape, level) for level in (0.5, 2.0)] == [5.0, 2.0]


def test_what_is_not_known_is_refused():
    with pytest.raises(GarmentError, match="does not show in its name"):
        guess_rules(Pattern("P1043", tee().panels))
    with pytest.raises(GarmentError, match="nothing of its seams"):
        flat_measurements(Pattern("tee", tee().panels), read_rules("top"))
    with pytest.raises(GarmentError, match="not sewn as a leg"):
        flat_measurements(skirt(), read_rules("trousers"))
    with pytest.raises(GarmentError, match="'left_sleeve': not a part of a trousers"):
        flat_measurements(tee(), read_rules("trousers"))
    with pytest.raises(ConfigError, match="neither a type of garment"):
        read_rules("tops")
    assert rule_names() == ("dress", "jumpsuit", "skirt", "top", "trousers")


TEMPLATES = sorted(FOREIGN.rglob("*.json"))
SAME_INSEAM = {"inseam": lambda was: was["inseam"]}
CHANGES = [
    # parameter, its value, measurement -> what it becomes, of the value before it [m]
    ("tee", "sllength", 30.0, {"sleeve": lambda was: was["sleeve"] + 0.1}),  # in units of a third of a centimetre
    ("tee", "wideness", 1.1, {"chest": lambda was: 1.1 * was["chest"], "hem": lambda was: 1.1 * was["hem"]}),
    ("tee", "low_wide", 1.2, {"hem": lambda was: 1.2 * was["hem"], "chest": lambda was: was["chest"]}),
    ("tee", "length", 1.2, {"length": lambda was: was["length"] + 0.2 * 0.45}),  # the side seam is 45 cm
    ("jacket", "length", 1.2, {"length": lambda was: was["length"] + 0.2 * 0.45}),
    ("jacket_hood", "wideness", 1.1, {"chest": lambda was: 1.1 * was["chest"]}),
    ("pants_straight_sides", "length", 10.0, {"length": lambda was: was["length"] + 0.1}),
    (
        "pants_straight_sides",
        "crotch_depth",
        4.0,
        # it lifts the upper edge
        {"rise": lambda was: was["rise"] + 0.04, "length": lambda was: was["length"] + 0.04} | SAME_INSEAM,
    ),
    ("skirt_8_panels", "wideness", 1.5, {"hem": lambda was: 1.5 * was["hem"], "waist": lambda was: was["waist"]}),
    ("wb_dress_sleeveless", "wb_thickness", 1.5, {"length": lambda was: was["length"] + 0.02}),
    ("wb_dress_sleeveless", "top_wideness", 1.2, {"chest": lambda was: 1.2 * was["chest"]}),
]


@pytest.mark.real_data
@pytest.mark.skipif(not TEMPLATES, reason="shared data absent")
@pytest.mark.parametrize(("name", "parameter", "value", "becomes"), CHANGES, ids=lambda one: str(one)[:16])
def test_a_parameter_of_a_template_changes_the_measure_it_is_named_after(name, parameter, value, becomes):
    (path,) = (path for path in TEMPLATES if path.stem == name)
    template = json.loads(path.read_text())
    before, after = (flat(foreign(data, name)) for data in (template, with_parameter(template, parameter, value)))
    for measure, expected in becomes.items():
        assert after[measure] == pytest.approx(expected(before), abs=1e-6), measure


@pytest.mark.real_data
@pytest.mark.skipif(not TEMPLATES, reason="shared data absent")
def test_all_templates_of_others_are_measured():
    found = {path.stem: flat(foreign(json.loads(path.read_text()), path.stem)) for path in TEMPLATES}
    assert len(found) == 23
    # its top seam runs from -10 to 25 units of a third of a centimetre; the cap bulges 1.5 cm beyond
    assert found["tee"]["sleeve"] == pytest.approx(35 / 300)
    assert all("length" in one and ("chest" in one or "waist" in one) for one in found.values())
    assert all(0.1 < value < 1.5 for one in found.values() for name, value in one.items() if name != "shoulder")
