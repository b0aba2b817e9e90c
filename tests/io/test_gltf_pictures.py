"""Pictures in glTF files, written by trimesh or by us: each corner has the colour that its part's picture has there."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose
from PIL import Image

from vto_pipeline.errors import FormatError
from vto_pipeline.io.companions import companions
from vto_pipeline.io.formats import atlas
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

RNG = np.random.default_rng(4)


def part(at: float, picture: np.ndarray | None, repeat: float = 0.0) -> trimesh.Trimesh:
    """A square of 16 triangles, a picture on it from edge to edge, shifted by whole pictures."""
    mesh = trimesh.creation.box((1, 1, 1))
    mesh = trimesh.Trimesh(mesh.vertices[:, [0, 1, 2]] + [at, 0, 0], mesh.faces, process=False)
    place = np.column_stack([mesh.vertices[:, 0] - at + 0.5, mesh.vertices[:, 1] + 0.5]) * 0.9 + 0.05 + repeat
    material = trimesh.visual.material.PBRMaterial(baseColorFactor=[64, 128, 255, 255])
    if picture is not None:
        material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.fromarray(picture))
    mesh.visual = trimesh.visual.TextureVisuals(uv=place, material=material)
    return mesh


def written(path: Path, *parts: trimesh.Trimesh) -> Path:
    path.write_bytes(trimesh.Scene(list(parts)).export(file_type="glb"))
    return path


def color_at(picture: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Colours at texture coordinates, v up, of the pixel that holds each."""
    height, width = picture.shape[:2]
    place = places % 1.0
    return picture[((1 - place[..., 1]) * height).astype(int), (place[..., 0] * width).astype(int)]


def test_pictures_of_several_parts_are_one_picture(tmp_path: Path) -> None:
    pictures = [RNG.integers(0, 256, size).astype(np.uint8) for size in ((32, 48, 3), (64, 16, 3))]
    parts = [part(0.0, pictures[0]), part(2.0, pictures[1], repeat=3.0), part(4.0, None)]
    mesh = read_mesh(written(tmp_path / "a.glb", *parts), unit="m")
    assert mesh.skin is not None
    found = color_at(mesh.skin.picture, mesh.skin.places)
    count = len(parts[0].faces)
    for k, (one, picture) in enumerate(zip(parts[:2], pictures, strict=True)):
        own = slice(k * count, (k + 1) * count)
        assert_allclose(mesh.vertices[mesh.faces[own]], one.vertices[one.faces], rtol=0, atol=1e-6)  # single precision
        assert (found[own] == color_at(picture, one.visual.uv[one.faces])).all()
    linear = np.array([64, 128, 255]) / 255  # a factor is linear light: IEC 61966-2-1
    assert_allclose(
        found[2 * count :], np.broadcast_to(255 * (1.055 * linear ** (1 / 2.4) - 0.055), (count, 3, 3)), atol=1
    )
    assert mesh.texture is not None  # as the file has them: flat pieces are found by them
    assert_allclose(mesh.texture[count : 2 * count], parts[1].visual.uv[parts[1].faces], rtol=0, atol=1e-6)


def test_a_part_without_places_in_the_picture_has_its_plain_colour(tmp_path: Path) -> None:
    picture = RNG.integers(0, 256, (32, 48, 3)).astype(np.uint8)
    bare = part(2.0, None)
    bare.visual = trimesh.visual.TextureVisuals(material=bare.visual.material)
    mesh = read_mesh(written(tmp_path / "a.glb", part(0.0, picture), bare), unit="m")
    assert mesh.texture is None  # for not every corner has a place of its own
    assert mesh.skin is not None
    found, count = color_at(mesh.skin.picture, mesh.skin.places), len(bare.faces)
    assert (found[:count] == color_at(picture, part(0.0, picture).visual.uv[bare.faces])).all()
    linear = np.array([64, 128, 255]) / 255
    assert_allclose(found[count:], np.broadcast_to(255 * (1.055 * linear ** (1 / 2.4) - 0.055), (count, 3, 3)), atol=1)
    painted = part(2.0, None)
    painted.visual = trimesh.visual.ColorVisuals(painted, vertex_colors=RNG.integers(0, 256, (8, 4)).astype(np.uint8))
    beside = read_mesh(written(tmp_path / "b.glb", part(0.0, picture), painted), unit="m")
    assert beside.skin is None  # one plain colour would be wrong


