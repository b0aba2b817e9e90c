"""Profiles of strips that were scanned: of exact shapes, swept over a width, turned about the plumb line."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import interp1d

from vto_pipeline.bench.physics.swatch.strips import Cloth, hung
from vto_pipeline.cloth.swatch.fit import fit_strips
from vto_pipeline.cloth.swatch.scanned import scanned_profile
from vto_pipeline.cloth.swatch.strip import Strip
from vto_pipeline.errors import InputError
from vto_pipeline.units import GRAVITY

PLACE = np.array([1.0, 0.7, -2.0])
CLOTH = Cloth(0.150 * GRAVITY, 0.150 * GRAVITY * 0.020**3, 2.0)


def swept(face=1, turn=0.7, noise=3e-4, count=20_000, width=0.025, seed=0):
    """Points of a strip 25 mm wide, with the scanner's noise, and the profile without it."""
    rng = np.random.default_rng(seed)
    line = hung(CLOTH, np.random.default_rng(3), face, 0.0).points
    line = line[np.argsort(line[:, 0] - line[:, 1])]
    line = np.array([part.mean(axis=0) for part in np.array_split(line, 40)])  # its own noise goes
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    x, y = interp1d(along, line, axis=0, kind="cubic")(rng.uniform(0.0, along[-1], count)).T
    z = rng.uniform(0.0, width, count)
    points = np.column_stack([np.cos(turn) * x - np.sin(turn) * z, y, np.sin(turn) * x + np.cos(turn) * z])
    return points + rng.normal(0.0, noise, points.shape) + PLACE, line


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.0, 3.5, 5.5])
def test_the_profile_is_that_of_the_strip_however_it_is_turned(turn):
    points, line = swept(turn=turn)
    there = points - PLACE
    middle = [(there[:, [0, 2]] @ (np.cos(turn), np.sin(turn))).mean(), there[:, 1].mean()]
    found = scanned_profile(points) + middle
    ahead, across = found[:, 0] - found[:, 1], found[:, 0] + found[:, 1]
    true = interp1d(line[:, 0] - line[:, 1], line[:, 0] + line[:, 1], kind="cubic", fill_value="extrapolate")
    assert_allclose(across[2:-2], true(ahead[2:-2]), rtol=0, atol=3e-4)  # noise of 0.3 mm, 200 points in each mean


def test_the_rigidity_is_that_of_the_cloth():
    strips = [Strip(scanned_profile(swept(face, seed=face + 1)[0]), face) for face in (1, -1)]
    found = fit_strips(strips, CLOTH.weight)
    low, high = found.interval
    assert low < CLOTH.rigidity < high
    assert_allclose(found.rigidity, CLOTH.rigidity, rtol=0.1)  # the bar of simulated swatches


def test_what_is_no_strip_is_refused():
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="not a strip that is straight"):
        scanned_profile(rng.normal(0.0, 0.05, (5000, 3)))
    with pytest.raises(InputError, match="expected 500"):
        scanned_profile(rng.normal(0.0, 0.05, (40, 3)))
