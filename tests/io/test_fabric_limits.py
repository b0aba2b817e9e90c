"""How far a fabric's threads are known to bear being stretched: as the sources say, and nowhere made up."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.errors import ConfigError, InputError
from vto_pipeline.io.fabric_formats.curves import trellis_angle
from vto_pipeline.io.fabrics import preset_names, read_fabric
from vto_pipeline.model.fabric import Fabric

ANALYSER = Path("/work/shared/reference/data/u3m_fab_tensile_summary.csv")

LOCKS = {"canvas": (0.11, 0.067), "denim": (0.28, 0.28), "silk_charmeuse": (0.41, 0.34), "wool_coating": (0.5, 0.62)}
"""Largest Green strains of weft and warp, in the inputs of Li, Kaufman, Jiang 2021."""
STRAIN_LIMITS = {"cotton_plain": 1.0608, "wool_plain": 1.085, "wool_elastane": 1.134, "polyester_plain": 1.0646}
"""Largest stretch of the fabrics of Penava et al. 2014, in the same."""
TESTED = {"cupro_lining", "jersey", "stretch_twill"}


def limits(fabric: Fabric) -> list[float | None]:
    return [fabric.elongation_warp, fabric.elongation_weft]


@pytest.mark.parametrize("name", LOCKS)
def test_where_a_published_model_locks(name: str) -> None:
    """Threads of that stretch have its Green strain, ½ (FᵀF - 1)."""
    weft, warp = (1.0 + known for known in reversed(limits(read_fabric(name))))
    green = 0.5 * (np.diag([weft, warp]).T @ np.diag([weft, warp]) - np.eye(2))
    assert_allclose(np.diag(green), LOCKS[name], rtol=0, atol=1e-4)  # the preset has four figures


@pytest.mark.parametrize("name", STRAIN_LIMITS)
def test_strain_limits_of_published_inputs(name: str) -> None:
    assert_allclose(limits(read_fabric(name)), STRAIN_LIMITS[name] - 1.0, rtol=1e-9)


@pytest.mark.parametrize("more", [{}, {"LT": {"warp": 0.6, "weft": 0.8}}])
def test_a_sheet_s_extension_is_what_threads_bear(more: dict[str, object]) -> None:
    """Fabric M1 of Mahnić Naglić et al. 2025, tables 1 and 2: with linearity a curve is made, without it a secant."""
    sheet = read_fabric({"instrument": "KES-FB", "W": 22.658, "EMT": {"warp": 1.73, "weft": 11.18}} | more)
    assert_allclose(limits(sheet), [0.0173, 0.1118], rtol=1e-12)
    assert_allclose(limits(read_fabric("stretch_twill")), limits(sheet), rtol=1e-12)


@pytest.mark.real_data
@pytest.mark.skipif(not ANALYSER.exists(), reason="the analyser's measurements are not at hand")
@pytest.mark.parametrize(("name", "measured"), [("cupro_lining", "SU-1098"), ("jersey", "Shirley")])
def test_measured_threads_bear_what_they_were_drawn_to(name: str, measured: str) -> None:
    """The last cycle's greatest strain at a gauge of 8 cm; on the bias, a square of threads becomes a rhombus."""
    rows = [line.split(",") for line in ANALYSER.read_text().splitlines() if line.startswith(measured)]
    most = {row[1]: float(row[6]) / 100.0 for row in rows if row[2] == "S2" and row[3] == "4"}
    fabric = read_fabric(name)
    assert_allclose(limits(fabric), [most["L"], most["W"]], rtol=0, atol=1e-4)  # curves have four figures
    if name == "jersey":  # its bias is drawn farther than the diagonal of any rhombus: the threads were stretched
        assert fabric.shear_angle is None
    else:
        half = 0.25 * np.pi - 0.5 * fabric.shear_angle  # between a side of the rhombus and its long diagonal
        assert_allclose(np.sqrt(2.0) * np.cos(half), 1.0 + most["B"], rtol=0, atol=1e-3)


def test_nothing_is_made_up_where_no_source_says_it() -> None:
    known = set(LOCKS) | set(STRAIN_LIMITS) | TESTED
    for name in preset_names():
        fabric = read_fabric(name)
        assert [one is not None for one in limits(fabric)] == [name in known] * 2
        assert (fabric.shear_angle is not None) == (name == "cupro_lining")
    assert limits(read_fabric({"areal_density_gsm": 100})) == [None, None]


def test_a_curve_s_end_serves_where_no_limit_is_stated() -> None:
    curve = {"curve_warp": [[0.01, 5.0], [0.04, 98.0]], "elongation_weft": 0.2}
    assert limits(read_fabric({"areal_density_gsm": 100, "membrane": curve})) == [0.04, 0.2]
    stated = read_fabric({"areal_density_gsm": 100, "membrane": {**curve, "elongation_warp": 0.1}})
    assert limits(stated) == [0.1, 0.2]


@pytest.mark.parametrize("angle", [0.1, 0.5, 1.2])
def test_the_angle_of_threads_in_a_strip_on_the_bias(angle: float) -> None:
    """Two threads of a square, brought nearer to its diagonal by half the angle each."""
    turns = 0.25 * np.pi + np.array([0.5, -0.5]) * (0.5 * np.pi - angle)
    diagonal = np.linalg.norm(np.stack([np.cos(turns), np.sin(turns)]).sum(axis=1))
    assert trellis_angle(float(diagonal / np.sqrt(2.0) - 1.0)) == pytest.approx(angle, abs=1e-12)


def test_longer_than_any_diagonal_is_no_angle() -> None:
    assert trellis_angle(0.42) is None


@pytest.mark.parametrize("value", [0.0, -0.1, 11.0])
def test_no_limit_without_sense(value: float) -> None:
    with pytest.raises(ConfigError, match="elongation_warp"):
        read_fabric({"areal_density_gsm": 100, "membrane": {"elongation_warp": value}})
    with pytest.raises(InputError, match="elongation_warp"):
        Fabric("x", 0.1, 1e-3, 1, 1, 1, 0, 0, 0, 0, 0, elongation_warp=value)