def test_one_picture_may_repeat(tmp_path: Path) -> None:
    picture = RNG.integers(0, 256, (16, 16, 3)).astype(np.uint8)
    wide = part(0.0, picture)
    wide.visual.uv = 5.0 * wide.visual.uv
    mesh = read_mesh(written(tmp_path / "a.glb", wide), unit="m")
    assert mesh.skin is not None
    assert (mesh.skin.picture == picture).all()
    assert_allclose(mesh.skin.places, wide.visual.uv[wide.faces], rtol=0, atol=1e-6)  # single precision in the file


def test_a_picture_that_parts_share_is_taken_once_and_may_repeat_beside_others(tmp_path: Path) -> None:
    shared, other = (
        RNG.integers(0, 256, (64, 48, 3)).astype(np.uint8),
        RNG.integers(0, 256, (16, 16, 3)).astype(np.uint8),
    )
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.fromarray(shared))
    parts = [part(1.5 * k, shared) for k in range(5)] + [part(7.5, other)]
    for one in parts[:5]:
        one.visual.material = material
    parts[2].visual.uv = np.array([2.6, 0.7]) * parts[2].visual.uv - 3.3  # from picture to picture within a triangle
    mesh = read_mesh(written(tmp_path / "a.glb", *parts), unit="m")
    assert mesh.skin is not None
    assert mesh.skin.picture.size < 3 * (5 * shared.size)
    found, count = color_at(mesh.skin.picture, mesh.skin.places), len(parts[0].faces)
    for k, one in enumerate(parts):
        wanted = color_at(other if k == 5 else shared, one.visual.uv[one.faces])
        assert (found[k * count : (k + 1) * count] == wanted).mean() > 0.99  # rounding at a pixel's edge


def test_pictures_that_are_too_large_together_are_halved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pictures = [np.full((256, 200, 3), color, np.uint8) for color in ((250, 0, 0), (0, 250, 0))]
    monkeypatch.setattr(atlas, "LARGEST_PX", 300)
    places = [RNG.uniform(0, 1, (10, 3, 2)) for _ in pictures]
    whole, moved = atlas.join_pictures(pictures, places)
    assert max(whole.shape) <= 300
    found = color_at(whole, moved)
    assert (found[:10] == (250, 0, 0)).all()
    assert (found[10:] == (0, 250, 0)).all()
    monkeypatch.setattr(atlas, "LARGEST_PX", 60)
    with pytest.raises(FormatError, match="repeat too often"):
        atlas.join_pictures(pictures, [100 * place for place in places])


def rewrite(path: Path, edit: Callable[[dict[str, Any]], None]) -> None:
    """Change the JSON of a GLB, whatever its length."""
    data = path.read_bytes()
    length = int.from_bytes(data[12:16], "little")
    tree = json.loads(data[20 : 20 + length])
    edit(tree)
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    head = data[:8] + (len(data) - length + len(text)).to_bytes(4, "little") + len(text).to_bytes(4, "little")
    path.write_bytes(head + data[16:20] + text + data[20 + length :])


def test_plain_parts_have_their_materials_colours(tmp_path: Path) -> None:
    """Base colours are linear light, and multiply the vertices' own."""
    plain, white = part(0.0, None), part(2.0, None)
    white.visual = trimesh.visual.ColorVisuals(white)
    dyed = part(4.0, None)
    colors = RNG.integers(0, 256, (len(dyed.vertices), 4)).astype(np.uint8)
    dyed.visual = trimesh.visual.ColorVisuals(dyed, vertex_colors=colors)
    mesh = read_mesh(written(tmp_path / "a.glb", plain, white, dyed), unit="m")
    assert mesh.skin is None
    assert mesh.colors is not None
    linear = np.array([64, 128, 255]) / 255  # IEC 61966-2-1
    found = [mesh.colors[np.abs(mesh.vertices[:, 0] - at) < 0.6] for at in (0.0, 2.0, 4.0)]
    assert_allclose(found[0], np.broadcast_to(255 * (1.055 * linear ** (1 / 2.4) - 0.055), found[0].shape), atol=1)
    assert (found[1] == 255).all()
    assert np.ptp(found[2].astype(int), axis=0).min() > 50

    def dye(tree):
        for shape in tree["meshes"]:
            shape["primitives"][0]["material"] = 0  # that of the plain part

    rewrite(tmp_path / "a.glb", dye)
    both = read_mesh(tmp_path / "a.glb", unit="m")
    assert both.colors is not None
    order = np.argsort(both.vertices[:, 0] > 3.4, kind="stable")[-len(dyed.vertices) :]
    light = colors[:, :3] / 255 * linear
    curve = np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 1e-9) ** (1 / 2.4) - 0.055)
    assert_allclose(both.colors[order], 255 * curve, atol=2)  # bytes between
    only = read_mesh(written(tmp_path / "b.glb", white), unit="m")
    assert only.colors is None


