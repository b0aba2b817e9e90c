"""Stretch curves: from test samples or from a sheet's summary, and their linear models."""

from __future__ import annotations

import numpy as np

from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.fabric import StretchCurve
from vto_pipeline.units import GRAVITY

GRAM_FORCE = GRAVITY / 1000.0
"""[N]; the textile instruments' unit of force."""

WEAR_TENSION = 5 * GRAM_FORCE / 0.01
"""5 gf/cm [N/m], FAST's lightest load: what a garment's own weight does."""

_LINEAR_TO = 100 * GRAM_FORCE / 0.01  # [N/m] FAST's heaviest load, about the strongest pull in wear
_KNOT_APART = 1.0 / 24.0  # along the curve, its strain and its tension each taken as 1: at most 48 knots
_POWER_LAW_KNOTS = 17


def measured_curve(strain: FloatArray, tension: FloatArray) -> StretchCurve:
    """Return a strictly increasing curve through a tensile test's loading branch.

    The load cell's reading while the strip is slack counts as zero, noise goes by isotonic regression, and of samples
    closer than noise and use warrant one is kept.

    Args:
        strain: In any order; what is not above 0 is slack, shape (N,).
        tension: Force per width [N/m], shape (N,).

    Raises:
        InputError: nothing that increases.
    """
    from scipy.optimize import isotonic_regression  # heavy, and few fabrics come with samples

    order = np.argsort(strain, kind="stable")
    strain, tension = strain[order], tension[order]
    slack = strain <= 0.0
    x = strain[~slack]
    if len(x) < 2:
        raise InputError(f"a tensile test with {len(x)} samples beyond the gauge length; expected at least two")
    y = isotonic_regression(tension[~slack] - (np.median(tension[slack]) if slack.any() else 0.0)).x
    if not y[-1] > max(y[0], 0.0):
        raise InputError("a tensile test in which the tension never rises")
    along = x / x[-1] + y / y[-1]
    kept = [len(x) - 1]
    for i in range(len(x) - 2, -1, -1):
        last = kept[-1]
        if along[last] - along[i] >= _KNOT_APART <= along[i] and x[i] < x[last] and 0.0 < y[i] < y[last]:
            kept.append(i)
    kept.reverse()
    return StretchCurve((0.0, *x[kept].tolist()), (0.0, *y[kept].tolist()))


def power_law(extension: float, tension: float, linearity: float) -> StretchCurve:
    """Return the curve T = T_max (ε / ε_max)^p whose energy is `linearity` times that of the straight line.

    Args:
        extension: Strain at the greatest tension.
        tension: The greatest tension [N/m].
        linearity: KES's LT = WT / (½ T_max ε_max) = 2 / (p + 1).
    """
    share = np.linspace(0.0, 1.0, _POWER_LAW_KNOTS)
    curve = share ** (2.0 / linearity - 1.0)
    return StretchCurve(tuple((extension * share).tolist()), tuple((tension * curve).tolist()))


def secant_stiffness(curve: StretchCurve) -> tuple[float, float]:
    """Return the secant stiffness [N/m] from rest, and the tension up to which it is meant [N/m]: 100 gf/cm or the
    curve's end."""
    tension = min(_LINEAR_TO, curve.tension[-1])
    return tension / float(np.interp(tension, curve.tension, curve.strain)), tension


def hysteresis_share(strain: FloatArray, loading: FloatArray, unloading: FloatArray) -> float:
    """Return the width of a tensile loop, averaged over the strain, per greatest tension: ½ LT (1 - RT) in KES's terms.

    Loops of woven and knitted cloth widen about in proportion to the load.

    Args:
        strain: Increasing, shape (N,).
        loading, unloading: Tension on the way up and back [N/m], shape (N,).
    """
    lost = np.trapezoid(loading - unloading, strain) / (strain[-1] - strain[0])
    return float(np.clip(lost / loading[-1], 0.0, 1.0))


def trellis_angle(extension: float) -> float | None:
    """Return the angle [rad] by which threads are sheared in a strip on the bias that is this much longer [share].

    A square of threads that keep their length has a diagonal √(1 + sin γ) times as long. None where no angle is so
    long: there the threads themselves were stretched.
    """
    sine = (1.0 + extension) ** 2 - 1.0
    return float(np.arcsin(sine)) if sine < 1.0 else None
