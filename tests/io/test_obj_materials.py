"""OBJ with materials: what trimesh writes is read, and what is written is read by Open3D and by trimesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose
from PIL import Image

from vto_pipeline.io.companions import companions
from vto_pipeline.io.formats.obj_parts import obj_files, write_obj
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import GlbPart
from vto_pipeline.pipeline.execution.digest import digest_path

RNG = np.random.default_rng(8)
SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1.5 0\nv 0 1.5 0\nvt 0.1 0.1\nvt 0.9 0.1\nvt 0.9 0.9\nvt 0.1 0.9\n"


def noise(height: int, width: int) -> np.ndarray:
    return RNG.integers(0, 256, (height, width, 3)).astype(np.uint8)


def color_at(picture: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Colours at texture coordinates, v up, of the pixel that holds each."""
    height, width = picture.shape[:2]
    place = places % 1.0
    return picture[((1 - place[..., 1]) * height).astype(int), (place[..., 0] * width).astype(int)]


def textured(picture: np.ndarray, at: float = 0.0) -> trimesh.Trimesh:
    mesh = trimesh.creation.icosphere(2, 0.5)
    mesh.apply_translation([at, 0.0, 0.0])
    material = trimesh.visual.material.SimpleMaterial(image=Image.fromarray(picture))
    mesh.visual = trimesh.visual.TextureVisuals(uv=RNG.uniform(0.05, 0.95, (len(mesh.vertices), 2)), material=material)
    return mesh


def test_pictures_beside_an_obj_of_trimesh_are_on_the_right_corners(tmp_path: Path) -> None:
    pictures = [noise(32, 48), noise(64, 16)]
    parts = [textured(pictures[0]), textured(pictures[1], at=2.0)]
    trimesh.Scene(parts).export(tmp_path / "a.obj")
    mesh = read_mesh(tmp_path / "a.obj", unit="m")
    assert mesh.skin is not None
    found, count = color_at(mesh.skin.picture, mesh.skin.places), len(parts[0].faces)
    for k, (part, picture) in enumerate(zip(parts, pictures, strict=True)):
        own = slice(k * count, (k + 1) * count)
        assert_allclose(mesh.vertices[mesh.faces[own]], part.vertices[part.faces], rtol=0, atol=1e-7)  # 8 digits
        assert (found[own] == color_at(picture, part.visual.uv[part.faces])).all()


def test_a_polygon_keeps_its_material_and_faces_without_places_have_a_plain_colour(tmp_path: Path) -> None:
    picture = noise(20, 20)
    Image.fromarray(picture).save(tmp_path / "my cloth.png")
    (tmp_path / "m.mtl").write_text(
        "newmtl cloth\nKd 0 0 0\nmap_Kd -s 1 1 1 -clamp off C:\\work\\my cloth.png\nnewmtl trim\nKd 1 0.2 0\n"
    )
    faces = "usemtl trim\nf 1 2 3\nusemtl cloth\nf 1/1 2/2 3/3 4/4\nf 1/1 2/2 3/3\nusemtl absent\nf 4 3 2\n"
    (tmp_path / "a.obj").write_text("mtllib m.mtl\n" + SQUARE + faces)
    mesh = read_mesh(tmp_path / "a.obj", unit="m")  # triangles stand before the quad's two
    assert mesh.texture is None  # for not every corner has one
    assert mesh.skin is not None
    found = color_at(mesh.skin.picture, mesh.skin.places)
    places = np.array([[0.1, 0.1], [0.9, 0.1], [0.9, 0.9], [0.1, 0.9]])
    assert (found[0] == (255, 51, 0)).all()
    for face, corners in ((1, [0, 1, 2]), (3, [0, 1, 2]), (4, [0, 2, 3])):
        assert (found[face] == color_at(picture, places[corners])).all()
    assert (found[2] == 255).all()


@pytest.mark.parametrize(
    ("library", "note"),
    [
        ("newmtl m\nmap_Kd ../secret.png\n", "is not beside the file"),
        ("newmtl m\nmap_Kd /etc/hostname\n", "is not beside the file"),
        ("newmtl m\nmap_Kd link.png\n", "is not beside the file"),
        ("newmtl m\nmap_Kd broken.png\n", "a picture is broken"),
    ],
)
def test_pictures_from_elsewhere_or_broken_are_not_read(tmp_path: Path, library: str, note: str) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    Image.fromarray(noise(4, 4)).save(tmp_path / "secret.png")
    (folder / "link.png").symlink_to(tmp_path / "secret.png")
    (folder / "broken.png").write_bytes(b"\x89PNG\r\n\x1a\n broken")
    (folder / "m.mtl").write_text(library)
    (folder / "a.obj").write_text("mtllib m.mtl\nusemtl m\n" + SQUARE + "f 1/1 2/2 3/3\n")
    job = Job()
    mesh = read_mesh(folder / "a.obj", unit="m", job=job)
    assert mesh.skin is None
    assert mesh.texture is not None
    assert any("materials are ignored" in text and note in text for text in job.notes)


