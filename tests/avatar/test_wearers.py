"""Who is inside clothes: against closed forms, and against people dressed by the assumptions themselves."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import gamma

from vto_pipeline.avatar.measuring.population import Population, population
from vto_pipeline.avatar.scan import body_under_clothes as under_clothes
from vto_pipeline.avatar.scan.body_under_clothes import ZONES, Zone, likely_wearers
from vto_pipeline.model.body import Measurements

SEEN = under_clothes._SEEN_M


def girth(found: Population, row: str) -> tuple[float, float]:
    k = found.names.index(f"{row}_girth")
    return float(found.mean[k]), float(np.sqrt(found.covariance[k, k]))


def of_the_mean(people: Population) -> dict[str, float]:
    return dict(zip(people.names, people.mean.tolist(), strict=True))


def test_what_is_surely_tight_is_measured() -> None:
    """As well as it is read; then all is Gaussian, and the population conditions itself in closed form."""
    people = population("female")
    clothes = of_the_mean(people) | {"chest_girth": 1.02, "neck_girth": 0.31}
    read = Measurements(clothes, {"neck_girth": 0.012})  # as near a collar
    tight = (Zone(("chest",), 1 - 1e-12), Zone(("neck",), 1 - 1e-12))
    draws = [likely_wearers(people, read, seed, tight) for seed in (1, 2, 3)]
    sigmas = SEEN | {
        "chest_girth": under_clothes._TIGHT_M,
        "neck_girth": float(np.hypot(under_clothes._TIGHT_M, 0.012)),
    }
    true = people.given({name: clothes[name] for name in sigmas}, sigmas)
    # the population's own widening for the unusual is not in question here
    wide = people.given({name: clothes[name] for name in SEEN}, SEEN)
    assert np.isfinite(wide.mean).all()
    for row in ("chest", "neck", "hip", "waist", "wrist"):
        mean, spread = np.mean([girth(found, row) for found in draws], axis=0)
        assert_allclose(mean, girth(true, row)[0], rtol=0, atol=0.1 * girth(true, row)[1])  # draws are correlated
        assert_allclose(spread, girth(true, row)[1], rtol=0.1)


def test_what_is_surely_loose_is_smaller_as_the_ease_says() -> None:
    """One girth: the product of a normal and a gamma density, integrated on a grid."""
    people = population("male")
    clothes = of_the_mean(people) | {"chest_girth": 1.10}
    found = likely_wearers(people, Measurements(clothes), 2, (Zone(("chest",), 1e-12),))
    mean, spread = girth(people.given({name: clothes[name] for name in SEEN}, SEEN), "chest")
    at = np.linspace(0.5, 1.5, 20001)
    density = np.exp(-0.5 * ((at - mean) / spread) ** 2) * gamma.pdf(1.10 - at, 2, scale=under_clothes._EASE_M)
    density /= density.sum()
    true = float(density @ at)
    assert_allclose(girth(found, "chest")[0], true, rtol=0, atol=0.003)
    assert_allclose(girth(found, "chest")[1], np.sqrt(density @ (at - true) ** 2), rtol=0.1)


def test_nobody_is_larger_than_the_clothes() -> None:
    people = population("female")
    narrow = {name: 0.93 * value if name.endswith("_girth") else value for name, value in of_the_mean(people).items()}
    found = likely_wearers(people, Measurements(narrow), 3)
    for zone in ZONES:
        for row in zone.rows:
            assert girth(found, row)[0] < narrow[f"{row}_girth"] + under_clothes._TIGHT_M


@pytest.mark.slow
def test_intervals_hold_people_who_dress_as_assumed() -> None:
    """Simulation-based calibration (Cook, Gelman & Rubin 2006): of 95 % intervals, 95 % hold."""
    rng, held = np.random.default_rng(7), []
    for k in range(60):
        people = population(("female", "male")[k % 2])
        true = dict(zip(people.names, rng.multivariate_normal(people.mean, people.covariance).tolist(), strict=True))
        clothes = dict(true)
        for name, sigma in SEEN.items():
            clothes[name] += rng.normal(0.0, sigma)
        for zone in ZONES:
            tight = rng.random() < zone.tight_probability
            least = rng.normal(0.0, under_clothes._TIGHT_M) if tight else rng.gamma(2.0, under_clothes._EASE_M)
            more = rng.gamma(2.0, under_clothes._EASE_M, len(zone.rows))
            more -= more.min()
            for row, extra in zip(zone.rows, more, strict=True):
                clothes[f"{row}_girth"] += least + extra
        found = likely_wearers(people, Measurements(clothes), k)
        spread = np.sqrt(np.diag(found.covariance))
        held.append(np.abs(found.mean - [true[name] for name in found.names]) < 1.96 * spread)
    share = np.mean(held, axis=0)
    assert 0.92 < np.mean(held) < 0.98
    assert share.min() > 0.80, dict(zip(found.names, share.tolist(), strict=True))
