"""Bending rigidity and curl of a fabric from the profiles of its strips, with an interval."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import t as student

from vto_pipeline.cloth.swatch.elastica import gamma_of_angle
from vto_pipeline.cloth.swatch.problem import CURL, LOG_RIGIDITY, Problem
from vto_pipeline.cloth.swatch.strip import Rigidity, Strip
from vto_pipeline.errors import InputError

RESOLVED = (0.7, 400.0)
"""Γ of strips that say something. Below, they hardly hang; above, all but a few millimetres at the edge are plumb."""

_FIRST_STEPS = 6  # from each start; the best goes on
_TOO_WIDE = np.log(3.0)
_LENGTH_READ, _ANGLE_READ = 1e-3, np.radians(1.0)  # half of a reading's interval of 95 %


def fit_strips(strips: Sequence[Strip], weight: float) -> Rigidity:
    """Return the rigidity that explains all strips together.

    Unknown are B and the curl, and for each strip where its edge is, how long it hangs and how level its edge is. The
    interval is that of the fit, with noise that neighbours may share, or Student's t of the spread between three or
    more strips, whichever is wider.

    Args:
        strips: Of one fabric in one direction.
        weight: Per area [N/m²].

    Raises:
        InputError: a strip is too stiff, too limp or too short to tell.
        ComputationError: no elastica fits.
    """
    strips = [strip.laid_right() for strip in strips]
    problem = Problem(strips)
    tried = [problem.solve(start, most=_FIRST_STEPS) for start in problem.starts()]
    rough = problem.solve(min(tried, key=lambda found: float(found.cost)).x).x
    fitted = problem.solve(rough, problem.noise(rough).whitening).x
    covariance = problem.noise(fitted).covariance
    wide = student.ppf(0.975, problem.points - len(fitted))
    half = wide * float(np.sqrt(covariance[LOG_RIGIDITY, LOG_RIGIDITY]))
    spread = None
    faces = len({strip.face for strip in strips})
    if len(strips) > 2:
        spread = float(np.std([_alone(problem, fitted, index) for index in range(len(strips))], ddof=1))
        half = max(half, student.ppf(0.975, len(strips) - faces) * spread / np.sqrt(len(strips)))
    unit, own = problem.unit, problem.per_strip(fitted)
    _check_resolved(strips, np.exp(3.0 * own[:, 2] - fitted[LOG_RIGIDITY]), half)
    rigidity = weight * unit**3 * np.exp(fitted[LOG_RIGIDITY])
    return Rigidity(
        rigidity=float(rigidity),
        interval=(float(rigidity * np.exp(-half)), float(rigidity * np.exp(half))),
        bending_length=float(unit * np.exp(fitted[LOG_RIGIDITY] / 3.0)),
        overhangs=tuple(map(float, unit * np.exp(own[:, 2]))),
        curl=float(fitted[CURL] / unit),
        curl_error=float(wide * np.sqrt(covariance[CURL, CURL]) / unit),
        edges=tuple(map(float, own[:, 3])),
        residual=float(unit * np.sqrt(np.mean(problem.distances(fitted) ** 2))),
        spread=spread,
    )


def from_angle(overhang: float, chord: float, weight: float) -> Rigidity:
    """Return the rigidity of a strip of known overhang whose tip is seen at an angle below level.

    The interval is that of readings to 1 mm and 1°. A curl would hide in the angle: it is taken to be none.

    Args:
        overhang: [m].
        chord: [rad].
        weight: Per area [N/m²].

    Raises:
        InputError: the angle is too flat or too steep to tell.
    """
    gamma = gamma_of_angle(chord)
    step = np.radians(0.1)
    slope = np.log(gamma_of_angle(chord + step) / gamma) / step
    half = float(np.hypot(3.0 * _LENGTH_READ / overhang, slope * _ANGLE_READ))
    rigidity = weight * overhang**3 / gamma
    interval = (float(rigidity * np.exp(-half)), float(rigidity * np.exp(half)))
    return Rigidity(float(rigidity), interval, float(overhang * gamma ** (-1.0 / 3.0)), (overhang,))


def _alone(problem: Problem, fitted: np.ndarray, index: int) -> float:
    """Return the log B of one strip, with the curl that all have."""
    one = Problem([problem.strips[index]], unit=problem.unit, curl=(fitted[CURL], 1e-6))
    start = np.concatenate([fitted[: CURL + 1], problem.per_strip(fitted)[index]])
    return float(one.solve(start, one.noise(start).whitening).x[LOG_RIGIDITY])


def _check_resolved(strips: Sequence[Strip], gammas: np.ndarray, half: float) -> None:
    low, high = RESOLVED
    for strip, gamma in zip(strips, gammas, strict=True):
        if not low <= gamma <= high:
            word, hint = ("stiff", "longer") if gamma < low else ("limp", "shorter")
            problem = f"the strip is too {word} for its overhang: Γ = {gamma:.2g}; expected {low:g} to {high:g}"
            raise InputError(problem, where=strip.name, hint=f"let a {hint} piece hang over the edge")
    if half > _TOO_WIDE:
        problem = (
            f"the strips do not tell the rigidity: its interval would be a factor of {np.exp(half):.1f} either way"
        )
        hint = "let a longer piece hang, and add a strip with the other face up"
        raise InputError(problem, where=", ".join(strip.name for strip in strips), hint=hint)
