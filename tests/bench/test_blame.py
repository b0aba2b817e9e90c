"""What the scan bench puts an error down to, on tubes whose faults and views are known in closed form."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.bench.scan.blame import blame, missing_shares, photos_that_show, wrong_shares
from vto_pipeline.io.captures.cameras import write_cameras
from vto_pipeline.io.documents import write_json
from vto_pipeline.io.meshes import write_ply
from vto_pipeline.io.runs.garments import write_observed
from vto_pipeline.model.camera import CameraSet, Intrinsics
from vto_pipeline.model.mesh import TriangleMesh

RADIUS, HEIGHT, AROUND, ALONG = 0.2, 0.6, 180, 120


def tube(radius=RADIUS, height=HEIGHT):
    """Open at both ends, oriented outward."""
    i, j = np.meshgrid(np.arange(AROUND), np.arange(ALONG + 1), indexing="ij")
    turn, y = 2.0 * np.pi * i / AROUND, height * j / ALONG
    vertices = np.stack([radius * np.sin(turn), y, radius * np.cos(turn)], axis=-1).reshape(-1, 3)
    a = (i * (ALONG + 1) + j)[:, :-1].ravel()
    b = (((i + 1) % AROUND) * (ALONG + 1) + j)[:, :-1].ravel()
    faces = np.concatenate([np.stack([a, b, b + 1], -1), np.stack([a, b + 1, a + 1], -1)])
    return TriangleMesh(vertices, faces.astype(np.int32))


def ring(count, away=1.5, height=HEIGHT / 2):
    """Cameras that look at the tube's middle from evenly around; the first from the front."""
    poses = np.tile(np.eye(4), (count, 1, 1))
    for pose, turn in zip(poses, 2.0 * np.pi * np.arange(count) / count, strict=True):
        back = np.array([np.sin(turn), 0.0, np.cos(turn)])
        pose[:3, :3] = np.column_stack([np.cross([0.0, -1.0, 0.0], -back), [0.0, -1.0, 0.0], -back])
        pose[:3, 3] = away * back + [0.0, height, 0.0]
    lens = Intrinsics(800, 800, 900.0, 900.0, 399.5, 399.5)
    return CameraSet(tuple(f"{k}.jpg" for k in range(count)), (lens,) * count, poses)


def dented(where, by=0.004):
    """The tube with vertices moved inwards."""
    mesh = tube()
    vertices = mesh.vertices.copy()
    vertices[where(mesh.vertices)] *= [1.0 - by / RADIUS, 1.0, 1.0 - by / RADIUS]
    return TriangleMesh(vertices, mesh.faces)


def test_what_is_wrong_is_put_down_to_filling_rim_and_sight():
    """A third of the tube is 4 mm off: its lowest 30 mm, a band of 50 mm, and one of 120 mm that was filled."""
    mesh = dented(lambda v: (v[:, 1] < 0.0301) | (np.abs(v[:, 1] - 0.2) < 0.0251) | (np.abs(v[:, 1] - 0.4) < 0.0601))
    observed = np.abs(mesh.vertices[:, 1] - 0.4) > 0.0601
    found = wrong_shares(mesh, observed, tube())
    row = 100.0 / ALONG  # a row of faces beside each band slants across the limit, and one beside the filling is filled
    assert_allclose(found["wrong_filled_percent"], 20.0, rtol=0, atol=2.0 * row)
    assert_allclose(found["wrong_rim_percent"], 100.0 * 0.01 / 0.6, rtol=0, atol=0.2)
    assert_allclose(found["wrong_seen_percent"], 100.0 * (0.02 + 0.05) / 0.6, rtol=0, atol=3.0 * row)
    rim_filled = wrong_shares(mesh, observed & (mesh.vertices[:, 1] > 0.0301), tube())
    assert rim_filled["wrong_rim_percent"] == 0.0  # what was filled is no rim that was seen


def test_a_true_garment_has_nothing_wrong_and_nothing_missing():
    mesh = tube()
    found = wrong_shares(mesh, np.zeros(len(mesh.vertices), bool), mesh) | missing_shares(
        mesh, mesh, tube(0.1), ring(8)
    )
    assert set(found.values()) == {0.0}


@pytest.mark.parametrize("distance", [0.5, 1.5])
def test_a_photo_shows_of_a_tube_what_is_less_steep_than_80_degrees(distance):
    """A camera at d from the axis sees the surface at an angle a with slant atan2(d sin a, d cos a - radius)."""
    turn = np.radians(np.arange(0.0, 360.0, 0.5))
    normals = np.column_stack([np.sin(turn), 0.0 * turn, np.cos(turn)])
    points = RADIUS * normals + [0.0, HEIGHT / 2, 0.0]
    lens = Intrinsics(2000, 800, 500.0, 500.0, 999.5, 399.5)
    camera = CameraSet(("a.jpg",), (lens,), ring(1, distance).world_from_cam)
    shown = photos_that_show(points, normals, tube(), camera) == 1
    slant = np.arctan2(distance * np.sin(turn), distance * np.cos(turn) - RADIUS)
    steepest = np.arccos(0.17)
    clear = np.abs(np.abs(slant) - steepest) > np.radians(1.0)
    assert (shown == (np.abs(slant) < steepest))[clear].all()
    assert 0 < shown.sum() < len(shown)


