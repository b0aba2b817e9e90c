"""The references against tables of others, where these are at hand, and against what must hold in any case."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.special import ellipk, ellipkinc

from vto_pipeline.bench.physics.closed_forms import (
    cantilever_modes,
    capstan,
    catenary,
    first_bessel_zero,
    hanging_sheet_modes,
    lateral_buckling,
    lateral_buckling_at_tip,
    pendulum_period,
    slide,
    upright_strip,
)
from vto_pipeline.bench.physics.elastica import bending_length, cantilever, held_strip

TABLES = Path(__file__).parents[3] / "shared" / "reference" / "data"
with_tables = [
    pytest.mark.real_data,
    pytest.mark.skipif(not TABLES.exists(), reason="the reference tables are absent"),
]


def table(name):
    with (TABLES / f"{name}.csv").open(encoding="utf-8") as stream:
        rows = list(csv.reader(stream))
    return rows[1:]


def numbers(name, columns):
    return np.array([[float(row[c]) for c in columns] for row in table(name)])


class TestAgainstTables:
    pytestmark = with_tables

    def test_own_weight(self):
        for gamma, reach, drop, bent in numbers("elastica_cantilever", (0, 1, 2, 6))[::8]:
            strip = cantilever(gamma)
            assert_allclose([strip.reach[-1], strip.drop[-1]], [reach, drop], rtol=0, atol=1e-8)  # printed digits
            assert_allclose(strip.root_curvature, bent, rtol=1e-7, atol=1e-8)

    def test_profiles(self):
        profiles = json.loads((TABLES / "elastica_profiles.json").read_text())["profiles_by_Gamma"]
        for gamma in ("1", "8", "50"):
            strip = cantilever(float(gamma), points=41)
            assert_allclose(strip.arc, profiles[gamma]["s_over_L"], rtol=0, atol=1e-12)
            assert_allclose(strip.reach, profiles[gamma]["x_over_L"], rtol=0, atol=1e-8)

    def test_tip_load(self):
        for load, drop, shorter in numbers("elastica_tip_load", (0, 1, 2))[::5]:
            strip = cantilever(0.0, load)
            assert_allclose([strip.drop[-1], 1.0 - strip.reach[-1]], [drop, shorter], rtol=0, atol=1e-6)

    def test_peirce(self):
        for angle, length in numbers("peirce_angle", (0, 2))[::6]:
            assert_allclose(bending_length(np.radians(angle)), length, rtol=2e-6)  # printed digits

    def test_held_strip(self):
        for shorter, ratio, down in numbers("stick_slip_pinned_elastica", (0, 1, 2))[4:60:14]:
            strip = held_strip(shorter)
            assert_allclose([strip.holding_friction, strip.down], [ratio, down], rtol=0, atol=1e-5)  # printed digits

    def test_closed_forms(self):
        for poisson, gamma in numbers("lateral_buckling_thin_strip", (0, 2)):
            assert_allclose(lateral_buckling(poisson), gamma, rtol=1e-6)
        for degrees, ratio in numbers("pendulum_period_ratio", (0, 1)):
            assert_allclose(pendulum_period(np.radians(degrees)), ratio, rtol=1e-7)
        for length, a, sag in numbers("catenary", (0, 1, 2)):
            assert_allclose(catenary(length), (a, sag), rtol=1e-6)
        for friction, degrees, ratio in numbers("capstan", (0, 1, 2)):
            assert_allclose(capstan(friction, np.radians(degrees)), ratio, rtol=1e-6)


def test_a_light_strip_is_the_linear_beam_and_a_heavy_one_hangs():
    light = cantilever(1e-3)
    assert_allclose(light.drop[-1], 1e-3 / 8.0, rtol=1e-6)  # the next term is of relative size Γ²
    assert_allclose(light.root_curvature, 1e-3 / 2.0, rtol=1e-6)
    heavy = cantilever(2000.0)
    assert_allclose(heavy.reach[-1], np.sqrt(2.0 / 2000.0), rtol=0.05)  # a bend of this size, then plumb


def test_a_strip_keeps_its_length_and_its_moments_balance():
    strip = cantilever(8.0, 2.0, points=4001)
    steps = np.hypot(np.diff(strip.reach), np.diff(strip.drop))
    assert_allclose(steps.sum(), 1.0, rtol=1e-6)  # chords against arcs
    lever = 8.0 * np.trapezoid(strip.reach, strip.arc) + 2.0 * strip.reach[-1]
    assert_allclose(strip.root_curvature, lever, rtol=1e-7)  # trapezoidal rule


def test_tip_load_by_elliptic_integrals():
    strip = cantilever(0.0, 5.0)
    modulus = (1.0 + np.sin(strip.slope[-1])) / 2.0  # Bisshopp & Drucker 1945, eq. 9
    arc = ellipk(modulus) - ellipkinc(np.arcsin(1.0 / np.sqrt(2.0 * modulus)), modulus)
    assert_allclose(arc, np.sqrt(5.0), rtol=1e-10)


def test_a_held_strip_starts_at_the_euler_load():
    strip = held_strip(1e-5)
    assert_allclose(strip.down, 20.190728556426629, rtol=1e-4)  # tan k = k; the shortening itself
    assert_allclose(held_strip(4e-5).holding_friction / strip.holding_friction, 2.0, rtol=1e-4)  # as its root
    assert held_strip(0.2).holding_friction > held_strip(0.1).holding_friction > 0.15


def test_bessel_zeros_and_what_follows():
    assert_allclose(first_bessel_zero(-0.5), 0.5 * np.pi, rtol=1e-13)  # J of order -1/2 is a cosine
    assert_allclose(upright_strip(), 7.8373, rtol=1e-5)  # Greenhill
    assert_allclose(lateral_buckling() / np.sqrt(2.0), 12.85, rtol=1e-3)  # Timoshenko & Gere
    assert_allclose(lateral_buckling_at_tip() / np.sqrt(2.0), 4.013, rtol=1e-3)


def test_small_swings_and_short_sags():
    assert_allclose(pendulum_period(0.1), 1.0 + 0.1**2 / 16.0, rtol=1e-6)  # the next term is 11/3072 θ⁴
    _, sag = catenary(1.0001)
    assert_allclose(sag, np.sqrt(3.0 * 1e-4 / 8.0), rtol=1e-4)  # a parabola
    assert_allclose(cantilever_modes(5)[-1], (4.5 * np.pi) ** 2, rtol=1e-5)  # far modes
    assert_allclose(np.diff(hanging_sheet_modes(6))[-1], 0.5 * np.pi, rtol=1e-2)  # zeros of J₀ come π apart


def test_slides():
    assert slide(0.6, np.radians(30.0), 9.8, 0.01, 50) == 0.0
    assert_allclose(slide(0.0, 0.5 * np.pi, 9.8, 1e-5, 100000), 4.9, rtol=2e-5)  # free fall for a second, and n + 1
