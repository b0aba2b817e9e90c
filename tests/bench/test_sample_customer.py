"""The customer: measured right, larger than the form, and read by the project's readers."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from vto_pipeline.bench.samples.customer import _girth, measure_truth
from vto_pipeline.io.bodies.measurements import read_measurements, read_silhouettes
from vto_pipeline.io.captures.images import read_image
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.model.mesh import TriangleMesh

SAMPLES = Path(__file__).parents[2] / "sample_data"


@pytest.fixture(scope="module")
def body():
    return read_mesh(SAMPLES / "truth/customer_body.ply", unit="m")


def test_a_girth_is_the_perimeter_of_the_hull():
    box = trimesh.creation.box((0.3, 1.0, 0.2))
    mesh = TriangleMesh(box.vertices, box.faces)
    assert _girth(mesh, np.zeros(3), np.array([0.0, 1.0, 0.0])) == pytest.approx(1.0, abs=1e-12)
    tilted = np.array([0.0, np.cos(0.4), np.sin(0.4)])
    assert _girth(mesh, np.zeros(3), tilted) == pytest.approx(0.6 + 0.4 / np.cos(0.4), abs=1e-12)


def test_body_is_closed_and_stands_on_the_floor(body):
    solid = trimesh.Trimesh(body.vertices, body.faces, process=False)
    assert solid.is_watertight
    assert solid.body_count == 1
    assert 0.055 < solid.volume < 0.090
    assert body.vertices[:, 1].min() == pytest.approx(0.0, abs=1e-5)


def test_the_tapes_protocol_is_what_the_body_measures(body):
    measured = measure_truth(body)
    given = read_measurements(SAMPLES / "customer/measurements.yaml")
    truth = read_measurements(SAMPLES / "truth/customer_measurements.json")
    assert given.sex == truth.sex == "female"
    assert set(given.values) == {"stature", "bust_girth", "waist_girth", "hip_girth", "upper_arm_girth"}
    for name, value in measured.values.items():
        assert truth.values[name] == pytest.approx(value, abs=1e-9)
        assert given.values[name] == pytest.approx(value, abs=0.0006)  # written to the millimetre
    assert given.values["stature"] == pytest.approx(np.ptp(body.vertices[:, 1]), abs=0.0006)


def test_the_customer_is_clearly_larger_than_the_form(body):
    form = read_mesh(SAMPLES / "shirt_on_form/form.ply", unit="m")
    girths = [_girth(form, np.array([0.0, y, 0.0]), np.array([0.0, 1.0, 0.0])) for y in np.arange(0.27, 0.60, 0.01)]
    measured = measure_truth(body).values
    assert measured["waist_girth"] - min(girths) > 0.05
    assert measured["hip_girth"] - max(girths[:12]) > 0.05


def test_silhouettes_show_the_whole_body_at_its_height(body):
    views = read_silhouettes(SAMPLES / "customer/silhouettes")
    assert views.stature == pytest.approx(np.ptp(body.vertices[:, 1]), abs=0.001)
    for path in (views.front, views.side):
        picture = read_image(path).astype(float)
        backdrop = np.median(picture[:, :20], axis=1)[:, None]
        person = np.abs(picture - backdrop).max(axis=2) > 25
        rows, columns = np.nonzero(person)
        assert rows.min() > 10
        assert rows.max() < picture.shape[0] - 10
        assert columns.min() > 5
        assert columns.max() < picture.shape[1] - 5
        assert np.ptp(rows) == pytest.approx(900.0 * views.stature / 2.5, rel=0.08)  # feet and head nearer or farther
