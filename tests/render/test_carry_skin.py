"""The picture of a scanned surface stays on what is cut out of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import trimesh
from numpy.testing import assert_allclose

from vto_pipeline.geometry.topology import submesh
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import Skin, TriangleMesh
from vto_pipeline.model.texture import TexturedMesh
from vto_pipeline.render.carry_skin import carry_skin
from vto_pipeline.render.dress import DressConfig
from vto_pipeline.stages import CATALOGUE


def scanned() -> TriangleMesh:
    """A ball whose picture lies in two charts: what is left of x = 0 beside what is right of it."""
    ball = trimesh.creation.icosphere(4, 0.5)
    faces = ball.faces[np.argsort(ball.triangles_center[:, 0], kind="stable")]
    corners = ball.vertices[faces]
    places = 0.25 + 0.4 * corners[..., 1:] / 2
    places[len(faces) // 2 :, :, 0] += 0.5
    picture = np.random.default_rng(5).integers(0, 256, (64, 64, 3)).astype(np.uint8)
    return TriangleMesh(ball.vertices, faces, skin=Skin(places, picture))


def test_what_is_cut_out_keeps_its_places() -> None:
    surface = scanned()
    keep = surface.vertices[surface.faces].mean(axis=1)[:, 1] < 0.2
    shell, _ = submesh(TriangleMesh(surface.vertices, surface.faces), keep)
    found = carry_skin(surface, shell)
    assert_allclose(found.mesh.texture, surface.skin.places[keep], rtol=0, atol=1e-9)  # rounding
    assert np.array_equal(found.picture, surface.skin.picture)


def test_finer_triangles_lie_between_the_places_and_no_face_bridges_two_charts() -> None:
    surface = scanned()
    fine = trimesh.Trimesh(surface.vertices, surface.faces, process=False).subdivide()
    found = carry_skin(surface, TriangleMesh(fine.vertices, fine.faces)).mesh.texture
    middle = fine.vertices[fine.faces].mean(axis=1)
    wanted = 0.25 + 0.2 * middle[:, 1:]
    off = np.abs(found.mean(axis=1) - wanted)
    off[:, 0] = np.minimum(off[:, 0], np.abs(off[:, 0] - 0.5))
    assert off.max() < 1e-9  # places are linear in y and z
    assert np.ptp(found[..., 0], axis=1).max() < 0.05  # charts lie half the picture apart


def test_what_was_filled_has_the_one_colour_beside_it() -> None:
    surface = scanned()
    for size in (1.0, 0.02):
        cap = np.array([0.0, 0.9, 0.0]) + size * np.array([[-0.2, 0.0, 0.0], [0.2, 0.0, 0.0], [0.0, 0.0, 0.3]])
        found = carry_skin(surface, TriangleMesh(cap, np.array([[0, 1, 2]]))).mesh.texture
        assert np.ptp(found, axis=1).max() == 0
        assert 0.34 < found[0, 0, 0] % 0.5 < 0.36  # near the top: y = 0.5


def test_the_row_takes_the_scans_picture_where_the_garment_stands() -> None:
    surface = scanned()
    shift = np.eye(4)
    shift[:3, 3] = [0.3, 1.0, -0.2]
    keep = surface.vertices[surface.faces].mean(axis=1)[:, 1] < 0.2
    shell, _ = submesh(TriangleMesh(surface.vertices + shift[:3, 3], surface.faces), keep)
    row = next(stage for stage in CATALOGUE.stages if stage.name == "transfer")
    inputs = {"garment": shell, "sim_mesh": shell, "draped": shell, "garment_placement": shift}
    (part,) = row.run({**inputs, "garment_surface": surface}, DressConfig(), Job())["render_mesh"]
    assert np.array_equal(part.texture, surface.skin.picture)
    assert_allclose(part.uv[part.mesh.faces] * (1, -1) + (0, 1), surface.skin.places[keep], rtol=0, atol=1e-9)
    bare = replace(surface, skin=None)
    (plain,) = row.run({**inputs, "garment_surface": bare}, DressConfig(), Job())["render_mesh"]
    assert plain.texture is None
    better = np.zeros((8, 8, 3), np.uint8)
    textured = TexturedMesh(replace(shell, texture=np.zeros((len(shell.faces), 3, 2))), better, np.ones((8, 8), bool))
    chosen = {**inputs, "garment_surface": surface, "garment_texture": textured}
    (part,) = row.run(chosen, DressConfig(), Job())["render_mesh"]
    assert np.array_equal(part.texture, better)  # from the photos
