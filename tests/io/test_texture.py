"""Texture coordinates come back per corner of each face; a file whose coordinates are wrong is still a mesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose

from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.model.job import Job

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1.5 0\nv 0 1.5 0\n"
PLACES = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 5 5\n"


def read(tmp_path: Path, text: str, job: Job | None = None) -> np.ndarray | None:
    path = tmp_path / "a.obj"
    path.write_text(text)
    return read_mesh(path, unit="m", job=job).texture


def test_a_vertex_on_a_seam_has_a_place_on_either_side(tmp_path: Path) -> None:
    found = read(tmp_path, SQUARE.replace("0\n", "0\n# a comment\n", 1) + PLACES + "f 1/1 2/2/ 3/3\nf 1/5 3/-3 4/4\n")
    assert found is not None
    assert found.tolist() == [[[0, 0], [1, 0], [1, 1]], [[5, 5], [1, 1], [0, 1]]]


def test_polygons_are_split_as_their_vertices_are_and_lost_faces_lose_theirs(tmp_path: Path) -> None:
    found = read(tmp_path, SQUARE + PLACES + "f 1/1 2/2 3/3 4/4\nf 1/1 1/1 2/2\nf 2/5 3/3 4/4\n")
    assert found is not None  # triangles before the quad, and the one that uses a vertex twice is dropped
    assert found.tolist() == [[[5, 5], [1, 1], [0, 1]], [[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]]


def test_faces_turned_over_keep_the_places_of_their_corners(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(1, 0.5)
    text = "".join(f"v {x} {y} {z}\nvt {x} {y}\n" for x, y, z in ball.vertices)
    text += "".join("f " + " ".join(f"{k + 1}/{k + 1}" for k in face[::-1]) + "\n" for face in ball.faces)
    path = tmp_path / "inside_out.obj"
    path.write_text(text)
    mesh = read_mesh(path, unit="m", job=(job := Job()))
    assert any("inside out" in note for note in job.notes)
    assert mesh.texture is not None
    assert_allclose(mesh.texture, mesh.vertices[mesh.faces][:, :, :2], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    "broken",
    ["f 1/1 2/2 3\nf 1/1 3/3 4/4\n", "f 1/1 2/2 3//3\n", "f 1/1 2/2 3/9\n", "f 1/1 2/2 3/0\n", "f 1/1 2/2 3/x\n"],
)
def test_wrong_ones_are_ignored_and_told(tmp_path: Path, broken: str) -> None:
    job = Job()
    assert read(tmp_path, SQUARE + PLACES + broken, job) is None
    assert any("texture coordinates are ignored" in note for note in job.notes)


def test_numbers_that_are_none_are_ignored_and_told(tmp_path: Path) -> None:
    for places in ("vt 0 0\nvt 1 nan\nvt 1 1\n", "vt 0\nvt 1\nvt 2\n", "vt 0 0\nvt 1 a\nvt 0 1\n"):
        job = Job()
        assert read(tmp_path, SQUARE + places + "f 1/1 2/2 3/3\n", job) is None
        assert any("texture coordinates are ignored" in note for note in job.notes)


def test_gltf_counts_v_downward(tmp_path: Path) -> None:
    places = np.array([[0.0, 0.25], [1.0, 0.25], [1.0, 0.75]])
    visual = trimesh.visual.TextureVisuals(uv=places)
    flat = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1.5, 0]], [[0, 1, 2]], visual=visual, process=False)
    flat.export(tmp_path / "a.glb")
    found = read_mesh(tmp_path / "a.glb", unit="m").texture
    assert found is not None
    assert_allclose(found, places[None], rtol=0, atol=1e-6, err_msg="single precision; trimesh has v up")
