"""glTF files that reach beyond their buffers or their folder."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.errors import FormatError
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.model.job import Job


@pytest.fixture(autouse=True)
def parse_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Parse in this process: an interpreter per case costs time, and the border has tests of its own."""
    monkeypatch.setattr("vto_pipeline.io.meshes.run_limited", lambda parse, name, **_: dict(parse(name)))


POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1.5, 0]], "<f4")
INDICES = np.array([0, 1, 2, 0], "<u2")  # one too many, so that the views are aligned


def document(**changes: Any) -> dict[str, Any]:
    """A sound file of one triangle, with top-level keys replaced."""
    data = POINTS.tobytes() + INDICES.tobytes()
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": len(data), "uri": uri}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 8},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
        ],
    } | changes


def write(folder: Path, content: dict[str, Any]) -> Path:
    path = folder / "a.gltf"
    path.write_text(json.dumps(content))
    return path


def positions(**changes: Any) -> list[dict[str, Any]]:
    """The accessors, the first changed."""
    first, second = document()["accessors"]
    return [{k: v for k, v in (first | changes).items() if v is not None}, second]


def embedded(indices: list[int]) -> list[dict[str, Any]]:
    data = POINTS.tobytes() + np.array(indices, "<u4").tobytes()
    return [{"byteLength": len(data), "uri": "data:;base64," + base64.b64encode(data).decode()}]


