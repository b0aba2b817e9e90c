"""The strip's shape by relaxation, against shooting and against tables of others."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.bench.physics.elastica import bending_length, cantilever
from vto_pipeline.bench.physics.swatch.strips import exact_shape
from vto_pipeline.cloth.swatch.elastica import gamma_of_angle, hanging, path
from vto_pipeline.errors import InputError

PROFILES = Path(__file__).parents[3] / "shared" / "reference" / "data" / "elastica_profiles.json"


@pytest.mark.parametrize("gamma", [0.1, 8.0, 100.0, 1000.0])
def test_without_curl_it_is_the_elastica(gamma):
    exact = cantilever(gamma, points=401)
    off = path(hanging(gamma)) - np.column_stack([exact.reach, -exact.drop])
    assert 0.0 < np.abs(off).max() < 1e-4  # of the overhang; central differences


@pytest.mark.parametrize(("curl", "edge"), [(1.5, 0.02), (-1.5, 0.0), (0.5, -0.02)])
def test_with_curl_and_tilt_it_is_what_shooting_finds(curl, edge):
    off = path(hanging(12.0, curl, edge)) - exact_shape(12.0, curl, edge, 401)
    assert 0.0 < np.abs(off).max() < 1e-4  # of the overhang; central differences


@pytest.mark.real_data
@pytest.mark.skipif(not PROFILES.exists(), reason="the reference tables are absent")
def test_profiles_of_others():
    for gamma, table in json.loads(PROFILES.read_text())["profiles_by_Gamma"].items():
        points = path(hanging(float(gamma)))[::10]
        assert_allclose(points[:, 0], table["x_over_L"], rtol=0, atol=1e-4)  # central differences
        assert_allclose(-points[:, 1], table["drop_over_L"], rtol=0, atol=1e-4)


def test_the_angle_of_the_standard():
    for degrees in (10.0, 41.5, 75.0):
        exact = bending_length(np.radians(degrees))
        assert_allclose(gamma_of_angle(np.radians(degrees)) ** (-1 / 3), exact, rtol=2e-5)  # central differences
    with pytest.raises(InputError, match="2.0° cannot be resolved"):
        gamma_of_angle(np.radians(2.0))
