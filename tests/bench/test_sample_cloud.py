"""The committed laser clouds against the surfaces they were taken from."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from vto_pipeline.io.clouds import read_cloud
from vto_pipeline.io.documents import read_json
from vto_pipeline.io.meshes import read_mesh

SAMPLES = Path(__file__).parents[2] / "sample_data"


def distance(points, meshes):
    import open3d

    scene = open3d.t.geometry.RaycastingScene(nthreads=1)
    for mesh in meshes:
        scene.add_triangles(mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32))
    return scene.compute_distance(points.astype(np.float32), nthreads=1).numpy()


@pytest.fixture(scope="module")
def in_form_frame():
    truth = read_json(SAMPLES / "truth/cloud.json")
    cloud_from_form = np.array(truth["cloud_from_form"])
    cloud = read_cloud(SAMPLES / "shirt_on_form/cloud.ply", unit="m")
    assert cloud.normals is None
    return (cloud.points - cloud_from_form[:3, 3]) @ cloud_from_form[:3, :3], truth["holes"]


def test_points_lie_on_form_and_shirt_within_the_lasers_noise(in_form_frame):
    points, _ = in_form_frame
    meshes = [read_mesh(SAMPLES / name, unit="m") for name in ("shirt_on_form/form.ply", "truth/shirt.ply")]
    away = distance(points, meshes)
    assert len(points) == 60_000
    rms = np.sqrt(np.mean(away**2))
    assert 0.00020 < rms < 0.00030  # sigma 0.3 mm along the beam, less across the surface
    assert away.max() < 0.002
    on_shirt = distance(points, meshes[1:]) < 0.001
    assert 0.5 < on_shirt.mean() < 0.85


def test_the_deliberate_holes_are_empty_and_their_rims_are_not(in_form_frame):
    points, holes = in_form_frame
    tree = cKDTree(points)
    assert sorted(hole["diameter"] for hole in holes) == [0.02, 0.03, 0.04, 0.05]
    for hole in holes:
        nearest = tree.query(hole["center"])[0]
        assert 0.5 * hole["diameter"] - 0.0002 < nearest < 0.5 * hole["diameter"] + 0.006  # the rim is one spacing away


def test_the_customers_cloud_lies_on_the_customer():
    points = read_cloud(SAMPLES / "customer/cloud.ply", unit="m").points
    away = distance(points, [read_mesh(SAMPLES / "truth/customer_body.ply", unit="m")])
    assert 0.00020 < np.sqrt(np.mean(away**2)) < 0.00030
    spacing = cKDTree(points).query(points, k=2)[0][:, 1]
    assert 0.002 < np.median(spacing) < 0.006