LONG_INDICES = {
    "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 12}],
    "accessors": [
        {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
        {"bufferView": 1, "componentType": 5125, "count": 3, "type": "SCALAR"},
    ],
}

CASES: dict[str, tuple[dict[str, Any], str]] = {
    "index": ({"buffers": embedded([0, 1, 4_000_000]), **LONG_INDICES}, "face index 4000000 is outside 0..2"),
    "no bufferView": ({"accessors": positions(bufferView=None, count=400_000_000)}, "claims 400000000 values without"),
    "count": ({"accessors": positions(count=4)}, "4 values end at byte 48 of a bufferView of 36"),
    "offset": ({"accessors": positions(byteOffset=4)}, "end at byte 40 of a bufferView of 36"),
    "negative offset": ({"accessors": positions(byteOffset=-4)}, "byteOffset is -4"),
    "sparse": ({"accessors": positions(sparse={"count": 1})}, "is sparse"),
    "component type": ({"accessors": positions(componentType=1)}, "component type, type or count is wrong"),
    "view": ({"bufferViews": [{"buffer": 0, "byteLength": 99}] * 2}, "ends at byte 99 of a buffer of 44"),
    "buffer index": ({"bufferViews": [{"buffer": 7, "byteLength": 36}] * 2}, "buffers[7] does not exist; there are 1"),
    "mesh index": ({"nodes": [{"mesh": 3}]}, "meshes[3] does not exist"),
    "buffer length": (
        {"buffers": [{"byteLength": 4_000, "uri": "data:;base64,AAAA"}]},
        "has 3 bytes; 4000 are promised",
    ),
    "parent folder": ({"buffers": [{"byteLength": 44, "uri": "../x.bin"}]}, "leads out of the folder"),
    "encoded parent": ({"buffers": [{"byteLength": 44, "uri": "%2e%2e/x.bin"}]}, "leads out of the folder"),
    "absolute path": ({"buffers": [{"byteLength": 44, "uri": "/etc/passwd"}]}, "leads out of the folder"),
    "web address": ({"buffers": [{"byteLength": 44, "uri": "http://example.com/x.bin"}]}, "leads out of the folder"),
    "image path": ({"images": [{"uri": "../x.png"}]}, "leads out of the folder"),
    "buffer missing": ({"buffers": [{"byteLength": 44, "uri": "x.bin"}]}, "buffer x.bin has no bytes"),
    "meshopt": ({"extensionsRequired": ["EXT_meshopt_compression"]}, "EXT_meshopt_compression is not supported"),
    "loop": ({"nodes": [{"children": [1]}, {"children": [0], "mesh": 0}]}, "the nodes form a loop"),
    "version": ({"asset": {"version": "1.0"}}, "not glTF 2.0"),
    "nothing": ({"nodes": [{}]}, "no triangles"),
    "wrong kind": ({"meshes": [3]}, "meshes is not a list of objects"),
    "transform": ({"nodes": [{"mesh": 0, "scale": [1, 2]}]}, "cannot parse a node's transform"),
}


@pytest.mark.parametrize("name", CASES)
def test_a_broken_gltf_is_one_error_with_a_reason(tmp_path: Path, name: str) -> None:
    changes, problem = CASES[name]
    (tmp_path / "x.bin").write_bytes(bytes(1000))  # bait outside the folder of the file
    folder = tmp_path / "folder"
    folder.mkdir()
    with pytest.raises(FormatError) as caught:
        read_mesh(write(folder, document(**changes)))
    assert problem in caught.value.problem
    assert "a.gltf" in caught.value.where


def test_the_sound_file_is_read_placed_and_mirrored(tmp_path: Path) -> None:
    assert_allclose(read_mesh(write(tmp_path, document())).vertices, POINTS, rtol=0, atol=0)  # 0.5 is exact
    turned = [
        {"children": [1], "translation": [0, 0, 1]},
        {"mesh": 0, "rotation": [0, 0, np.sqrt(0.5), np.sqrt(0.5)], "scale": [1, 1, -1]},
    ]
    mesh = read_mesh(write(tmp_path, document(nodes=turned)))
    expected = np.array([[0, 0, 1], [0, 1, 1], [-1.5, 0, 1]])  # a quarter turn about z, then up z
    assert_allclose(mesh.vertices, expected, rtol=0, atol=1e-12)  # rounding of the rotation
    assert mesh.faces.tolist() == [[2, 1, 0]]  # the mirror turns the triangle


def test_an_index_of_one_part_never_reaches_another(tmp_path: Path) -> None:
    """Joined without a check, index 4 of the first part would be a vertex of the second."""
    data = POINTS.tobytes() + np.array([0, 1, 4], "<u4").tobytes() + np.array([0, 1, 2], "<u4").tobytes()
    content = document(
        buffers=[{"byteLength": len(data), "uri": "data:;base64," + base64.b64encode(data).decode()}],
        bufferViews=[
            {"buffer": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 12},
            {"buffer": 0, "byteOffset": 48, "byteLength": 12},
        ],
        accessors=[
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 3, "type": "SCALAR"},
            {"bufferView": 2, "componentType": 5125, "count": 3, "type": "SCALAR"},
        ],
        meshes=[
            {"primitives": [{"attributes": {"POSITION": 0}, "indices": i} for i in (1, 2)]},
        ],
    )
    with pytest.raises(FormatError, match="face index 4 is outside 0..2"):
        read_mesh(write(tmp_path, content))
    content["meshes"][0]["primitives"][0]["indices"] = 2
    job = Job()
    assert read_mesh(write(tmp_path, content), job=job).vertices.shape == (6, 3)
    assert "a.gltf: joined 2 parts into one mesh" in job.notes


@pytest.mark.parametrize("cut", [8, 12, 19, 40, 200, -1])
def test_a_cut_glb_is_refused(tmp_path: Path, cut: int) -> None:
    import trimesh

    data = trimesh.creation.icosphere(subdivisions=1).export(file_type="glb")
    (tmp_path / "a.glb").write_bytes(data[:cut])
    with pytest.raises(FormatError, match="bytes promised"):
        read_mesh(tmp_path / "a.glb")


def test_a_glb_whose_chunk_reaches_beyond_the_file_is_refused(tmp_path: Path) -> None:
    import trimesh

    data = bytearray(trimesh.creation.icosphere(subdivisions=1).export(file_type="glb"))
    data[12:16] = np.uint32(2**31).tobytes()
    (tmp_path / "a.glb").write_bytes(data)
    with pytest.raises(FormatError, match="a chunk of 2147483648 bytes ends beyond the file"):
        read_mesh(tmp_path / "a.glb")