def test_a_moved_texture_lies_where_the_extension_says(tmp_path: Path) -> None:
    """A quarter turn on paper: (u, v), v down, goes to offset + (v, -u) times scale: counter-clockwise."""
    picture = RNG.integers(0, 256, (40, 40, 3)).astype(np.uint8)
    path = written(tmp_path / "a.glb", part(0.0, picture))

    def move(tree):
        chosen = tree["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]
        change = {"offset": [0.25, 0.5], "scale": [0.5, 0.25], "rotation": np.pi / 2}
        chosen["extensions"] = {"KHR_texture_transform": change}
        tree["extensionsUsed"] = ["KHR_texture_transform"]

    rewrite(path, move)
    mesh = read_mesh(path, unit="m")
    assert mesh.skin is not None
    assert mesh.texture is not None
    u, down = mesh.texture[..., 0], 1 - mesh.texture[..., 1]
    wanted = np.stack([0.25 + 0.25 * down, 0.5 - 0.5 * u], axis=-1)
    assert_allclose(mesh.skin.places * (1, -1) + (0, 1), wanted, rtol=0, atol=1e-6)  # single precision


def test_pictures_beside_a_gltf_file_are_read_and_those_elsewhere_are_not(tmp_path: Path) -> None:
    picture = RNG.integers(0, 256, (16, 16, 3)).astype(np.uint8)
    files = trimesh.exchange.gltf.export_gltf(trimesh.Scene([part(0.0, picture)]))
    folder = tmp_path / "in"
    folder.mkdir()
    for name, data in files.items():
        (folder / name).write_bytes(data)
    tree = json.loads(files["model.gltf"])
    Image.fromarray(picture).save(folder / "cloth 1.png")
    Image.fromarray(picture).save(tmp_path / "secret.png")
    tree["images"][0] = {"uri": "cloth%201.png"}
    (folder / "a.gltf").write_text(json.dumps(tree))
    mesh = read_mesh(folder / "a.gltf", unit="m")
    assert mesh.skin is not None
    assert (mesh.skin.picture == picture).all()
    assert "cloth 1.png" in companions(folder / "a.gltf")
    tree["images"][0] = {"uri": "../secret.png"}
    (folder / "b.gltf").write_text(json.dumps(tree))
    with pytest.raises(FormatError, match="leads out of the folder"):
        read_mesh(folder / "b.gltf", unit="m")


def change(path: Path, edit: object) -> None:
    """Change the JSON of a GLB, the same length kept by spaces."""
    data = path.read_bytes()
    length = int.from_bytes(data[12:16], "little")
    tree = json.loads(data[20 : 20 + length])
    edit(tree)  # type: ignore[operator]
    text = json.dumps(tree, separators=(",", ":")).encode().ljust(length)
    assert len(text) == length
    path.write_bytes(data[:20] + text + data[20 + length :])


@pytest.mark.parametrize(
    "edit",
    [
        lambda tree: tree["images"].__setitem__(0, {"uri": "a.png"}),
        lambda tree: tree["images"].__setitem__(0, {"uri": "data:image/png;base64,####"}),
        lambda tree: tree["images"][0].__setitem__("bufferView", 0),
        lambda tree: tree["textures"][0].__setitem__("source", 7),
        lambda tree: tree.__setitem__("materials", [[]]),
    ],
)
def test_a_wrong_picture_is_ignored_and_told(tmp_path: Path, edit: object) -> None:
    path = written(tmp_path / "a.glb", part(0.0, RNG.integers(0, 256, (16, 16, 3)).astype(np.uint8)))
    change(path, edit)
    job = Job()
    mesh: TriangleMesh = read_mesh(path, unit="m", job=job)
    assert mesh.skin is None
    assert mesh.texture is not None
    assert any("pictures are ignored" in note for note in job.notes)
