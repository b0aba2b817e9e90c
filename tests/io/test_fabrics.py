"""Fabrics: units at the door, presets with sources, what is assumed said."""

from __future__ import annotations

import dataclasses
from math import degrees
from pathlib import Path
from typing import Any

import pytest
from numpy.testing import assert_allclose

from vto_pipeline.errors import ConfigError
from vto_pipeline.io.fabric_formats.assumed import ASSUMED, assumption_notes
from vto_pipeline.io.fabrics import preset_names, read_fabric
from vto_pipeline.model.fabric import Fabric, StretchCurve

POPLIN = """\
name: poplin, measured
areal_density_gsm: 120
thickness_mm: 0.3
membrane: {warp: 1500, weft: 1200, shear: 60, poisson: 0.2}
bending:  {warp: 1.1e-5, weft: 0.9e-5, hysteresis: 1.0e-3}
friction: 0.3
source: where the figures come from
"""

LOSSES = """\
areal_density_gsm: 100
membrane:
  hysteresis: 0.4
  shear_hysteresis: 0.6
  curve_warp: [[0.01, 5.0], [0.02, 98.0665]]
  curve_weft: [[0, 0], [0.5, 20]]
damping_s: 0.002
assumed: [areal_density]
"""


def test_a_whole_file_is_converted(tmp_path: Path) -> None:
    (tmp_path / "poplin.yaml").write_text(POPLIN)
    fabric = read_fabric(tmp_path / "poplin.yaml")
    assert fabric.assumed == ("stretch_hysteresis", "shear_hysteresis", "damping")
    fabric = dataclasses.replace(fabric, assumed=(), stretch_hysteresis=0.0, damping=0.0)
    expected = Fabric(
        "poplin, measured",
        0.12,
        0.3e-3,
        1500,
        1200,
        60,
        0.2,
        1.1e-5,
        0.9e-5,
        1.0e-3,
        0.3,
        "where the figures come from",
    )
    for field in dataclasses.fields(Fabric):
        ours, theirs = getattr(fabric, field.name), getattr(expected, field.name)
        if isinstance(theirs, float | int):
            assert_allclose(ours, theirs, rtol=1e-15)  # one multiplication
        else:
            assert ours == theirs


def test_mass_alone_is_enough_and_the_rest_is_named() -> None:
    fabric = read_fabric({"areal_density_gsm": 100})
    assert fabric.areal_density == pytest.approx(0.1, rel=1e-15)
    assert fabric.assumed == tuple(ASSUMED)
    # What the table of reasons promises, in SI: within the ranges it names.
    assert 0.1 / 653 < fabric.thickness < 0.1 / 249
    assert 588 < fabric.stretch_warp < 6571
    assert 338 < fabric.stretch_weft < 3560
    assert 30 < fabric.shear < 80
    assert 0.07 < fabric.poisson < 0.38
    bending_length = (fabric.bending_warp / (0.1 * 9.80665)) ** (1 / 3)
    assert 0.012 < bending_length < 0.025
    assert 37 < fabric.bending_hysteresis / fabric.bending_warp < 105
    assert 0.07 < fabric.stretch_hysteresis / 4.903325 < 0.17  # 5 gf/cm [N/m]


def test_one_direction_given_serves_for_the_other() -> None:
    fabric = read_fabric({"areal_density_gsm": 100, "membrane": {"weft": 70.0}, "bending": {"weft": 2e-6}})
    assert (fabric.stretch_warp, fabric.bending_warp) == (70.0, 2e-6)
    assert fabric.shear == 35.0
    assert "stretch_weft" not in fabric.assumed
    assert "stretch_warp" in fabric.assumed


