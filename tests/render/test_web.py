"""The render mesh within a web page's limits, on surfaces with a formula, and by readers of others."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.errors import InputError
from vto_pipeline.geometry.topology import edge_face_counts
from vto_pipeline.io.gltf.web import LIMIT_BYTES, write_web_glb
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import GlbPart
from vto_pipeline.render.clear_body import clear_body
from vto_pipeline.render.dress import BODY
from vto_pipeline.render.web import shrink_pictures, thin_parts

RADIUS, TALL = 0.3, 0.8
RNG = np.random.default_rng(3)


def half_tube(first: float, around: int, up: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Half of a tube from an angle on: its places, its triangles, and the angle and height of each place."""
    angle, height = np.meshgrid(
        first + np.pi * np.arange(around + 1) / around, TALL * np.arange(up + 1) / up, indexing="ij"
    )
    points = np.stack([RADIUS * np.sin(angle), height, RADIUS * np.cos(angle)], -1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(around), np.arange(up), indexing="ij")
    a = (i * (up + 1) + j).reshape(-1)
    faces = np.stack([a, a + up + 1, a + up + 2, a, a + up + 2, a + 1], -1).reshape(-1, 3)
    return points, faces, np.stack([angle.reshape(-1), height.reshape(-1)], -1)


@pytest.fixture(scope="module")
def tube() -> GlbPart:
    """A tube of two charts, which lie apart in the picture."""
    halves = [half_tube(0.0, 60, 40), half_tube(np.pi, 60, 40)]
    uv = [
        np.stack([0.05 + 0.4 * (place[:, 0] - k * np.pi) / np.pi + 0.5 * k, 1 - place[:, 1] / TALL], -1)
        for k, (_, _, place) in enumerate(halves)
    ]
    points = np.vstack([half[0] for half in halves])
    faces = np.vstack([halves[0][1], halves[1][1] + len(halves[0][0])])
    normals = points * (1 / RADIUS, 0, 1 / RADIUS)
    picture = np.zeros((64, 64, 3), np.uint8)
    return GlbPart("tube", TriangleMesh(points, faces), normals=normals, uv=np.vstack(uv), texture=picture)


def test_a_thinned_tube_keeps_its_picture_its_seams_and_its_ends(tube: GlbPart) -> None:
    (thin,) = thin_parts([tube], 3_000)
    assert 1_000 < len(thin.mesh.faces) <= 3_000
    x, y, z = thin.mesh.vertices.T
    assert_allclose(np.hypot(x, z), RADIUS, rtol=0.02)  # flat triangles between places on the tube
    assert_allclose(thin.uv[:, 1], 1 - y / TALL, atol=0.01)  # of the height: places move a little along the surface
    chart = (thin.uv[:, 0] > 0.5).astype(int)
    angle = np.pi * (thin.uv[:, 0] - 0.05 - 0.5 * chart) / 0.4 + np.pi * chart
    assert_allclose(RADIUS * np.sin(angle), x, atol=0.005)
    assert_allclose(RADIUS * np.cos(angle), z, atol=0.005)
    outward = np.stack([x, 0 * y, z], -1) / np.hypot(x, z)[:, None]
    assert (np.einsum("vd,vd->v", thin.normals, outward) > 0.99).all()
    points, whole = np.unique(np.round(thin.mesh.vertices, 9), axis=0, return_inverse=True)
    welded = TriangleMesh(points, whole.reshape(-1)[thin.mesh.faces])
    edge, count = edge_face_counts(welded)
    ends = points[edge[count == 1]][..., 1]
    assert len(ends) == 2 * 120  # a crack along a seam would have more
    assert set(ends.reshape(-1)) == {0.0, TALL}


def test_small_parts_stay_as_they_are_and_impossible_ones_are_refused(tube: GlbPart) -> None:
    assert thin_parts([tube], 10_000) == [tube]
    with pytest.raises(InputError, match="9600 triangles cannot be thinned out to 100"):
        thin_parts([tube], 100)


def test_no_vertex_is_left_inside_a_body_with_creases() -> None:
    o3d = pytest.importorskip("open3d")
    import trimesh

    boxes = [trimesh.creation.box((0.4, 0.2, 0.2)), trimesh.creation.box((0.2, 0.6, 0.25))]
    body = trimesh.boolean.union([*boxes, trimesh.creation.icosphere(3, 0.17)])
    points = RNG.uniform(-0.35, 0.35, (3_000, 3))
    near = body.sample(300, seed=1)  # to within rounding on the surface
    points = np.vstack([points, near])
    cloth = GlbPart("garment", TriangleMesh(points, np.arange(3_300).reshape(-1, 3)))
    parts, moved = clear_body([cloth, GlbPart(BODY, TriangleMesh(body.vertices, body.faces))])
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(body.vertices.astype(np.float32), body.faces.astype(np.uint32))
    before, after = (
        scene.compute_signed_distance(one.astype(np.float32), nsamples=5).numpy()
        for one in (points, parts[0].mesh.vertices)
    )
    assert (before < 0).sum() > 300
    assert after.min() > 0.0001
    far = before > 0.009  # nearer ones may be raised, for these faces cut right through the body
    assert (parts[0].mesh.vertices[far] == points[far]).all()  # what is clear stays
    assert (before < 0).sum() < moved <= (~far).sum()
    assert np.abs(after[before < 0]).max() < 0.01  # just outside, not far off
    alone, none = clear_body([cloth])
    assert (alone, none) == ([cloth], 0)