def test_a_changed_picture_is_another_input(tmp_path: Path) -> None:
    trimesh.Scene([textured(noise(8, 8))]).export(tmp_path / "a.obj")
    (library,) = tmp_path.glob("*.mtl")
    (picture,) = tmp_path.glob("*.png")
    assert companions(tmp_path / "a.obj") == {file.name: file for file in (library, picture)}
    before = digest_path(tmp_path / "a.obj")
    Image.fromarray(noise(8, 8)).save(picture)
    between = digest_path(tmp_path / "a.obj")
    library.write_text(library.read_text() + "# more\n")
    assert len({before, between, digest_path(tmp_path / "a.obj")}) == 3


def parts_to_write() -> list[GlbPart]:
    ball = trimesh.creation.icosphere(2, 0.5)
    mesh = TriangleMesh(ball.vertices, ball.faces)
    places = RNG.uniform(0.02, 0.98, (len(mesh.vertices), 2))
    colored = TriangleMesh(
        ball.vertices + np.array([4, 0, 0]), ball.faces, colors=RNG.integers(0, 256, (len(ball.vertices), 3))
    )
    return [
        GlbPart(
            "body", TriangleMesh(ball.vertices + np.array([2, 0, 0]), ball.faces), base_color=(0.5, 0.25, 0.125, 1.0)
        ),
        GlbPart("shirt / front", mesh, normals=ball.vertices * 2.0, uv=places, texture=noise(24, 40)),
        GlbPart("dyed", colored),
    ]


def test_what_is_written_is_read_by_open3d(tmp_path: Path) -> None:
    import open3d as o3d

    parts = parts_to_write()
    write_obj(tmp_path / "my look.obj", parts)
    assert {file.name for file in tmp_path.iterdir()} == {"my look.obj", "my_look.mtl", "my_look_1.png"}
    assert sorted(obj_files(tmp_path / "my look.obj", parts).values()) == sorted(tmp_path.iterdir())
    model = o3d.io.read_triangle_model(str(tmp_path / "my look.obj"))
    found = {one.mesh_name: one for one in model.meshes}
    assert len(found) == 3
    for part, one in zip(parts, model.meshes, strict=True):
        corners = np.asarray(one.mesh.vertices)[np.asarray(one.mesh.triangles)]
        assert_allclose(corners, part.mesh.vertices[part.mesh.faces], rtol=0, atol=3e-7)  # single precision, at 4 m
    body, shirt, _ = (model.materials[one.material_idx] for one in model.meshes)
    linear = np.array([0.5, 0.25, 0.125])
    assert_allclose(body.base_color[:3], 1.055 * linear ** (1 / 2.4) - 0.055, rtol=0, atol=1e-5)  # IEC 61966-2-1
    assert np.array_equal(np.asarray(shirt.albedo_img)[..., :3], parts[1].texture)
    uv = np.asarray(model.meshes[1].mesh.triangle_uvs).reshape(-1, 3, 2)
    assert_allclose(uv * (1, -1) + (0, 1), parts[1].uv[parts[1].mesh.faces], rtol=0, atol=1e-6)  # v up in OBJ


def test_what_is_written_is_read_by_trimesh_and_by_us(tmp_path: Path) -> None:
    parts = parts_to_write()
    write_obj(tmp_path / "a.obj", parts)
    scene = trimesh.load(tmp_path / "a.obj", process=False, split_objects=True, group_material=False)
    shirt = next(one for one in scene.geometry.values() if getattr(one.visual.material, "image", None) is not None)
    corner = color_at(np.asarray(shirt.visual.material.image.convert("RGB")), shirt.visual.uv[shirt.faces])
    places = parts[1].uv[parts[1].mesh.faces] * (1, -1) + (0, 1)
    assert (corner == color_at(parts[1].texture, places)).all()
    ours = read_mesh(tmp_path / "a.obj", unit="m")
    assert ours.skin is not None
    count = len(parts[0].mesh.faces)
    found = color_at(ours.skin.picture, ours.skin.places)
    assert np.ptp(found[:count].reshape(-1, 3), axis=0).max() == 0
    assert (found[count : 2 * count] == corner).all()
    assert_allclose(ours.vertices, np.vstack([part.mesh.vertices for part in parts]), rtol=0, atol=1e-7)  # 7 digits
