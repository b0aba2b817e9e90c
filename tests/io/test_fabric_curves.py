"""Stretch curves: measured samples made monotone, power laws of a sheet, secants; the real curves of two fabrics."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.errors import InputError
from vto_pipeline.io.fabric_formats.curves import hysteresis_share, measured_curve, power_law, secant_stiffness
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.model.fabric import StretchCurve
from vto_pipeline.numerics.mechanics.monotone_curve import curve_at, monotone_curve

DATA = Path(__file__).parents[3] / "shared" / "reference" / "data"
CURVES, SUMMARY = DATA / "u3m_fab_tensile_curves.csv", DATA / "u3m_fab_tensile_summary.csv"


def test_a_noisy_knit_comes_back_without_its_slack_and_its_load_cell_s_zero() -> None:
    """T = 300 ε + 900 ε², a load cell that reads 0.9 N/m when slack, and noise of 0.1 N/m."""
    rng = np.random.default_rng(5)
    strain = np.concatenate([np.linspace(-0.02, 0.0, 40), np.linspace(0.001, 0.4, 600)])
    stretched = np.maximum(strain, 0.0)
    truth = 300 * stretched + 900 * stretched**2
    noisy = rng.permutation(len(strain))  # and in any order
    curve = measured_curve(strain[noisy], (truth + 0.9 + rng.normal(0, 0.1, len(strain)))[noisy])
    knots = np.array(curve.strain)
    assert 20 < len(knots) <= 49
    assert knots[-1] == 0.4
    assert_allclose(curve.tension, 300 * knots + 900 * knots**2, atol=0.4)  # four standard deviations of the noise


def test_a_machine_s_flat_stretches_and_repeated_samples_leave_a_rising_curve() -> None:
    strain = np.repeat(np.linspace(-0.01, 0.1, 30), 3)
    tension = np.floor(100 * np.maximum(strain, 0)) * 2.0  # steps
    curve = measured_curve(strain, tension)
    assert np.all(np.diff(curve.strain) > 0)
    assert np.all(np.diff(curve.tension) > 0)
    monotone_curve(curve.strain, curve.tension)  # accepts it


@pytest.mark.parametrize(
    ("strain", "tension"),
    [([-0.1, 0.0, 0.1], [0.0, 0.0, 1.0]), ([0.1, 0.2, 0.3], [0.0, 0.0, 0.0]), ([0.1, 0.2, 0.3], [3.0, 1.0, -9.0])],
)
def test_what_never_rises_is_refused(strain: list[float], tension: list[float]) -> None:
    with pytest.raises(InputError):
        measured_curve(np.array(strain), np.array(tension))


@pytest.mark.parametrize("linearity", [0.4, 0.65, 1.0, 1.3])
def test_a_power_law_has_the_energy_that_the_sheet_states(linearity: float) -> None:
    """WT = LT ½ Fmax EMT, Kawabata 1980."""
    curve = power_law(0.05, 490.0, linearity)
    energy, stress, _ = curve_at(monotone_curve(curve.strain, curve.tension), 0.05)
    assert_allclose(energy, linearity * 0.5 * 490.0 * 0.05, rtol=3e-3)  # 17 knots of a cubic
    assert stress == 490.0


def test_the_secant_is_of_100_gf_per_cm_or_of_the_curve_s_end() -> None:
    strong = StretchCurve((0.0, 0.02, 0.04), (0.0, 98.0665, 400.0))
    assert_allclose(secant_stiffness(strong), (98.0665 / 0.02, 98.0665), rtol=1e-14)  # rounding
    weak = StretchCurve((0.0, 0.5), (0.0, 40.0))
    assert_allclose(secant_stiffness(weak), (80.0, 40.0), rtol=1e-14)  # rounding


def test_the_lost_share_is_that_of_lt_and_rt() -> None:
    """T = ε² up and ε³ down on [0, 1]: LT 2/3, RT 3/4."""
    strain = np.linspace(0, 1, 2001)
    assert_allclose(hysteresis_share(strain, strain**2, strain**3), 0.5 * 2 / 3 * (1 - 3 / 4), rtol=1e-6)  # trapezoids


@pytest.mark.parametrize(
    ("strain", "tension"),
    [
        ((0.0,), (0.0,)),
        ((0.0, 1.0), (0.0,)),
        ((0.0, 0.1, 0.1), (0.0, 1.0, 2.0)),
        ((0.1, 0.2), (0.0, 1.0)),
        ((0.0, 0.1), (0.0, float("nan"))),
        ((0.0, float("nan")), (0.0, 1.0)),
        ((0.0, 0.1), (0.0, float("inf"))),
    ],
)
def test_a_curve_that_does_not_rise_from_the_origin_is_none(strain: tuple[float], tension: tuple[float]) -> None:
    with pytest.raises(InputError):
        StretchCurve(strain, tension)


def real_loading(fabric: str, direction: str) -> np.ndarray:
    """Strain and tension of the fourth cycle, gauge 8 cm, shape (N, 2)."""
    with CURVES.open(newline="") as stream:
        rows = [row for row in csv.reader(stream) if row[0].startswith(fabric) and row[1] == direction]
    return np.array([row[7:9] for row in rows if row[3:5] == ["4", "loading"]], dtype=float)


@pytest.mark.real_data
@pytest.mark.skipif(not CURVES.exists(), reason="the data folder is absent")
@pytest.mark.parametrize("direction", ["L", "W", "B"])
@pytest.mark.parametrize("fabric", ["Shirley", "SU-1098"])
def test_real_curves_reproduce_the_strains_at_standard_loads(fabric: str, direction: str) -> None:
    """The summary names the first of all samples at or above a load; the curves keep every second to fifth sample."""
    with SUMMARY.open(newline="") as stream:
        (summary,) = [r for r in csv.reader(stream) if r[0].startswith(fabric) and r[1:4] == [direction, "S2", "4"]]
    samples = real_loading(fabric, direction)
    curve = measured_curve(samples[:, 0], samples[:, 1])
    spacing = np.diff(samples[:, 0]).max()
    assert spacing < 0.12 * samples[-1, 0]
    checked = 0
    for load, percent in zip((4.903325, 19.6133, 98.0665), summary[7:10], strict=True):
        if not percent:
            continue
        cubic = monotone_curve(curve.strain, curve.tension)
        strains = np.linspace(0, curve.strain[-1] + spacing, 20001)
        reached = strains[np.searchsorted([curve_at(cubic, e)[1] for e in strains], load)]
        assert_allclose(reached, float(percent) / 100, atol=spacing)
        checked += 1
    assert checked >= 2


@pytest.mark.real_data
@pytest.mark.skipif(not CURVES.exists(), reason="the data folder is absent")
@pytest.mark.parametrize(("preset", "fabric"), [("jersey", "Shirley"), ("cupro_lining", "SU-1098")])
def test_the_curves_of_the_presets_are_the_real_ones(preset: str, fabric: str) -> None:
    stored = read_fabric(preset)
    for direction, curve in (("L", stored.curve_warp), ("W", stored.curve_weft)):
        assert curve is not None
        cubic = monotone_curve(curve.strain, curve.tension)
        strain, tension = real_loading(fabric, direction).T
        found = np.array([curve_at(cubic, e)[1] for e in strain[strain > 0]])
        # a fifth of the samples are knots; the load cell reads up to 0.9 N/m when slack
        assert_allclose(found, tension[strain > 0], atol=0.015 * tension[-1] + 0.5)
