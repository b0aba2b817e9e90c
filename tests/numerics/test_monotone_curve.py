"""The monotone cubic of a stretch curve, against scipy's, quadrature and finite differences."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad
from scipy.interpolate import PchipInterpolator

from vto_pipeline.errors import InputError
from vto_pipeline.numerics.mechanics.monotone_curve import MonotoneCurve, curve_at, monotone_curve

# A knit's rise: soft, then stiff; knots of uneven width.
STRAIN = np.array([0.0, 0.012, 0.03, 0.055, 0.06, 0.11, 0.2, 0.21])
STRESS = np.array([0.0, 0.9, 3.1, 8.0, 9.5, 31.0, 98.0, 140.0])


def sampled(curve: MonotoneCurve, strains: np.ndarray) -> np.ndarray:
    """Energy, stress, tangent, shape (N, 3)."""
    return np.array([curve_at(curve, float(e)) for e in strains])


def test_between_the_knots_it_is_the_cubic_of_scipy() -> None:
    peer = PchipInterpolator(STRAIN, STRESS)
    strains = np.linspace(0.0, STRAIN[-1], 1009)[:-1]
    found = sampled(monotone_curve(STRAIN, STRESS), strains)
    assert_allclose(found[:, 0], [peer.integrate(0.0, e) for e in strains], rtol=1e-11, atol=1e-15)  # rounding
    assert_allclose(found[:, 1], peer(strains), rtol=1e-12, atol=1e-13)  # rounding
    assert_allclose(found[:, 2], peer(strains, 1), rtol=1e-10)  # rounding, times the knots' ratio of widths


@pytest.mark.parametrize("power", [0.3, 1.0, 4.0])
def test_stress_is_the_derivative_of_the_energy_everywhere_and_tangent_that_of_the_stress(power: float) -> None:
    curve = monotone_curve(STRAIN, 100.0 * (STRAIN / STRAIN[-1]) ** power)
    strains = np.linspace(-0.1, 0.4, 2003)
    found = sampled(curve, strains)
    for strain, (energy, _, _) in zip(strains[::50], found[::50], strict=True):
        knots = sorted([0.0, strain, *(e for e in STRAIN if 0 < e < strain)])
        parts = [quad(lambda e: curve_at(curve, e)[1], a, b, epsabs=1e-13)[0] for a, b in pairwise(knots)]
        assert_allclose(energy, sum(parts) if strain > 0 else -sum(parts), rtol=1e-10, atol=1e-13)  # of quad
    h = 1e-7
    ahead, behind = sampled(curve, strains + h), sampled(curve, strains - h)
    smooth = np.abs(strains[:, None] - STRAIN).min(axis=1) > 2 * h
    assert_allclose((ahead[:, 1] - behind[:, 1])[smooth] / (2 * h), found[smooth, 2], rtol=2e-5)  # h² σ'''
    assert (found[:, 2] > 0).all()
    assert (np.diff(found[:, 1]) > 0).all()


def test_stress_and_tangent_are_continuous_at_every_knot_and_at_both_continuations() -> None:
    curve = monotone_curve(STRAIN, STRESS)
    below, above = sampled(curve, STRAIN - 1e-13), sampled(curve, STRAIN + 1e-13)
    assert_allclose(below, above, rtol=1e-8, atol=1e-8)  # 1e-13 of strain times σ'' of 1e5
    assert_allclose(curve_at(curve, -0.02), (0.5 * 0.02**2 * curve.slope[0], -0.02 * curve.slope[0], curve.slope[0]))
    assert curve_at(curve, 1.0)[2] == curve.slope[-1]


def test_two_points_make_a_spring() -> None:
    curve = monotone_curve([0.0, 0.1], [0.0, 50.0])
    assert_allclose(
        sampled(curve, np.array([-1.0, 0.05, 2.0])), [[250, -500, 500], [0.625, 25, 500], [1000, 1000, 500]]
    )


def test_a_start_with_no_secant_to_speak_of_still_has_a_tangent() -> None:
    """The parabola through the first three points falls at the origin, where scipy's end slope is zero."""
    strain, stress = [0.0, 0.1, 0.2], [0.0, 1.0, 50.0]
    assert PchipInterpolator(strain, stress)(0.0, 1) == 0.0
    assert_allclose(monotone_curve(strain, stress).slope[0], 0.1 * 10.0)  # a tenth of the first secant


@pytest.mark.parametrize(
    ("strain", "stress"),
    [
        ([0.0], [0.0]),
        ([0.0, 0.1], [0.0, 1.0, 2.0]),
        ([0.01, 0.1], [0.0, 1.0]),
        ([0.0, 0.1], [1.0, 2.0]),
        ([0.0, 0.1, 0.1], [0.0, 1.0, 2.0]),
        ([0.0, 0.1, 0.2], [0.0, 1.0, 1.0]),
        ([0.0, 0.1, 0.2], [0.0, 2.0, 1.0]),
        ([0.0, np.nan], [0.0, 1.0]),
        ([0.0, 0.1], [0.0, np.inf]),
    ],
)
@pytest.mark.filterwarnings("ignore:divide by zero:RuntimeWarning")
def test_what_is_no_curve_is_refused(strain: list[float], stress: list[float]) -> None:
    with pytest.raises(InputError):
        monotone_curve(strain, stress)
