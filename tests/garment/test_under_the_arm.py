"""A sleeve and the flank under it, of which a strip was not seen from the cuff round the armpit down the side."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.garment.openings import OpeningsConfig, close_scan_holes
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import submesh
from vto_pipeline.model.job import Job


@pytest.mark.parametrize(("depth", "low", "high", "slant"), [(0.015, -0.06, 0.03, 0.0), (0.01, -0.05, 0.02, 0.3)])
def test_the_cuff_is_as_tight_as_on_the_whole_sleeve(scene, depth, low, high, slant):
    x, y, z = scene.shirt.vertices[scene.shirt.faces].mean(axis=1).T
    below_the_arm = (0.15 - x + 0.70 - y) / np.sqrt(2)
    across = z - slant * (x - 0.25)
    unseen = (x > 0.1) & (y > 0.3) & (below_the_arm > depth) & (low < across) & (across < high)
    torn = submesh(scene.shirt, ~unseen)[0]
    _, true, _ = close_scan_holes(scene.shirt, scene.form, OpeningsConfig(), Job())
    garment, found, _ = close_scan_holes(torn, scene.form, OpeningsConfig(), Job())
    by_side = [sorted(openings, key=lambda opening: opening.center[0]) for openings in (found, true)]
    assert_allclose(*([opening.perimeter for opening in openings] for openings in by_side), rtol=0.08)
    back, _, _ = sample_surface(garment, 4000, 0)
    assert np.percentile(SurfaceDistance(scene.shirt).nearest(back).distance, 95) < 0.002
