"""The scan bench: what it reads off a garment whose faults are known, and how it ends what does not end."""

import resource

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose

from vto_pipeline.bench.own_process import run_vto
from vto_pipeline.bench.scan.captures import scan_row
from vto_pipeline.bench.scan.truth import beside_truth, cameras_off, rims_off, scale_of
from vto_pipeline.io.meshes import write_ply
from vto_pipeline.model.camera import CameraSet, Intrinsics
from vto_pipeline.model.mesh import TriangleMesh


@pytest.fixture(scope="module")
def vase():
    """An open, round, uneven tube: two openings."""
    turn, height = np.meshgrid(np.linspace(0, 2 * np.pi, 90, endpoint=False), np.linspace(0, 0.6, 60), indexing="ij")
    radius = 0.15 + 0.05 * np.sin(6 * height) + 0.02 * np.cos(3 * turn)
    vertices = np.stack([radius * np.cos(turn), height, radius * np.sin(turn)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(90), np.arange(59), indexing="ij")
    a, b = i * 60 + j, (i + 1) % 90 * 60 + j
    faces = np.concatenate([np.stack([a, a + 1, b], -1), np.stack([b, a + 1, b + 1], -1)]).reshape(-1, 3)
    return TriangleMesh(vertices, faces.astype(np.int32))


def scaled(mesh, factor):
    return TriangleMesh(factor * mesh.vertices, mesh.faces)


@pytest.mark.parametrize("factor", [0.98, 1.0, 1.01])
def test_the_scale_of_a_garment_is_found(vase, factor):
    assert_allclose(scale_of(scaled(vase, factor), vase), factor, rtol=2e-4, atol=0)


def test_a_garment_half_of_which_is_missing_is_incomplete_and_not_inaccurate(vase):
    upper = TriangleMesh(vase.vertices, vase.faces[vase.vertices[vase.faces][:, :, 1].mean(axis=1) > 0.3])
    found = beside_truth(upper, vase)
    assert found["p99_mm"] < 0.01  # it is a part of the truth
    assert 0.4 < found["complete_2mm"] < 0.6
    assert (found["openings"], found["true_openings"]) == (2, 2)
    assert_allclose(found["scale_off_percent"], 0.0, rtol=0, atol=0.05)  # of one percent


@pytest.mark.parametrize("depth", [0.0, 0.05, 0.1])
def test_a_notch_in_a_rim_is_seen_in_its_length(vase, depth):
    """A slot so deep, one face of 3 degrees wide, makes the rim longer by twice its depth."""
    middle = vase.vertices[vase.faces].mean(axis=1)
    turn = np.degrees(np.arctan2(middle[:, 2], middle[:, 0]))
    slot = (turn > 0) & (turn < 4) & (middle[:, 1] > 0.6 - depth)
    upper = vase.vertices[59::60]
    whole = np.linalg.norm(upper - np.roll(upper, -1, axis=0), axis=1).sum()
    off = rims_off(TriangleMesh(vase.vertices, vase.faces[~slot]), vase)
    assert_allclose(off, 200.0 * depth / whole, rtol=0, atol=2.5)  # a row of faces is 10 mm, 1 % twice; walls slant


def test_cameras_are_compared_in_whatever_frame_and_unit_they_are():
    random = np.random.default_rng(3)
    poses = np.tile(np.eye(4), (7, 1, 1))
    poses[:, :3, 3] = random.normal(size=(7, 3))
    names = tuple(f"{k}.jpg" for k in range(7))
    cameras = CameraSet(names, (Intrinsics(80, 60, 90.0, 90.0, 39.5, 29.5),) * 7, poses, metric=False)
    turn = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    places = {name: 0.4 * turn @ pose[:3, 3] + [1.0, 2.0, 3.0] for name, pose in zip(names, poses, strict=True)}
    assert_allclose(cameras_off(cameras, places), 0.0, rtol=0, atol=1e-9)  # rounding
    moved = {name: place + 0.01 * random.choice([-1, 1], 3) / np.sqrt(3) for name, place in places.items()}
    assert 2.0 < cameras_off(cameras, moved) < 10.5  # 10 mm each, of which the fit takes its part
    assert cameras_off(cameras, {"other.jpg": np.zeros(3)}) is None


def test_a_scan_that_takes_too_long_is_ended(tmp_path):
    ended = run_vto(["schema"], tmp_path / "log", 0.01)  # it loads every domain, which takes seconds
    assert ended.code is None
    assert run_vto(["--help"], tmp_path / "log", 600.0).code == 0


def test_a_refused_capture_is_a_row_with_its_exit_code(vase, tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.2)
    (tmp_path / "photos").mkdir()
    write_ply(tmp_path / "body.ply", TriangleMesh(ball.vertices, ball.faces))
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    row = scan_row(tmp_path, "photos", tmp_path / "runs" / "one", [], 600.0)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)  # the kernel's own count of all children together
    busy = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    assert row["exit"] == 3
    assert_allclose(row["cpu_s"], busy, rtol=0, atol=0.02)  # [s]; the kernel counts to a few milliseconds
    assert busy > 0.2  # a run imports NumPy at least
    assert "median_mm" not in row
    assert "photos" in (tmp_path / "runs" / "one.log").read_text()
