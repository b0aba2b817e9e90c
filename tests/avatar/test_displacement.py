"""The last millimetres: what is seen goes onto the scan, what is not stays where the model has it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.avatar.from_scan import ScanConfig, fit_scan
from vto_pipeline.avatar.measure import measure
from vto_pipeline.avatar.scan.correspondence import Target
from vto_pipeline.avatar.scan.displacement import displace
from vto_pipeline.bench.body.extremes import _one_armed
from vto_pipeline.bench.body.people import random_body
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh


def sheet(height: float, side: float, count: int = 21) -> TriangleMesh:
    u, v = (g.ravel() for g in np.meshgrid(*2 * [np.linspace(-0.5 * side, 0.5 * side, count)], indexing="ij"))
    a = np.array([count * i + j for i in range(count - 1) for j in range(count - 1)])
    faces = np.vstack([np.column_stack([a, a + count, a + 1]), np.column_stack([a + 1, a + count, a + count + 1])])
    return TriangleMesh(np.column_stack([u, v, np.full(count**2, height)]), faces.astype(np.int32))


@pytest.mark.parametrize("gap", [0.012, 0.025, 0.05])
def test_what_the_scan_lacks_is_not_drawn_to_what_lies_beside_it(gap: float) -> None:
    """Two sheets one above the other, of which the scan has the lower, 3 mm higher than the model."""
    low, high, seen = sheet(0.0, 0.3), sheet(gap, 0.2), sheet(0.003, 0.4)
    count = len(low.vertices)
    both = np.vstack([low.vertices, high.vertices]), np.vstack([low.faces, high.faces + count])
    every = np.ones(2 * count, np.bool_)
    found, _ = displace(Target(seen, 4000, 0), *both, 1.0 * every, every, (1.0, 0.1), 3)
    assert_allclose(found[:count, 2], 0.003, rtol=0, atol=2e-5)
    assert_allclose(found[count:, 2], gap, rtol=0, atol=1e-3)


def test_what_the_scan_has_is_followed_however_far() -> None:
    low, high = sheet(0.0, 0.3), sheet(0.05, 0.3)
    count = len(low.vertices)
    both = np.vstack([low.vertices, high.vertices]), np.vstack([low.faces, high.faces + count])
    scan = TriangleMesh(both[0] * [1.4, 1.4, 1.0] + [0.0, 0.0, 0.008], both[1])
    every = np.ones(2 * count, np.bool_)
    found, _ = displace(Target(scan, 8000, 0), *both, 1.0 * every, every, (1.0, 0.1), 3)
    assert_allclose(found[:, 2], both[0][:, 2] + 0.008, rtol=0, atol=2e-5)


@pytest.mark.slow
def test_an_arm_that_the_scan_lacks_is_a_likely_one() -> None:
    """It reaches for nothing: neither into the trunk, nor in its girths."""
    body, job = random_body("female", 0), Job()
    found = fit_scan(_one_armed(body), ScanConfig(sex="female"), job)
    assert job.metrics["tangled_faces"] == 0
    assert any("0% of the left arm is in the scan" in warning for warning in job.warnings)
    read, true, whole = (measure(one) for one in (found, body, fit_scan(body.mesh, ScanConfig(sex="female"), Job())))
    for name in (name for name in true.values if name.endswith("_girth")):
        assert abs(read.values[name] - whole.values[name]) < 0.002, name
    for row in ("upper_arm", "elbow", "forearm", "wrist"):
        name = f"{row}_girth"
        assert abs(read.values[name] - true.values[name]) < 1.96 * read.sigmas[name]
        assert read.sigmas[name] > 2.0 * whole.sigmas[name]
