"""What stands in the room beside a body is not of it."""

from __future__ import annotations

import pytest
import trimesh
from numpy.testing import assert_array_equal

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.avatar.from_scan import ScanConfig, fit_scan
from vto_pipeline.avatar.scan.upright import without_surroundings
from vto_pipeline.errors import AvatarError
from vto_pipeline.geometry.closest import closest_points
from vto_pipeline.model.body import Measurements
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh


def box(size, middle):
    return trimesh.creation.box(size, trimesh.transformations.translation_matrix(middle))


def together(*things):
    whole = trimesh.util.concatenate(things)
    return TriangleMesh(whole.vertices, whole.faces)


@pytest.mark.parametrize(("gap", "left"), [(0.059, 2), (0.061, 1)])
def test_a_piece_within_reach_stays_and_one_beyond_goes(gap, left):
    """Boxes beside a box, in closed form."""
    body = box((0.4, 1.6, 0.3), (0.0, 0.8, 0.0))
    near = box((0.1, 0.4, 0.1), (0.2 + gap + 0.05, 1.0, 0.0))
    job = Job()
    found = without_surroundings(together(body, near), together(body), job)
    assert len(found.faces) == 12 * left
    assert len(job.notes) == 2 - left


def test_another_person_stays():
    """Who of two is meant is not to be guessed."""
    body = box((0.4, 1.6, 0.3), (0.0, 0.8, 0.0))
    scan = together(body, box((0.3, 1.2, 0.2), (1.0, 0.6, 0.0)))
    assert_array_equal(without_surroundings(scan, together(body), Job()).vertices, scan.vertices)


def test_a_body_between_furniture_is_met():
    """Both pieces are large enough not to be crumbs, and thick enough not to be a floor: the body was refused."""
    body = fit_measurements(Measurements({"stature": 1.70, "chest_girth": 0.99, "waist_girth": 0.83}, sex="female"))
    person = trimesh.Trimesh(body.vertices, body.faces, process=False)
    rail, stool = box((0.05, 0.5, 0.08), (0.85, 0.9, 0.1)), box((0.2, 0.2, 0.08), (-0.85, 0.7, 0.2))
    job = Job()
    try:
        found = fit_scan(
            together(person, rail, stool),
            ScanConfig(probes=1000, iterations=8, stiffness=(100.0, 4.0, 0.3), rounds=2),
            job,
        )
    except AvatarError as error:
        pytest.fail(error.problem)
    away = closest_points(person.sample(2000, seed=1), found.vertices, found.faces)[2]
    assert away.mean() < 2e-3
    assert any("beside the body" in note for note in job.notes)
    assert job.metrics["mean_mm"] < 2.0
