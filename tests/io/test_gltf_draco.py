"""glTF compressed by Google's own encoder gives the mesh that was encoded."""

from __future__ import annotations

import base64
import json
import warnings
from pathlib import Path
from typing import Any

import DracoPy
import numpy as np
import pytest
from io_shapes import DAMAGES, capsule, damages
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.formats.clean_up import check_sound
from vto_pipeline.io.gltf.read import parse_gltf
from vto_pipeline.io.meshes import parse, read_mesh
from vto_pipeline.io.sandbox import run_limited

BITS = 16
"""Of a position; 1.7 m in 2^16 steps."""


@pytest.fixture(autouse=True)
def parse_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Parse in this process: an interpreter per case costs time, and the border has tests of its own."""
    monkeypatch.setattr("vto_pipeline.io.meshes.run_limited", lambda parse, name, **_: dict(parse(name)))


def weights() -> tuple[np.ndarray, np.ndarray]:
    """Joints and weights of the capsule's vertices, hung on two joints by height."""
    height = np.asarray(capsule().vertices)[:, 2]
    share = (height - height.min()) / np.ptp(height)
    zero = np.zeros(len(share))
    return np.tile([0, 1, 0, 0], (len(share), 1)).astype("<u2"), np.column_stack([1 - share, share, zero, zero])


def packed(faces: bool = True) -> bytes:
    mesh, (joints, shares) = capsule(), weights()
    return DracoPy.encode(
        np.asarray(mesh.vertices, "<f4"),
        np.asarray(mesh.faces, "<u4") if faces else None,
        quantization_bits=BITS,
        preserve_order=True,
        generic_attributes={1: joints, 2: shares.astype("<f4")} if faces else None,
    )


def document(data: bytes) -> dict[str, Any]:
    mesh = capsule()
    decoded = DracoPy.decode(packed())
    (position,) = [a["unique_id"] for a in decoded.attributes if a["attribute_type"] == DracoPy.AttributeType.POSITION]
    count = len(mesh.vertices)
    extension = {"bufferView": 0, "attributes": {"POSITION": position, "JOINTS_0": 1, "WEIGHTS_0": 2}}
    primitive = {
        "attributes": {"POSITION": 0, "JOINTS_0": 2, "WEIGHTS_0": 3},
        "indices": 1,
        "extensions": {"KHR_draco_mesh_compression": extension},
    }
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    return {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_draco_mesh_compression"],
        "extensionsRequired": ["KHR_draco_mesh_compression"],
        "scenes": [{"nodes": [0, 1, 2]}],
        "nodes": [{"mesh": 0, "skin": 0}, {"name": "hip"}, {"name": "head"}],
        "skins": [{"joints": [1, 2]}],
        "meshes": [{"primitives": [primitive]}],
        "buffers": [{"byteLength": len(data), "uri": uri}],
        "bufferViews": [{"buffer": 0, "byteLength": len(data)}],
        "accessors": [
            {"componentType": 5126, "count": count, "type": "VEC3"},
            {"componentType": 5125, "count": mesh.faces.size, "type": "SCALAR"},
            {"componentType": 5123, "count": count, "type": "VEC4"},
            {"componentType": 5126, "count": count, "type": "VEC4"},
        ],
    }


def write(folder: Path, content: dict[str, Any]) -> Path:
    path = folder / "a.gltf"
    path.write_text(json.dumps(content))
    return path


def test_a_compressed_mesh_is_the_one_that_was_encoded(tmp_path: Path) -> None:
    mesh = read_mesh(write(tmp_path, document(packed())))
    assert_array_equal(mesh.faces, capsule().faces)
    assert_allclose(mesh.vertices, capsule().vertices, rtol=0, atol=0.51 * 1.7 / 2**BITS)  # half a step of the encoder


def test_a_compressed_skin_is_the_one_that_was_encoded(tmp_path: Path) -> None:
    arrays = parse(write(tmp_path, document(packed())))
    assert arrays["joint_names"].tolist() == ["hip", "head"]
    assert_allclose(arrays["weights"], weights()[1][:, :2], rtol=0, atol=1e-6)  # single precision


def test_compressed_data_that_lie_are_refused(tmp_path: Path) -> None:
    sound = packed()
    cases: dict[str, dict[str, Any]] = {
        "FileTypeException": document(sound[: len(sound) // 2]),
        "points and no triangles": document(packed(faces=False)),
    }
    for problem, change in {
        "values end at byte": {"accessors": [{"componentType": 5126, "count": 10**9, "type": "VEC3"}]},
        "without the attribute 99": {"meshes": [{"primitives": [_primitive(99)]}]},
        "bufferViews[7] does not exist": {"meshes": [{"primitives": [_primitive(0, view=7)]}]},
    }.items():
        cases[problem] = document(sound) | change
    cases["values end at byte"]["accessors"] += document(sound)["accessors"][1:]
    for problem, content in cases.items():
        with pytest.raises(FormatError) as caught:
            read_mesh(write(tmp_path, content))
        assert problem in caught.value.problem


def read_damaged() -> Arrays:
    """In the child: how many damaged copies of the compressed mesh are refused, and how many are sound."""
    warnings.simplefilter("ignore")
    refused = sound = 0
    for data in damages(packed(), np.random.default_rng(13)):
        path = write(Path(), document(data))
        try:
            check_sound(parse_gltf(str(path)), path)
            sound += 1
        except InputError:
            refused += 1
    return {"refused": np.array(refused), "sound": np.array(sound)}


def test_damaged_compressed_data_are_refused_or_sound() -> None:
    """Draco is code that is not ours: it must not crash, hang or write beyond its memory."""
    counts = run_limited(read_damaged)
    assert int(counts["refused"]) + int(counts["sound"]) == DAMAGES
    assert int(counts["refused"]) > DAMAGES // 2


def _primitive(position: int, view: int = 0) -> dict[str, Any]:
    extension = {"bufferView": view, "attributes": {"POSITION": position}}
    return {"attributes": {"POSITION": 0}, "indices": 1, "extensions": {"KHR_draco_mesh_compression": extension}}
