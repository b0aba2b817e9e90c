"""A picture on a garment follows the drape, and other programs find it in the file."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh
from numpy.testing import assert_allclose

from vto_pipeline.io.gltf.write import write_glb
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import Skin, TriangleMesh
from vto_pipeline.model.render import GlbPart
from vto_pipeline.model.texture import TexturedMesh
from vto_pipeline.render.dress import DressConfig, deform_render_mesh
from vto_pipeline.stages import CATALOGUE

SIDE = 9


def sheet() -> TriangleMesh:
    """A square metre, its picture in two halves that lie apart."""
    x, y = np.meshgrid(np.linspace(0, 1, SIDE), np.linspace(0, 1, SIDE), indexing="ij")
    corner = (np.arange(SIDE - 1)[:, None] * SIDE + np.arange(SIDE - 1)).ravel()
    faces = np.vstack(
        [
            np.column_stack([corner, corner + SIDE, corner + 1]),
            np.column_stack([corner + 1, corner + SIDE, corner + SIDE + 1]),
        ]
    )
    points = np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()])
    place = points[faces][..., :2] * (0.4, 1.0)
    place[points[faces][:, :, 0].mean(axis=1) > 0.5, :, 0] += 0.2
    return TriangleMesh(points, faces, texture=place)


def test_texture_coordinates_follow_the_drape_into_the_file(tmp_path: Path) -> None:
    flat = sheet()
    picture = np.random.default_rng(1).integers(0, 256, (16, 20, 3)).astype(np.uint8)
    draped = TriangleMesh(
        flat.vertices @ np.diag([0.0, 1.0, 1.0]) + flat.vertices[:, :1] * [0.0, 0.0, -1.0], flat.faces
    )
    textured = TexturedMesh(flat, picture, np.ones((16, 20), bool))
    job = Job()
    parts = deform_render_mesh(textured, TriangleMesh(flat.vertices, flat.faces), draped, DressConfig(), job)
    write_glb(tmp_path / "a.glb", parts)
    read = trimesh.load(tmp_path / "a.glb", force="mesh", process=False)
    assert np.array_equal(np.asarray(read.visual.material.baseColorTexture.convert("RGB")), picture)
    corners = np.asarray(read.vertices)[read.faces]
    assert_allclose(corners, draped.vertices[flat.faces], rtol=0, atol=1e-6)  # single precision in the file
    assert_allclose(read.visual.uv[read.faces], flat.texture, rtol=0, atol=1e-6)  # trimesh counts v upward as we do
    assert parts[0].mesh.colors is None  # they would darken the picture
    assert any(what == "thinning out" for what, _ in job.left_out)


def test_the_picture_of_a_given_mesh_is_taken_and_bare_places_stay() -> None:
    """The row takes the file's own triangles where it has a picture, or places for one."""
    flat = sheet()
    picture = np.random.default_rng(2).integers(0, 256, (4, 4, 3)).astype(np.uint8)
    sim = TriangleMesh(flat.vertices, flat.faces)
    row = next(stage for stage in CATALOGUE.stages if stage.name == "transfer")
    inputs = {"garment": sim, "sim_mesh": sim, "draped": sim}
    skinned = replace(flat, skin=Skin(flat.texture[::-1], picture))
    (shown,) = row.run({**inputs, "garment_mesh": skinned}, DressConfig(), Job())["render_mesh"]
    assert np.array_equal(shown.texture, picture)
    assert_allclose(shown.uv[shown.mesh.faces] * (1, -1) + (0, 1), flat.texture[::-1], rtol=0, atol=1e-12)  # rounding
    (placed,) = row.run({**inputs, "garment_mesh": flat}, DressConfig(), Job())["render_mesh"]
    assert placed.texture is None
    assert_allclose(placed.uv[placed.mesh.faces] * (1, -1) + (0, 1), flat.texture, rtol=0, atol=1e-12)  # rounding
    (bare,) = row.run({**inputs, "garment_mesh": sim}, DressConfig(), Job())["render_mesh"]
    assert bare.uv is None


def test_the_body_is_a_part_of_its_own_unless_it_is_not_wanted() -> None:
    sim = TriangleMesh(sheet().vertices, sheet().faces)
    row = next(stage for stage in CATALOGUE.stages if stage.name == "transfer")
    moving = MovingBody(np.stack([sim.vertices - 1.0, sim.vertices - [0.0, 0.0, 0.2]]), sim.faces)
    inputs = {"garment": sim, "sim_mesh": sim, "draped": sim, "collider": moving}
    garment, body = row.run(inputs, DressConfig(), Job())["render_mesh"]
    assert (garment.name, body.name) == ("garment", "body")
    assert np.array_equal(body.mesh.vertices, moving.keyframes[-1])  # as it stands in the end
    assert len(row.run(inputs, DressConfig(body=False), Job())["render_mesh"]) == 1


def test_detail_that_follows_a_coarse_drape_is_not_inside_the_body() -> None:
    """The simulation's triangles lie about a ball; its detail, 3 mm farther in, would cut into it."""
    ball, cage = trimesh.creation.icosphere(5, 0.3), trimesh.creation.icosphere(2, 0.31)
    detail = trimesh.creation.icosphere(5, 0.297)
    sim, fine = (TriangleMesh(one.vertices, one.faces) for one in (cage, detail))
    row = next(stage for stage in CATALOGUE.stages if stage.name == "transfer")
    inputs = {"garment": fine, "sim_mesh": sim, "draped": sim, "collider": MovingBody(ball.vertices[None], ball.faces)}
    for config, parts in ((DressConfig(), 2), (DressConfig(body=False), 1)):
        made = row.run(inputs, config, job := Job())["render_mesh"]
        assert len(made) == parts
        away = np.linalg.norm(made[0].mesh.vertices, axis=1)
        assert away.min() > 0.3
        assert away.max() < 0.302
        assert job.metrics["moved_out_of_body"] == len(fine.vertices)


def test_the_page_shows_the_body_of_a_drape_without_an_avatar() -> None:
    sim = TriangleMesh(sheet().vertices, sheet().faces)
    parts = [GlbPart("garment", sim), GlbPart("body", sim)]
    row = next(stage for stage in CATALOGUE.stages if stage.name == "page")
    page = row.run({"run_record": {"stages": [], "seconds": 1.0}, "render_mesh": parts}, row.settings(), Job())["page"]
    scene = re.search(r'id="scene"[^>]*>(.*?)</script>', page, re.DOTALL)
    assert scene is not None
    assert [layer["name"] for layer in json.loads(scene[1])["layers"]] == ["Garment", "Body"]
