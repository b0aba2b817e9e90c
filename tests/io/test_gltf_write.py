"""GLB files: read back by ourselves, by pygltflib and by trimesh; laid out as glTF 2.0 section 3 asks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from io_shapes import capsule
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.errors import InputError
from vto_pipeline.io.gltf.write import read_glb, write_glb
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import GlbPart
from vto_pipeline.numerics.srgb import decode_srgb, encode_srgb

SINGLE = {"rtol": 0, "atol": 1.2e-7}  # single precision at 1 to 2 m


def parts() -> list[GlbPart]:
    truth = capsule()
    vertices, faces = np.array(truth.vertices), np.array(truth.faces)
    rng = np.random.default_rng(5)
    normals = np.array(truth.vertex_normals)
    normals[7] = 0.0  # a vertex without a direction
    uv = rng.random((len(vertices), 2))
    small = rng.integers(0, 256, (32, 64, 3)).astype(np.uint8)
    large = np.kron(rng.integers(0, 256, (8, 8, 3)), np.ones((128, 128, 1))).astype(np.uint8)
    return [
        GlbPart("body", TriangleMesh(vertices, faces, truth.visual.vertex_colors[:, :3]), normals, roughness=0.5),
        GlbPart("shirt", TriangleMesh(vertices + 1.0, faces), normals, uv, small, metallic=0.25),
        GlbPart("veil", TriangleMesh(vertices, faces), None, uv, large, (0.5, 0.25, 1.0, 0.75), double_sided=False),
    ]


def test_parts_come_back(tmp_path: Path) -> None:
    write_glb(tmp_path / "a.glb", parts())
    back = read_glb(tmp_path / "a.glb")
    for ours, theirs in zip(parts(), back, strict=True):
        assert_allclose(theirs.mesh.vertices, ours.mesh.vertices, **SINGLE)
        assert_array_equal(theirs.mesh.faces, ours.mesh.faces)
        assert (theirs.mesh.colors is None) == (ours.mesh.colors is None)
        if ours.mesh.colors is not None:
            assert_array_equal(theirs.mesh.colors, ours.mesh.colors)
        if ours.uv is not None:
            assert_allclose(theirs.uv, ours.uv, **SINGLE)
        for name in ("name", "base_color", "roughness", "metallic", "double_sided"):
            assert getattr(theirs, name) == getattr(ours, name)
    assert_array_equal(back[1].texture, parts()[1].texture)  # small: PNG, exact
    difference = np.abs(back[2].texture.astype(int) - parts()[2].texture)
    assert difference.max() > 0  # large: JPEG
    assert difference.mean() < 2.0  # of 255: quality 92 on flat squares


def test_trimesh_reads_the_same(tmp_path: Path) -> None:
    import trimesh

    write_glb(tmp_path / "a.glb", parts())
    scene = trimesh.load(tmp_path / "a.glb", process=False)
    for ours in parts():
        theirs = scene.geometry[ours.name]
        assert_allclose(theirs.vertices, ours.mesh.vertices, **SINGLE)
        assert_array_equal(theirs.faces, ours.mesh.faces)
        if ours.uv is not None:
            flipped = np.column_stack([ours.uv[:, 0], 1.0 - ours.uv[:, 1]])  # trimesh counts v upwards
            assert_allclose(theirs.visual.uv, flipped, **SINGLE)


def test_the_layout_is_that_of_the_standard(tmp_path: Path) -> None:
    import pygltflib

    write_glb(tmp_path / "a.glb", parts())
    data = (tmp_path / "a.glb").read_bytes()
    assert data[:4] == b"glTF"
    assert int.from_bytes(data[8:12], "little") == len(data)
    gltf = pygltflib.GLTF2.load_from_bytes(data)
    blob = gltf.binary_blob()
    assert any(view.byteLength % 4 for view in gltf.bufferViews)  # else the next line shows nothing
    for view in gltf.bufferViews:
        assert view.byteOffset % 4 == 0
        assert view.byteOffset + view.byteLength <= len(blob)
    for mesh, part in zip(gltf.meshes, parts(), strict=True):
        (primitive,) = mesh.primitives
        position = gltf.accessors[primitive.attributes.POSITION]
        low, high = part.mesh.vertices.astype("f4").min(axis=0), part.mesh.vertices.astype("f4").max(axis=0)
        assert (position.min, position.max) == (low.tolist(), high.tolist())
        assert gltf.accessors[primitive.indices].count == 3 * len(part.mesh.faces)
        if primitive.attributes.NORMAL is not None:
            accessor = gltf.accessors[primitive.attributes.NORMAL]
            view = gltf.bufferViews[accessor.bufferView]
            normals = np.frombuffer(blob, "<f4", 3 * accessor.count, view.byteOffset).reshape(-1, 3)
            assert_allclose(np.linalg.norm(normals, axis=1), 1.0, rtol=0, atol=1e-6)  # single precision
    assert [material.alphaMode for material in gltf.materials] == ["OPAQUE", "OPAQUE", "BLEND"]
    assert [image.mimeType for image in gltf.images] == ["image/png", "image/jpeg"]


def test_the_same_parts_give_the_same_bytes(tmp_path: Path) -> None:
    write_glb(tmp_path / "a.glb", parts())
    write_glb(tmp_path / "b.glb", parts())
    assert (tmp_path / "a.glb").read_bytes() == (tmp_path / "b.glb").read_bytes()


def test_srgb_curves_are_inverse_and_that_of_the_standard() -> None:
    every = np.arange(256, dtype=np.uint8)
    assert_array_equal(encode_srgb(decode_srgb(every)), every)
    # IEC 61966-2-1: middle grey 188 of 255 is half the light of white; 0.5029 by the formula
    assert_allclose(decode_srgb(np.array([0, 188, 255], np.uint8)), [0.0, 0.5029, 1.0], rtol=0, atol=1e-4)


def test_names_must_differ(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="different names"):
        write_glb(tmp_path / "a.glb", [parts()[0], parts()[0]])
    with pytest.raises(InputError, match="different names"):
        write_glb(tmp_path / "a.glb", [])
    assert not (tmp_path / "a.glb").exists()
