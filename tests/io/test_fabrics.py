"""Fabrics: units at the door, presets with sources, what is assumed said."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest
from numpy.testing import assert_allclose

from vto_pipeline.errors import ConfigError
from vto_pipeline.io.fabrics import ASSUMED, preset_names, read_fabric
from vto_pipeline.model.fabric import Fabric

POPLIN = """\
name: poplin, measured
areal_density_gsm: 120
thickness_mm: 0.3
membrane: {warp: 1500, weft: 1200, shear: 60, poisson: 0.2}
bending:  {warp: 1.1e-5, weft: 0.9e-5, hysteresis: 1.0e-3}
friction: 0.3
source: where the figures come from
"""


def test_a_whole_file_is_converted_and_assumes_nothing(tmp_path: Path) -> None:
    (tmp_path / "poplin.yaml").write_text(POPLIN)
    fabric = read_fabric(tmp_path / "poplin.yaml")
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


def test_one_direction_given_serves_for_the_other() -> None:
    fabric = read_fabric({"areal_density_gsm": 100, "membrane": {"weft": 70.0}, "bending": {"weft": 2e-6}})
    assert (fabric.stretch_warp, fabric.bending_warp) == (70.0, 2e-6)
    assert fabric.shear == 35.0
    assert "stretch_weft" not in fabric.assumed
    assert "stretch_warp" in fabric.assumed


@pytest.mark.parametrize("name", preset_names())
def test_presets_are_complete_and_say_where_they_are_from(name: str) -> None:
    fabric = read_fabric(name)
    assert len(fabric.source) > 40
    assert 0.05 < fabric.areal_density < 0.6  # kg/m²: apparel
    assert 1e-4 < fabric.thickness < 2e-3
    assert 1e-7 < fabric.bending_warp < 1e-4
    assert "areal_density" not in fabric.assumed
    assert "thickness" not in fabric.assumed


def test_poplin_is_that_of_the_paper() -> None:
    """Fabric A of Matsudaira et al. 2015 in KES units: B 0.118 gf·cm²/cm, 2HB 0.124 gf·cm/cm, W 12.38 mg/cm²."""
    gram_force = 9.80665e-3  # N
    fabric = read_fabric("cotton_poplin")
    assert_allclose(fabric.bending_warp, 0.118 * gram_force * 1e-2, rtol=5e-4)  # the preset has four figures
    assert_allclose(fabric.bending_hysteresis, 0.124 * gram_force, rtol=5e-4)  # the same
    assert_allclose(fabric.areal_density, 12.38 * 1e-6 / 1e-4, rtol=1e-12)


def test_presets_the_documents_name_exist() -> None:
    assert {"cotton_poplin", "denim", "silk_charmeuse", "wool_suiting", "linen", "jersey"} <= set(preset_names())


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
    assert caught.value.problem == "'coton_poplin' is neither a preset nor a .yaml file"
    assert caught.value.hint == "did you mean cotton_poplin?"