def test_curves_and_losses(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(LOSSES)
    fabric = read_fabric(tmp_path / "a.yaml")
    assert fabric.curve_warp == StretchCurve((0.0, 0.01, 0.02), (0.0, 5.0, 98.0665))  # the origin is put before it
    assert fabric.curve_weft == StretchCurve((0.0, 0.5), (0.0, 20.0))
    assert_allclose((fabric.stretch_warp, fabric.stretch_weft), (98.0665 / 0.02, 40.0), rtol=1e-14)  # rounding
    assert (fabric.stretch_hysteresis, fabric.shear_hysteresis, fabric.damping) == (0.4, 0.6, 0.002)
    assert fabric.assumed[0] == "areal_density"  # as the file itself says
    assert not {"stretch_warp", "stretch_hysteresis", "damping"} & set(fabric.assumed)


def test_the_user_is_told_what_was_not_measured_and_what_was_worked_out(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text("name: lawn\n" + LOSSES)
    assumed, *derived = assumption_notes(read_fabric(tmp_path / "a.yaml"))
    assert assumed.startswith("lawn: assumed, not measured: areal_density 100 g/m², thickness 0.222 mm, shear 20 N/m, ")
    assert "stretch" not in assumed
    assert derived == [
        "lawn: stretch_warp: secant of curve_warp from 0 to 98.1 N/m",
        "lawn: stretch_weft: secant of curve_weft from 0 to 20 N/m",
    ]
    (named,) = assumption_notes(read_fabric({"areal_density_gsm": 100}))
    assert all(name in named for name in ASSUMED)
    measured = dataclasses.replace(read_fabric("cotton_poplin"), assumed=())
    assert assumption_notes(measured) == ()


def in_the_trade_s_units(fabric: Fabric) -> dict[str, Any]:
    """What a fabric file of this fabric would hold."""
    curves = {name: getattr(fabric, name) for name in ("curve_warp", "curve_weft")}
    return {
        "name": fabric.name,
        "areal_density_gsm": fabric.areal_density * 1e3,
        "thickness_mm": fabric.thickness * 1e3,
        "membrane": {
            "warp": fabric.stretch_warp,
            "weft": fabric.stretch_weft,
            "shear": fabric.shear,
            "poisson": fabric.poisson,
            "hysteresis": fabric.stretch_hysteresis,
            "shear_hysteresis": fabric.shear_hysteresis,
            "elongation_warp": fabric.elongation_warp,
            "elongation_weft": fabric.elongation_weft,
            "shear_angle_deg": None if fabric.shear_angle is None else degrees(fabric.shear_angle),
            **{name: list(zip(c.strain, c.tension, strict=True)) for name, c in curves.items() if c is not None},
        },
        "bending": {
            "warp": fabric.bending_warp,
            "weft": fabric.bending_weft,
            "hysteresis": fabric.bending_hysteresis,
        },
        "friction": fabric.friction,
        "damping_s": fabric.damping,
        "source": fabric.source,
        "assumed": list(fabric.assumed),
    }


@pytest.mark.parametrize("name", preset_names())
def test_a_preset_written_out_in_full_is_the_same_fabric(name: str) -> None:
    fabric = read_fabric(name)
    again = read_fabric(in_the_trade_s_units(fabric))
    for field in dataclasses.fields(Fabric):
        ours, theirs = getattr(again, field.name), getattr(fabric, field.name)
        if isinstance(theirs, float):
            assert_allclose(ours, theirs, rtol=1e-15)  # there and back
        else:
            assert ours == theirs


@pytest.mark.parametrize("name", preset_names())
def test_presets_are_complete_and_say_where_they_are_from(name: str) -> None:
    fabric = read_fabric(name)
    assert len(fabric.source) > 40
    assert 0.05 < fabric.areal_density < 0.6  # kg/m²: apparel
    assert 1e-4 < fabric.thickness < 3e-3
    assert 1e-7 < fabric.bending_warp < 1e-4
    # Where no measured one was read, the preset says so itself.
    assert ("areal_density" in fabric.assumed) == (name in ("satin", "fleece", "leather"))
    assert ("thickness" in fabric.assumed) == (name in ("satin", "fleece"))


@pytest.mark.parametrize(
    ("name", "rigidity", "hysteresis", "mass", "thickness"),
    [
        ("cotton_poplin", 0.118, 0.124, 12.38, 0.497),
        ("wool_suiting", 0.067, 0.033, 16.29, 0.407),
        ("polyester_suiting", 0.077, 0.029, 11.65, 0.340),
        ("polyester_faille", 0.019, 0.007, 10.43, 0.226),
    ],
)
def test_presets_are_those_of_the_paper(
    name: str, rigidity: float, hysteresis: float, mass: float, thickness: float
) -> None:
    """Fabrics A, B, C, F of Matsudaira et al. 2015 in KES units: gf·cm²/cm, gf·cm/cm, mg/cm², mm."""
    fabric = read_fabric(name)
    sheet = read_fabric({"instrument": "KES-FB", "W": mass, "T0": thickness, "B": rigidity, "2HB": hysteresis})
    for field in ("bending_warp", "bending_weft", "bending_hysteresis"):
        assert_allclose(getattr(fabric, field), getattr(sheet, field), rtol=5e-4)  # the preset has four figures
    gram_force = 9.80665e-3  # N
    assert_allclose(fabric.bending_warp, rigidity * gram_force * 1e-2, rtol=5e-4)  # the same
    assert_allclose(fabric.bending_hysteresis, hysteresis * gram_force, rtol=5e-4)  # the same
    assert_allclose(fabric.areal_density, mass * 1e-6 / 1e-4, rtol=1e-12)
    assert_allclose(fabric.thickness, thickness * 1e-3, rtol=1e-12)


def test_presets_the_documents_name_exist() -> None:
    named = {"cotton_poplin", "denim", "silk_charmeuse", "wool_suiting", "linen", "jersey"}
    assert named | {"polyester_suiting", "fleece", "satin", "leather", "cupro_lining"} <= set(preset_names())


@pytest.mark.parametrize(
    ("text", "problem", "line", "hint"),
    [
        (POPLIN.replace("areal_density_gsm", "areal_density"), "areal_density_gsm: field required", None, ""),
        (POPLIN + "colour: red\n", "colour: unknown key (got 'red')", 8, None),
        (POPLIN.replace("weft: 1200", "wetf: 1200"), "membrane.wetf: unknown key (got 1200)", 4, "did you mean weft?"),
        (POPLIN.replace("120\n", "-120\n"), "areal_density_gsm: input should be greater than or equal to 1", 2, ""),
        (POPLIN.replace("0.3\nmem", "300\nmem"), "thickness_mm: input should be less than or equal to 50", 3, ""),
        (POPLIN.replace("0.2}", "stiff}"), "membrane.poisson: input should be a valid number", 4, ""),
        (POPLIN.replace("friction: 0.3", "friction: .nan"), "friction: input should be", 6, ""),
        (LOSSES.replace("[0.01, 5.0]", "[0.03, 5.0]"), "membrane.curve_warp: stretch curve: strain must incr", 5, ""),
        (LOSSES.replace("[0.5, 20]", "[0.5, 0]"), "membrane.curve_weft: stretch curve: tension must incr", 6, ""),
        (LOSSES.replace("[0.5, 20]", "[0.5]"), "membrane.curve_weft.1.1: field required", 6, ""),
        (LOSSES.replace("[0.5, 20]", "[0.5, -20]"), "membrane.curve_weft.1.1: input should be greater", 6, ""),
        (LOSSES.replace("[areal_density]", "[mass]"), "assumed: mass is not a value in this file", 8, None),
    ],
)
def test_a_wrong_file_is_named_with_its_line(
    tmp_path: Path, text: str, problem: str, line: int | None, hint: str | None
) -> None:
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(ConfigError) as caught:
        read_fabric(tmp_path / "a.yaml")
    assert problem in caught.value.problem
    assert line is None or caught.value.where.endswith(f"line {line}")
    assert hint is None or caught.value.hint == hint


def test_a_misspelt_preset_gets_a_suggestion() -> None:
    with pytest.raises(ConfigError) as caught:
        read_fabric("coton_poplin")
    assert (
        caught.value.problem == "'coton_poplin' is neither a preset nor a file of type .yaml, .yml, .json, .csv, .u3m"
    )
    assert caught.value.hint == "did you mean cotton_poplin?"
