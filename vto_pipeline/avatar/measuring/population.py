"""Population statistics from ANSUR II: the prior of a body, and conditional expectations.

Source: Gordon et al. 2014, 2012 Anthropometric Survey of U.S. Army Personnel, NATICK/TR-15/007 (public domain): 4082
men, 1986 women. Soldiers of 17 to 58 years: the young and the very heavy are thinly covered.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from vto_pipeline.avatar.measuring.definitions import definition
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.body import Measurements

_FREEDOM = 10.0
"""Degrees of freedom of the t distribution; assumed: three spreads out, expectations are a third less sure."""
_SAME = (1.0, 1.0, 0.0)
_WAIST_PRESSED, _HIP_PRESSED = (1.04, 1.035, 0.01), (1.03, 1.04, 0.01)
"""A caliper presses into soft tissue, a section of the body does not.

A girth is this many times that of an ellipse of its mean breadth and depth (waist, hip): 1.061, 1.096 for women and
1.055, 1.089 for men in ANSUR II; 1.014, 1.069 and 1.019, 1.054 in the same army's survey of 1988 (Gordon et al. 1989,
NATICK/TR-89/044); 1.026, 1.039 for fifteen men of the U.S. Air Force's survey of 1967. From 1988 to 2012 men's hips
grew by 36 mm of girth, but by 4 and -3 mm of breadth and depth: it is the calipers that differ. The factors bring
ANSUR II near the other surveys; their spread is our assumption.
"""
# ours: (ANSUR variables with shares), (female factor, male factor, spread of the factor). A factor other than 1 bridges
# two definitions (flexed and relaxed arm, navel and natural waist, above and at the knee, crotch and fold of the seat)
# and is our assumption.
_FROM_ANSUR: dict[str, tuple[dict[str, float], tuple[float, float, float]]] = {
    "stature": ({"stature": 1.0}, _SAME),
    "mass": ({"weightkg": 1.0}, _SAME),
    "head_girth": ({"headcircumference": 1.0}, _SAME),
    "neck_girth": ({"neckcircumference": 1.0}, _SAME),
    "neck_base_girth": ({"neckcircumferencebase": 1.0}, _SAME),
    "chest_girth": ({"chestcircumference": 1.0}, _SAME),
    "waist_girth": ({"waistcircumference": 1.0}, (0.93, 0.97, 0.02)),
    "navel_girth": ({"waistcircumference": 1.0}, _SAME),
    "hip_girth": ({"buttockcircumference": 1.0}, _SAME),
    "upper_arm_girth": ({"bicepscircumferenceflexed": 1.0}, (0.93, 0.93, 0.02)),
    "forearm_girth": ({"forearmcircumferenceflexed": 1.0}, (0.95, 0.95, 0.015)),
    "wrist_girth": ({"wristcircumference": 1.0}, _SAME),
    "thigh_girth": ({"thighcircumference": 1.0}, (0.97, 0.97, 0.015)),
    "knee_girth": ({"lowerthighcircumference": 1.0}, (0.94, 0.94, 0.015)),
    "calf_girth": ({"calfcircumference": 1.0}, _SAME),
    "ankle_girth": ({"anklecircumference": 1.0}, _SAME),
    "shoulder_length": ({"shoulderlength": 1.0}, _SAME),
    "back_neck_to_navel": ({"waistbacklength": 1.0}, _SAME),
    "back_shoulder_width": ({"biacromialbreadth": 1.0}, _SAME),
    "outer_arm_length": ({"sleeveoutseam": 1.0}, _SAME),
    "back_neck_height": ({"cervicaleheight": 1.0}, _SAME),
    "shoulder_height": ({"acromialheight": 1.0}, _SAME),
    "chest_height": ({"chestheight": 1.0}, _SAME),
    "waist_height": ({"tenthribheight": 0.65, "waistheightomphalion": 0.35}, (1.0, 1.0, 0.005)),
    "navel_height": ({"waistheightomphalion": 1.0}, _SAME),
    "hip_height": ({"buttockheight": 1.0}, _SAME),
    "inside_leg": ({"crotchheight": 1.0}, _SAME),
    "thigh_height": ({"crotchheight": 1.0}, (0.95, 0.95, 0.025)),
    "knee_height": ({"kneeheightmidpatella": 1.0}, _SAME),
    "chest_depth": ({"chestdepth": 1.0}, _SAME),
    "waist_breadth": ({"waistbreadth": 1.0}, _WAIST_PRESSED),
    "waist_depth": ({"waistdepth": 1.0}, _WAIST_PRESSED),
    "hip_breadth": ({"hipbreadth": 1.0}, _HIP_PRESSED),
    "hip_depth": ({"buttockdepth": 1.0}, _HIP_PRESSED),
}


@dataclass(frozen=True)
class Population:
    """A Gaussian over our measurements.

    Args:
        names: M names.
        mean: [m, kg], shape (M,).
        covariance: Shape (M, M).
    """

    names: tuple[str, ...]
    mean: FloatArray
    covariance: FloatArray

    def given(self, values: dict[str, float], sigmas: dict[str, float]) -> Population:
        """Return what is left to know once some are measured, each with its own uncertainty (0 when absent).

        A body far from those surveyed is less surely like them: the spread is that of a multivariate t (Ding 2016, On
        the conditional distribution of the multivariate t distribution), never less than the Gaussian's.
        """
        at, wrong, spread = self._known(values, sigmas)
        gain = np.linalg.solve(spread, self.covariance[at]).T
        covariance = self.covariance - gain @ self.covariance[at]
        covariance *= max(1.0, (_FREEDOM + self.distance(values, sigmas) ** 2) / (_FREEDOM + len(at)))
        return Population(self.names, self.mean + gain @ wrong, (covariance + covariance.T) / 2)

    def distance(self, values: dict[str, float], sigmas: dict[str, float]) -> float:
        """Return the Mahalanobis distance of measured values from the mean."""
        _, wrong, spread = self._known(values, sigmas)
        return float(np.sqrt(wrong @ np.linalg.solve(spread, wrong)))

    def _known(self, values: dict[str, float], sigmas: dict[str, float]) -> tuple[IntArray, FloatArray, FloatArray]:
        """Which are measured, how far they are from the mean, and their covariance with their own noise."""
        known = [name for name in self.names if name in values]
        at = np.array([self.names.index(name) for name in known], dtype=np.int32)
        noise = np.diag([sigmas.get(name, 0.0) ** 2 + 1e-8 for name in known])
        return at, np.array([values[name] for name in known]) - self.mean[at], self.covariance[np.ix_(at, at)] + noise


@lru_cache(maxsize=3)
def population(sex: str) -> Population:
    """Return the prior of "female", "male" or "neutral" (an even mixture of both, by its first two moments)."""
    if sex != "neutral":
        return _one_sex(sex)
    women, men = _one_sex("female"), _one_sex("male")
    apart = (men.mean - women.mean) / 2
    covariance = (women.covariance + men.covariance) / 2 + np.outer(apart, apart)
    return Population(women.names, (women.mean + men.mean) / 2, covariance)


def complete_measurements(measurements: Measurements) -> Measurements:
    """Return the given measurements and the expected rest, each with its standard uncertainty [m, kg]."""
    values = {definition(name).name: value for name, value in measurements.values.items()}
    sigmas = {definition(name).name: value for name, value in measurements.sigmas.items()}
    rest = population(measurements.sex).given(values, sigmas)
    spread = np.sqrt(np.diag(rest.covariance).clip(0.0))
    expected = dict(zip(rest.names, rest.mean.tolist(), strict=True)) | {
        k: v for k, v in values.items() if k not in sigmas
    }
    uncertain = {k: float(s) for k, s in zip(rest.names, spread, strict=True) if k not in values or k in sigmas}
    return Measurements(expected, uncertain, measurements.sex)


def _one_sex(sex: str) -> Population:
    with Path(__file__).with_name(f"ansur2_{sex}.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    variables = [row["variable"] for row in rows]
    # millimetres, and kilograms for the mass
    unit = np.array([1.0 if name == "weightkg" else 1e-3 for name in variables])
    mean = np.array([float(row["mean"]) for row in rows]) * unit
    sd = np.array([float(row["sd"]) for row in rows]) * unit
    likeness = np.array([[float(row[name]) for name in variables] for row in rows])
    mix = np.zeros((len(_FROM_ANSUR), len(variables)))
    bridge = np.zeros(len(_FROM_ANSUR))
    for k, (shares, (female, male, spread)) in enumerate(_FROM_ANSUR.values()):
        for name, share in shares.items():
            mix[k, variables.index(name)] = share * (female if sex == "female" else male)
        bridge[k] = spread * (mix[k] @ mean)
    covariance = mix @ (likeness * np.outer(sd, sd)) @ mix.T + np.diag(bridge**2)
    return Population(tuple(_FROM_ANSUR), mix @ mean, covariance)
