"""vto render."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from vto_pipeline.cli.commands.render.draw import meshes_of
from vto_pipeline.io.gltf.write import write_glb
from vto_pipeline.io.meshes import read_mesh, write_ply
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import GlbPart
from vto_pipeline.pipeline.execution.folder import RECORD


@pytest.fixture
def tent() -> Path:
    vertices = np.array([(-0.3, 0.0, 0.0), (0.3, 0.0, 0.0), (0.0, 0.6, 0.0), (0.0, 0.0, 0.3)])
    path = Path("tent.ply").absolute()
    write_ply(path, TriangleMesh(vertices, [[0, 1, 2], [0, 2, 3], [1, 3, 2], [0, 3, 1]]))
    return path


def test_views_are_drawn_beside_a_mesh(vto, tent):
    said = vto("render", tent, "--views", "front, back,front", "--size", 96, "--json", "-q")
    assert said.code == 0
    assert list(said.data["pictures"]) == ["front", "back"]
    for name, one in said.data["pictures"].items():
        assert Path(one["file"]) == tent.parent / "pictures" / f"{name}.png"
        assert one["seconds"] > 0
        with Image.open(one["file"]) as picture:
            assert picture.size == (72, 96)
            assert np.asarray(picture).min() < 240


def test_a_file_in_the_place_of_a_folder_is_refused_and_stays(vto, tent):
    before = tent.read_bytes()
    for place in (tent, tent / "pictures"):
        said = vto("render", tent, "--views", "front", "--size", 64, "-o", place)
        assert said.code == 3
        assert "a file stands where a folder is meant" in said.err
        assert str(tent) in said.err
    assert tent.read_bytes() == before


@pytest.mark.parametrize("name", ["turn.gif", "turn.mp4"])
def test_a_turn_has_all_its_frames(vto, tent, name):
    import cv2

    said = vto("render", tent, "--views", "", "--size", 64, "--turntable", name, "--json")
    assert said.code == 0
    assert list(said.data["pictures"]) == ["turntable"]
    if name.endswith("gif"):
        with Image.open(name) as animation:
            assert (animation.n_frames, animation.size, animation.info["duration"]) == (72, (48, 64), 40)
    else:
        video = cv2.VideoCapture(name)
        frames = sum(1 for _ in iter(lambda: video.read()[0], False))
        assert frames == 72
        assert video.get(cv2.CAP_PROP_FPS) == pytest.approx(24.0)


def test_a_file_for_web_pages_holds_the_mesh(vto, tent):
    said = vto("render", tent, "--views", "", "--web", "new/small.glb", "--json")
    assert said.code == 0
    assert (said.data["web"]["triangles"], said.data["web"]["moved_out_of_body"]) == (4, 0)
    assert Path("new/small.glb").stat().st_size == pytest.approx(1e6 * said.data["web"]["mb"], abs=500)
    (left, right) = (read_mesh(one) for one in (tent, Path("new/small.glb")))
    np.testing.assert_allclose(right.vertices, left.vertices, atol=1e-5)  # half a step of 0.6 m in 65535


def test_an_obj_file_has_its_materials_and_pictures_beside_it(vto):
    shape = trimesh.creation.icosphere(2, 0.5)
    visual = trimesh.visual.TextureVisuals(
        uv=shape.vertices[:, :2] + 0.5,
        material=trimesh.visual.material.PBRMaterial(baseColorTexture=Image.new("RGB", (8, 8), (200, 30, 10))),
    )
    trimesh.Trimesh(shape.vertices, shape.faces, visual=visual, process=False).export("ball.glb")
    said = vto("render", "ball.glb", "--views", "", "--obj", "new/ball.obj", "--json")
    assert said.code == 0
    assert sorted(said.data["obj"]["files"]) == ["new/ball.mtl", "new/ball.obj", "new/ball_0.png"]
    read = trimesh.load("new/ball.obj", process=False)
    assert len(read.faces) == said.data["obj"]["triangles"] == len(shape.faces)
    assert read.visual.material.image.convert("RGB").getpixel((3, 3)) == (200, 30, 10)
    said = vto("render", "new/ball.obj", "--views", "", "--obj", "new/Ball.obj")
    assert said.code == 0  # another name, and so other files
    Path("new/copy.obj").write_bytes(Path("new/ball.obj").read_bytes())
    before = Path("new/ball.mtl").read_bytes()
    said = vto("render", "new/copy.obj", "--views", "", "--obj", "new/ball.obj")  # its materials are those of copy.obj
    assert (said.code, "would replace what it is made from" in said.err) == (2, True)
    assert Path("new/ball.mtl").read_bytes() == before


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        (["tent.ply", "--views", "top"], 2, "no view 'top'; allowed: front, side, back, closeup"),
        (["tent.ply", "--turntable", "turn.avi"], 2, "'turn.avi' cannot hold a moving picture"),
        (["tent.ply", "--web", "small.gltf"], 2, "'small.gltf' is not a name for this file"),
        (["tent.ply", "--size", "10"], 2, "64<=x<=4096"),
        (["none.ply"], 3, "no such file"),
    ],
)
def test_what_cannot_be_drawn_is_refused(vto, tent, arguments, code, text):
    said = vto("render", *arguments)
    assert (said.code, text in said.err) == (code, True)
    assert not Path("pictures").exists()


@pytest.mark.parametrize(("source", "name"), [("tent.glb", "./tent.glb"), (".", "out/tent.glb")])
def test_what_it_is_made_from_is_not_replaced(vto, source, name):
    Path("out").mkdir()
    for path in (Path("tent.glb"), Path("out/tent.glb")):
        path.write_bytes(b"glTF")
    said = vto("render", source, "--views", "", "--web", name)
    assert (said.code, "would replace what it is made from" in said.err) == (2, True)
    assert Path(name).read_bytes() == b"glTF"


def test_a_run_without_a_surface_is_refused(vto):
    assert vto("run", "toy.yaml", "-o", "RUN").code == 0
    said = vto("render", "RUN")
    assert (said.code, "nothing that can be drawn" in said.err) == (3, True)
    said = vto("render", "RUN", "--views", "", "--web", "small.glb")
    assert (said.code, "nothing that can be drawn" in said.err) == (3, True)


def test_a_scene_that_a_run_wrote_is_drawn_part_by_part_in_its_colours(tmp_path):
    out = tmp_path / "run" / "out"
    out.mkdir(parents=True)
    parts = [
        GlbPart("arms_up garment", icosphere(0.1)),
        GlbPart("arms_up body", icosphere(0.2), base_color=(1.0, 0.0, 0.0, 1.0)),
    ]
    write_glb(out / "poses.glb", parts)
    assert len(meshes_of(out / "poses.glb")[0]) == 1  # a file from anywhere: one surface
    (tmp_path / "run" / RECORD).write_text("{}")
    (garment, body), beside = meshes_of(out / "poses.glb")
    assert beside == out / "pictures"
    assert garment.colors is None
    assert (body.colors == (255, 0, 0)).all()


def icosphere(radius):
    mesh = trimesh.creation.icosphere(1, radius)
    return TriangleMesh(mesh.vertices, mesh.faces)