def decoded(path: Path) -> list[dict[str, np.ndarray]]:
    """The attributes of each part as the specification of glTF has them, with numpy alone."""
    data = path.read_bytes()
    size = struct.unpack_from("<I", data, 12)[0]
    document, binary = json.loads(data[20 : 20 + size]), data[28 + size :]
    kinds = {5121: ("<u1", 255), 5122: ("<i2", 32767), 5123: ("<u2", 65535), 5125: ("<u4", 1), 5126: ("<f4", 1)}

    def values(index: int) -> np.ndarray:
        accessor = document["accessors"][index]
        view = document["bufferViews"][accessor["bufferView"]]
        kind, most = kinds[accessor["componentType"]]
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[accessor["type"]]
        stride = view.get("byteStride", width * np.dtype(kind).itemsize)
        assert stride % 4 == 0 or width == 1
        start = view["byteOffset"] + accessor.get("byteOffset", 0)
        rows = np.ndarray((accessor["count"], width), kind, binary, start, (stride, np.dtype(kind).itemsize))
        return rows / (most if accessor.get("normalized") else 1)

    parts = []
    for node in document["nodes"]:
        (primitive,) = document["meshes"][node["mesh"]]["primitives"]
        part = {name: values(index) for name, index in primitive["attributes"].items()}
        part["POSITION"] = part["POSITION"] * node["scale"] + node["translation"]
        parts.append({**part, "faces": values(primitive["indices"]).reshape(-1, 3)})
    assert document["extensionsRequired"] == ["KHR_mesh_quantization"]
    return parts


def test_the_file_holds_what_it_was_given_to_half_a_step(tube: GlbPart, tmp_path: Path) -> None:
    points = RNG.uniform(-1.0, 1.0, (70_002, 3))  # more than two bytes can number
    colors = RNG.integers(0, 256, (70_002, 3)).astype(np.uint8)
    plain = GlbPart("plain", TriangleMesh(points, np.arange(70_002).reshape(-1, 3), colors))
    beyond = GlbPart("beyond", tube.mesh, uv=3.0 * tube.uv - 1.0)  # repeats its picture
    write_web_glb(tmp_path / "web.glb", [tube, plain, beyond])
    first, second, third = decoded(tmp_path / "web.glb")
    assert_allclose(first["POSITION"], tube.mesh.vertices, atol=0.5 * TALL / 65535 * 1.001)
    assert_allclose(first["NORMAL"], tube.normals, atol=1e-4)
    assert_allclose(first["TEXCOORD_0"], tube.uv, atol=1e-5)
    assert (first["faces"] == tube.mesh.faces).all()
    assert_allclose(second["POSITION"], points, atol=0.5 * 2.0 / 65535 * 1.001)
    assert (second["faces"] == plain.mesh.faces).all()
    linear = np.where(colors / 255 <= 0.04045, colors / 255 / 12.92, ((colors / 255 + 0.055) / 1.055) ** 2.4)
    assert_allclose(second["COLOR_0"], linear, atol=1e-5)
    assert_allclose(third["TEXCOORD_0"], beyond.uv, atol=1e-6)
    again = read_mesh(tmp_path / "web.glb")
    assert_allclose(again.vertices[: len(first["POSITION"])], first["POSITION"], atol=1e-9)


def noise(count: int) -> list[GlbPart]:
    """Cards with pictures that no encoder makes small."""
    square = TriangleMesh(np.array([(0.0, 0, 0), (1, 0, 0), (1, 1, 0)]), [[0, 1, 2]])
    uv = np.array([(0.0, 1.0), (1.0, 1.0), (1.0, 0.0)])
    return [
        GlbPart(f"card {k}", square, uv=uv, texture=RNG.integers(0, 256, (900, 900, 3)).astype(np.uint8))
        for k in range(count)
    ]


def test_pictures_are_made_coarser_until_the_file_is_small_enough(tmp_path: Path) -> None:
    assert write_web_glb(tmp_path / "one.glb", noise(1)) == 92
    assert write_web_glb(tmp_path / "few.glb", noise(4)) < 92
    assert 0.5 * LIMIT_BYTES < (tmp_path / "few.glb").stat().st_size <= LIMIT_BYTES
    with pytest.raises(InputError, match="5 MB are allowed"):
        write_web_glb(tmp_path / "many.glb", noise(16))
    assert not (tmp_path / "many.glb").exists()


def test_pictures_shrink_to_the_side_and_keep_their_mean() -> None:
    (card,) = noise(1)
    (shrunk,) = shrink_pictures([card], 300)
    assert shrunk.texture.shape == (300, 300, 3)
    assert_allclose(shrunk.texture, card.texture.reshape(300, 3, 300, 3, 3).mean(axis=(1, 3)), atol=0.51)  # bytes
    assert shrink_pictures([card], 900) == [card]