def test_what_stands_before_a_place_and_what_lies_beside_the_photo_hide_it():
    points, normals = np.array([[0.0, 0.3, RADIUS]]), np.array([[0.0, 0.0, 1.0]])
    count = photos_that_show(points, normals, tube(), ring(8))
    assert count == [3]  # from -45, 0 and 45 degrees; at 90 the tube itself is in the way
    wall = np.array([[-1.0, -1.0, 0.6], [1.0, -1.0, 0.6], [0.0, 2.0, 0.6]])
    hidden = TriangleMesh(
        np.vstack([tube().vertices, wall]), np.vstack([tube().faces, len(tube().vertices) + np.arange(3)])
    )
    assert photos_that_show(points, normals, hidden, ring(1)) == [0]
    assert photos_that_show(points, normals, tube(), ring(1)) == [1]
    lens = Intrinsics(80, 80, 900.0, 900.0, 39.5, -60.0)
    aside = CameraSet(("a.jpg",), (lens,), ring(1).world_from_cam)
    assert photos_that_show(points, normals, tube(), aside) == [0]
    assert photos_that_show(points, -normals, tube(), ring(8)) == [0]  # its inner side


def test_what_is_missing_is_put_down_to_photos_only_where_they_do_not_show_it():
    """Three cameras in front: the back half of the tube is hidden, and a quarter of the front was left out."""
    cameras = ring(36)
    few = CameraSet(cameras.names[:3], cameras.intrinsics[:3], cameras.world_from_cam[[35, 0, 1]])
    front = tube()
    middle = front.vertices[front.faces].mean(axis=1)
    front = TriangleMesh(
        front.vertices, front.faces[(middle[:, 2] > 0) & ~((middle[:, 2] > 0.14) & (middle[:, 1] > 0.3))]
    )
    found = missing_shares(front, tube(), tube(0.1), few)
    left_out = 100.0 * 0.5 * np.arccos(0.7) / np.pi
    assert_allclose(found["missing_shown_percent"], left_out, rtol=0, atol=1.0)
    inner = 100.0 * (0.3 - 0.005) / 0.6 * (np.arccos(0.7) - 0.005 / RADIUS) / np.pi  # beyond 5 mm of what is left
    assert_allclose(found["absent_shown_percent"], inner, rtol=0, atol=1.0)
    assert_allclose(
        found["missing_hidden_percent"], 50.0, rtol=0, atol=1.5
    )  # what is nearer than 1.5 mm is not missing
    apart = CameraSet(cameras.names[:3], cameras.intrinsics[:3], cameras.world_from_cam[[0, 12, 24]])
    found = missing_shares(front, tube(), tube(0.1), apart)  # no place is shown by all three
    assert found["missing_shown_percent"] == 0.0
    assert_allclose(found["missing_hidden_percent"], 50.0 + left_out, rtol=0, atol=1.5)


def test_a_run_is_blamed_from_its_files(tmp_path):
    """The cameras lie in the scan's frame, twice as large, turned and far away; the placement brings them back."""
    out = tmp_path / "out"
    out.mkdir()
    mesh = dented(lambda v: np.abs(v[:, 1] - 0.3) < 0.1)
    write_ply(out / "garment.ply", mesh)
    write_observed(out / "observed.npz", np.ones(len(mesh.vertices), bool))
    alone = blame(tmp_path, tube(), tube(0.1))
    assert set(alone) == {"wrong_filled_percent", "wrong_rim_percent", "wrong_seen_percent"}
    placement = np.array([[0.0, 0.0, 0.5, 4.0], [0.0, 0.5, 0.0, 9.0], [-0.5, 0.0, 0.0, 0.2], [0.0, 0.0, 0.0, 1.0]])
    cameras = ring(8)
    poses = np.linalg.inv(placement) @ cameras.world_from_cam
    poses[:, :3, :3] *= 0.5
    write_cameras(out / "cameras.json", CameraSet(cameras.names, cameras.intrinsics, poses))
    write_json(out / "garment_placement.json", {"mannequin_from_surface": placement})
    found = blame(tmp_path, tube(), tube(0.1))
    assert_allclose(found["missing_shown_percent"], 100.0 / 3.0, rtol=0, atol=1.5)
    assert found["missing_hidden_percent"] == found["absent_shown_percent"] == 0.0  # the dent is of 4 mm
