"""A hem that ended turned up is told of: tubes and cones whose hem is turned up along a known length."""

import numpy as np
import pytest
from cloth_scenes import tube
from numpy.testing import assert_allclose

from vto_pipeline.cloth.judge.turned_up import warn_if_turned_up
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

CORNERS, RADIUS, HEIGHT = 192, 0.2, 0.4  # [m]
SLOPE = 0.3
SPACING = 2 * np.pi * RADIUS / CORNERS


def skirt(crease=RADIUS, flare=0.0):
    """A tube on the floor, wider by `flare` for each metre below its top; folded up in front, from x = crease on.

    What is below a sloping plane is mirrored in it, so cloth keeps its lengths.
    """
    made = tube(RADIUS, HEIGHT, CORNERS, 61)
    x, y, z = made.vertices.T
    out = 1 + flare * (HEIGHT - y) / RADIUS
    placed = np.column_stack([x * out, y, z * out])
    normal = np.array([-SLOPE, 1.0, 0.0]) / np.hypot(SLOPE, 1.0)
    below = np.maximum((np.array([crease, 0.0, 0.0]) - placed) @ normal, 0.0)
    return TriangleMesh(placed + 2 * below[:, None] * normal, made.faces)


@pytest.mark.parametrize("crease", [0.05, 0.0, -0.05])
def test_the_length_that_is_turned_up_is_told(crease):
    job, made = Job(), skirt(crease)
    found = warn_if_turned_up(made, job)
    depth = 0.05 / 1.66  # of a fold from which on a strip of 5 cm rises by more than 0.3 of its length, mirrored so
    truth = 2 * RADIUS * np.arccos((crease + depth / SLOPE) / RADIUS)
    assert_allclose(found["turned_up_mm"], 1e3 * truth, rtol=0, atol=6e3 * SPACING)  # three at either end
    (warning,) = job.warnings
    assert f"along {found['turned_up_mm'] / 10:.0f} cm" in warning
    x, y, _ = (float(number) for number in warning.split("(")[1].split(")")[0].split(","))
    assert x > crease
    assert 0.0 < y < 0.2


@pytest.mark.parametrize("flare", [0.0, 0.5, 1.0])  # to 45 degrees
def test_a_hem_that_hangs_is_not_turned_up(flare):
    job = Job()
    assert warn_if_turned_up(skirt(10.0, flare), job) == {"turned_up_mm": 0.0}
    assert not job.warnings


def test_a_narrow_fold_is_no_matter():
    job = Job()
    assert warn_if_turned_up(skirt(0.12), job) == {"turned_up_mm": 0.0}  # 2.4 cm, at its widest
    assert not job.warnings


def test_what_hangs_nowhere_has_no_hem():
    made = tube(RADIUS, HEIGHT, CORNERS, 61)
    x, y, z = made.vertices.T
    lying = TriangleMesh(np.column_stack([x, z, y]), made.faces)
    assert warn_if_turned_up(lying, Job()) == {}
