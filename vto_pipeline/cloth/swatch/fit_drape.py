"""Bending rigidity of a fabric from its drape coefficient, by simulated drape tests.

The same disc comes to rest in many shapes: where its folds begin is chance, in the laboratory and here. So the
coefficient is a line over the logarithm of the rigidity with scatter about it, from simulations that each begin in
their own unevenness. It is read backwards (linear calibration; Eisenhart 1939).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t as student

from vto_pipeline.cloth.swatch.disc import DrapeTest, at_minimum, drape_coefficient, resolving_edge, specimen
from vto_pipeline.errors import ComputationError, DivergedError, InputError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.job import Job
from vto_pipeline.units import GRAVITY

RESOLVED = (0.2, 0.95)
"""Coefficients that say something about the rigidity."""

_FALL = (0.72, 22.7, 0.22)  # a first guess: 72 % at Γ = w h³ / B = 22.7, less by 22 points where Γ is e times that
_LEVELS = (-0.6, -0.2, 0.2, 0.6)  # of log B about the guess
_ROUNDS = 6
_NEAR = 0.9  # simulations of a log B farther from the guess are left out: the line is one only nearby
_FEWEST = 3  # drapes at rest that a line goes through
_STEEP = 3.0  # standard errors


@dataclass(frozen=True)
class DrapedRigidity:
    """What a drape coefficient says of a fabric.

    Args:
        rigidity: B, the same in all directions [N·m].
        interval: Of 95 % [N·m].
        spread: Standard deviation of the coefficient between drapes of one fabric, as simulated; a share.
        slope: Of the coefficient by log B.
        simulated: How many drapes the line was drawn through.
    """

    rigidity: float
    interval: tuple[float, float]
    spread: float
    slope: float
    simulated: int


def fit_drape(coefficient: float, drapes: int, fabric: Fabric, test: DrapeTest, job: Job) -> DrapedRigidity:
    """Return the rigidity with which a fabric drapes so.

    Args:
        coefficient: Measured, a share; the mean of `drapes`.
        drapes: How often the cloth was draped anew.
        fabric: With its mass; its rigidity does not count.
        test: Sizes of specimen and disc.
        job: For progress.

    Raises:
        InputError: a coefficient that tells no rigidity.
    """
    low, high = RESOLVED
    if not low <= coefficient <= high:
        size = "smaller specimen, 24 cm" if coefficient < low else "larger specimen, 36 cm"
        problem = f"drape coefficient {100 * coefficient:.1f} % tells no rigidity"
        raise InputError(f"{problem}; expected {100 * low:.0f} to {100 * high:.0f} %", hint=f"drape a {size} across")
    drape, gamma, fall = _FALL
    weight = fabric.areal_density * GRAVITY * (test.radius - test.support) ** 3
    guess = float(np.log(weight / gamma) - (drape - coefficient) / fall)

    def simulate(log_rigidity: float, seed: int) -> float:
        rigidity = float(np.exp(log_rigidity))
        one = specimen(
            replace(fabric, bending_warp=rigidity, bending_weft=rigidity, bending_hysteresis=0.0),
            test,
            "irregular",
            resolving_edge(rigidity, fabric.areal_density),
            seed=seed,
        )
        try:
            return drape_coefficient(at_minimum(one), one.model.faces, test)
        except DivergedError:  # of very limp cloth some discs get caught in a fold that is finer than the mesh
            return np.nan

    return read_backwards(coefficient, drapes, guess, simulate, job)


def read_backwards(
    coefficient: float, drapes: int, guess: float, simulate: Callable[[float, int], float], job: Job
) -> DrapedRigidity:
    """Return where a line through simulated coefficients has the measured one, with the interval of a calibration.

    Args:
        coefficient, drapes: As measured.
        guess: log B to begin at.
        simulate: Coefficient of a log B and a seed; not a number where no rest was found.
        job: For progress.

    Raises:
        InputError: the coefficient does not rise clearly with the rigidity.
        ComputationError: too few drapes come to rest.
    """
    tried, found = np.empty(0), np.empty(0)
    for turn in range(_ROUNDS):
        for level in _LEVELS:
            job.progress(len(tried) / (_ROUNDS * len(_LEVELS)), f"simulated drape {len(tried) + 1}")
            found = np.append(found, simulate(guess + level, job.seed + len(tried)))
            tried = np.append(tried, guess + level)
        near = (np.abs(tried - guess) < _NEAR) & np.isfinite(found)
        if near.sum() < _FEWEST:
            raise ComputationError(f"only {near.sum()} of {len(tried)} simulated drapes came to rest")
        slope, at_guess = np.polyfit(tried[near] - guess, found[near], 1)
        step = (coefficient - at_guess) / slope if slope > 0.0 else np.inf
        if turn < _ROUNDS - 1:
            guess += float(np.clip(step, -1.0, 1.0)) if np.isfinite(step) else 0.0
    return _calibrated(coefficient, drapes, tried[near], found[near])


def _calibrated(coefficient: float, drapes: int, tried: FloatArray, found: FloatArray) -> DrapedRigidity:
    count, middle = len(tried), float(tried.mean())
    square = float(np.square(tried - middle).sum())
    slope = float((tried - middle) @ found) / square
    left = found - found.mean() - slope * (tried - middle)
    spread = float(np.sqrt(left @ left / (count - 2)))
    if slope < _STEEP * spread / np.sqrt(square):
        raise InputError(
            f"a coefficient of {100 * coefficient:.1f} % tells no rigidity: it hardly changes with it",
            hint="drape a specimen of another size",
        )
    at = middle + (coefficient - float(found.mean())) / slope
    half = student.ppf(0.975, count - 2) * spread / slope
    half *= np.sqrt(1.0 / drapes + 1.0 / count + (at - middle) ** 2 / square)
    rigidity = float(np.exp(at))
    interval = (rigidity * float(np.exp(-half)), rigidity * float(np.exp(half)))
    return DrapedRigidity(rigidity, interval, spread, slope, count)
