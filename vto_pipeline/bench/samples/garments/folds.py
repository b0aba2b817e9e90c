"""Folds of the cloth: heights above the smooth shirt, on the developed trunk and sleeve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vto_pipeline.model.arrays import FloatArray


@dataclass(frozen=True)
class Fold:
    """A ridge along a straight line of the developed cloth, fading out at its ends.

    Args:
        around, along: Its middle: arc around the axis and height (trunk) or distance from the shoulder (sleeve) [m].
        angle_deg: Direction of the ridge from the `around` axis.
        length, width: Standard deviations along and across it [m].
        height: Of the ridge [m]; the valleys beside it are a third as deep.
    """

    around: float
    along: float
    angle_deg: float
    length: float
    width: float
    height: float


# Form frame, arc measured on a circle of 0.15 m from the middle of the front towards the left side (+X).
TRUNK_FOLDS = (
    Fold(0.185, 0.470, 58.0, 0.075, 0.013, 0.012),  # flank, from the bust to the waist
    Fold(0.215, 0.420, 40.0, 0.080, 0.014, 0.013),
    Fold(0.250, 0.370, 22.0, 0.070, 0.013, 0.010),
    Fold(-0.190, 0.455, -60.0, 0.080, 0.014, 0.014),
    Fold(-0.230, 0.400, -36.0, 0.075, 0.013, 0.011),
    Fold(-0.255, 0.345, -15.0, 0.065, 0.012, 0.009),
    Fold(0.075, 0.455, 72.0, 0.050, 0.014, 0.009),  # under the bust
    Fold(-0.060, 0.440, -75.0, 0.055, 0.014, 0.008),
    Fold(0.010, 0.400, 84.0, 0.050, 0.016, 0.006),
    Fold(0.400, 0.440, 8.0, 0.090, 0.013, 0.012),  # small of the back
    Fold(0.455, 0.405, -10.0, 0.085, 0.013, 0.014),
    Fold(0.420, 0.365, 5.0, 0.075, 0.012, 0.010),
    Fold(0.350, 0.545, 60.0, 0.060, 0.014, 0.008),  # from the shoulder blades
    Fold(-0.360, 0.550, -62.0, 0.060, 0.014, 0.009),
    Fold(0.150, 0.615, 48.0, 0.045, 0.012, 0.007),  # from the armpit
    Fold(-0.155, 0.620, -46.0, 0.045, 0.012, 0.008),
)
# Arc on a circle of 0.07 m from the top of the sleeve towards the front.
SLEEVE_FOLDS = (
    Fold(0.100, 0.120, 40.0, 0.050, 0.010, 0.008),
    Fold(-0.090, 0.130, -45.0, 0.050, 0.010, 0.009),
    Fold(0.170, 0.165, 20.0, 0.045, 0.010, 0.010),
    Fold(-0.170, 0.185, -18.0, 0.050, 0.010, 0.009),
    Fold(0.050, 0.170, 65.0, 0.040, 0.011, 0.006),
    Fold(-0.030, 0.090, -60.0, 0.040, 0.011, 0.005),
)


def fold_height(folds: tuple[Fold, ...], around: FloatArray, along: FloatArray, girth: float) -> FloatArray:
    """Sum of all ridges [m].

    Args:
        folds: The ridges.
        around: Arc around the axis, shape (N,) [m]; wraps at `girth`.
        along: Height or distance from the shoulder, shape (N,) [m].
        girth: Length of the full turn [m].

    Returns:
        Shape (N,) [m].
    """
    total = np.zeros_like(around)
    for fold in folds:
        angle = np.deg2rad(fold.angle_deg)
        x = (around - fold.around + 0.5 * girth) % girth - 0.5 * girth
        y = along - fold.along
        s = (np.cos(angle) * x + np.sin(angle) * y) / fold.length
        t = (np.cos(angle) * y - np.sin(angle) * x) / fold.width
        bent = t + 0.35 * s**2
        total += fold.height * np.exp(-0.5 * s**2) * (1.33 * np.exp(-0.5 * bent**2) - 0.33 * np.exp(-0.125 * bent**2))
    return total


def hem_flutes(turn: FloatArray, depth: FloatArray) -> FloatArray:
    """Vertical waves that open towards the hem [m].

    Args:
        turn: Angle around the axis, shape (N,) [rad].
        depth: 0 where the waves begin, 1 at the hem, shape (N,).

    Returns:
        Shape (N,) [m], at most about 15 mm in size.
    """
    phase = 9.0 * turn + 1.1 * np.sin(2.0 * turn + 0.7) + 0.8 * np.sin(3.0 * turn - 1.2)
    uneven = 1.0 + 0.35 * np.sin(turn * 2.0 + 2.1) + 0.25 * np.sin(5.0 * turn)
    return 0.0105 * np.clip(depth, 0.0, None) ** 1.3 * uneven * np.sin(phase)
