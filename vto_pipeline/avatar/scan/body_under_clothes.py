"""Likelihood of bodies under clothes: inside them everywhere, with the statistics of people of this stature.

Cloth only says what a body is not larger than. How far it hangs off is unknown, so the answer is a distribution over
people: those of the survey who fit inside, each as likely as its clothes would be on it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vto_pipeline.avatar.measuring.population import Population
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Measurements

_SEEN_M = {
    "stature": 0.010,
    "back_neck_height": 0.015,
    "shoulder_height": 0.015,
    "outer_arm_length": 0.020,
    "back_shoulder_width": 0.020,
}
"""What shows through clothes, and how well [m]: hair, shoes, collars; cloth lies on the shoulders."""
_TIGHT_M = 0.005
"""How well the girth of bare skin or of a tight garment is the body's, standard deviation [m]."""
_EASE_M = 0.060
"""Scale of a loose garment's ease, a gamma distribution of order 2: mostly 4 to 23 cm of girth, 12 cm on the average.

Pattern books give 5 to 10 cm for a fitted shirt and 10 to 20 cm for a loose one; the distribution is our assumption.
"""
_PEOPLE, _STAGES, _MOVES, _STRIDE = 4000, 16, 5, 0.35


@dataclass(frozen=True)
class Zone:
    """A part of the body that one garment covers, or none; cloth hangs where there is least room.

    Args:
        rows: Where its girth is looked at.
        tight_probability: How likely it is to be bare or tightly covered; our assumption.
    """

    rows: tuple[str, ...]
    tight_probability: float


ZONES = (
    Zone(("neck",), 0.8),
    Zone(("upper_arm",), 0.3),
    Zone(("forearm",), 0.7),
    Zone(("wrist",), 0.8),
    Zone(("chest", "waist", "navel"), 0.2),
    Zone(("hip", "thigh"), 0.3),
    Zone(("knee", "calf"), 0.5),
    Zone(("ankle",), 0.5),
)


def likely_wearers(people: Population, clothes: Measurements, seed: int, zones: tuple[Zone, ...] = ZONES) -> Population:
    """Return mean and covariance of the people expected inside clothes.

    Sequential Monte Carlo from the population to those whom the clothes fit (Del Moral et al. 2006), moved by
    autoregressive proposals (Cotter et al. 2013), which leave the population as it is.

    Args:
        people: The population.
        clothes: Measurements of the clothed body [m]: girths are those of the cloth, as sure as their sigmas say.
        seed: Of the draws.
        zones: What hangs how.
    """
    rng = np.random.default_rng(seed)
    seen = people.given({name: clothes.values[name] for name in _SEEN_M}, _SEEN_M)
    root = np.linalg.cholesky(seen.covariance + 1e-12 * np.eye(len(seen.names)))
    unit = rng.standard_normal((_PEOPLE, len(seen.names)))
    fits = _likelihood(seen, clothes, zones, unit @ root.T)
    for stage in range(_STAGES):
        # the likelihood comes in slowly at first: few of a population fit well
        power, before = ((stage + 1) / _STAGES) ** 3, (stage / _STAGES) ** 3
        weight = np.exp((power - before) * (fits - fits.max()))
        kept = rng.choice(_PEOPLE, _PEOPLE, p=weight / weight.sum())
        unit, fits = unit[kept], fits[kept]
        for _ in range(_MOVES):
            other = np.sqrt(1 - _STRIDE**2) * unit + _STRIDE * rng.standard_normal(unit.shape)
            fit = _likelihood(seen, clothes, zones, other @ root.T)
            goes = np.log(rng.random(_PEOPLE)) < power * (fit - fits)
            unit[goes], fits[goes] = other[goes], fit[goes]
    found = unit @ root.T
    return Population(seen.names, seen.mean + found.mean(axis=0), np.cov(found.T))


def _likelihood(seen: Population, clothes: Measurements, zones: tuple[Zone, ...], away: FloatArray) -> FloatArray:
    """Return the log-likelihood of the clothes on people this far from the mean [m], shape (N,)."""
    total = np.zeros(len(away))
    for zone in zones:
        names = [f"{row}_girth" for row in zone.rows]
        at = [seen.names.index(name) for name in names]
        eases = np.array([clothes.values[name] for name in names]) - seen.mean[at] - away[:, at]
        least, ease = eases.argmin(axis=1), eases.min(axis=1)
        unsure = np.hypot(_TIGHT_M, [clothes.sigmas.get(name, 0.0) for name in names])[least]
        log_tight = -0.5 * (ease / unsure) ** 2 - np.log(np.sqrt(2 * np.pi) * unsure)
        room = np.maximum(ease, 1e-9)
        log_loose = np.log(room / _EASE_M**2) - room / _EASE_M
        # who does not fit inside is as unlikely as a tape is wrong
        log_loose = np.where(ease > 0, log_loose, -np.inf)
        total += np.logaddexp(
            np.log(zone.tight_probability) + log_tight, np.log(1 - zone.tight_probability) + log_loose
        )
    return total
