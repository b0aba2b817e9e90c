"""Exposures of photos whose exposure was chosen."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.scan.exposure import exposures


def scene(chosen, hidden):
    """Patches of known brightness in each photo at another place, of which a share is hidden by something bright."""
    rng = np.random.default_rng(4)
    count = 60
    true = rng.uniform(30, 150, count)
    cell = np.stack(np.meshgrid(np.arange(8), np.arange(8)), axis=-1).reshape(-1, 2)
    pictures, pixels = [], []
    for exposure in chosen:
        place = rng.permutation(cell)[:count]
        shown = np.where(rng.random(count) < hidden, 160.0, true)
        picture = np.zeros((8, 8))
        picture[place[:, 1], place[:, 0]] = shown * exposure
        pictures.append(np.rint(np.kron(picture, np.ones((32, 32)))).astype(np.uint8))
        pixels.append(32.0 * place + 15.5)
    return pictures, np.stack(pixels), rng.random((len(chosen), count)) < 0.7


@pytest.mark.parametrize("hidden", [0.0, 0.2])
def test_exposures_are_found_even_where_points_are_hidden(hidden):
    chosen = np.array([1.0, 0.8, 1.3, 0.95, 1.1, 0.7])
    found = exposures(*scene(chosen, hidden))
    assert_allclose(found / found[0], chosen / chosen[0], rtol=0.01)  # a grey level of 30 to 200
    assert_allclose(np.log(found).mean(), 0.0, atol=1e-12)


def test_a_photo_that_shows_no_point_counts_as_the_others():
    pictures, pixels, seen = scene(np.array([1.0, 0.8, 1.2]), 0.0)
    seen[1] = False
    found = exposures(pictures, pixels, seen)
    assert found[1] == 1.0
    assert_allclose(found[2] / found[0], 1.2, rtol=0.01)
    assert_allclose(exposures(pictures, pixels, np.zeros_like(seen)), 1.0)
