"""The picture on a scanned surface, against paint that is known in closed form."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import painted_tube as scene
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.bench.scan.likeness import seam_steps
from vto_pipeline.bench.scan.look import sample
from vto_pipeline.geometry.rigid import transform_cameras, transform_mesh
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.texture import TexturedMesh
from vto_pipeline.scan.texture.charts import texels_of
from vto_pipeline.scan.texture.project import TextureConfig, texture_surface
from vto_pipeline.stages import CATALOGUE
from vto_pipeline.stages.entry.planning import catalogue, planned


def textured(folder: Path, arc_deg: float, occluder: TriangleMesh | None = None, **photos: object) -> TexturedMesh:
    taken = scene.cameras(12, arc_deg)
    return texture_surface(
        scene.tube(), occluder, scene.photograph(folder, taken, **photos), taken, TextureConfig(), Job()
    )


def texels(found: TexturedMesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where each texel is on the surface [m] (N, 3), its colour (N, 3) and whether it was seen (N,)."""
    height, width = found.picture.shape[:2]
    at = texels_of(found.mesh.texture, (width, height))
    points = np.einsum("nk,nkd->nd", at.weight, found.mesh.vertices[found.mesh.faces[at.face]])
    return points, found.picture[at.row, at.column].astype(float), found.seen[at.row, at.column]


def psnr(one: np.ndarray, other: np.ndarray) -> float:
    return float(10 * np.log10(255.0**2 / ((one - other) ** 2).mean()))


@pytest.fixture(scope="module")
def half(tmp_path_factory: pytest.TempPathFactory) -> TexturedMesh:
    """Photos from an arc of 150 degrees, exposed each in its own way, with a post that no surface tells of."""
    gains = np.exp(np.random.default_rng(3).uniform(-0.2, 0.2, (12, 3)))
    return textured(tmp_path_factory.mktemp("half"), 150.0, gains=gains, with_post=True)


def test_the_paint_is_found(half: TexturedMesh) -> None:
    points, color, seen = texels(half)
    truth = scene.paint(points[seen])
    gain = (color[seen] * truth).sum(axis=0) / (truth**2).sum(axis=0)  # the photos' common exposure is unknown
    assert 34 < psnr(color[seen], gain * truth) < 60
    assert np.abs(np.log(gain)).max() < 0.2


def test_neither_post_nor_backdrop_is_on_it(half: TexturedMesh) -> None:
    points, color, seen = texels(half)
    off = np.abs(color[seen] - scene.paint(points[seen])).max(axis=1)
    assert (off > 60).mean() < 2e-4  # at the ends of the arc two photos show the tube, and none is outvoted
    assert np.abs(color[~seen] - 120).max() < 60  # what is guessed lies between what was seen


def test_what_no_photo_shows_is_marked(half: TexturedMesh) -> None:
    points, _, seen = texels(half)
    eyes = scene.cameras(12, 150.0).world_from_cam[:, :3, 3]
    normal = points * (1, 0, 1) / np.hypot(points[:, 0], points[:, 2])[:, None]
    sight = eyes[:, None] - points
    cosine = np.einsum("cnd,nd->cn", sight, normal) / np.linalg.norm(sight, axis=2)
    best = cosine.max(axis=0)
    inner = np.abs(points[:, 1] - 0.5 * scene.HEIGHT) < 0.45 * scene.HEIGHT
    limit = np.cos(np.radians(TextureConfig().max_angle_deg))
    assert seen[inner & (best > limit + 0.1)].all()  # in between, the outline is too near
    assert not seen[best < limit - 0.03].any()


def test_seams_do_not_show(half: TexturedMesh) -> None:
    """Both charts beside a seam have its colours; without margins they differ by 8 steps of a byte."""
    assert seam_steps(half, sample)["seam_step_p95"] < 3
    loose = replace(half, picture=np.random.default_rng(0).integers(0, 256, half.picture.shape).astype(np.uint8))
    assert seam_steps(loose, sample)["seam_step_p95"] > 100  # there are seams


def test_a_known_occluder_hides_what_is_behind_it(tmp_path: Path) -> None:
    """Two photos cannot outvote each other: only the post's surface tells which of them shows the tube."""
    taken = scene.cameras(2, 16.0)
    photos = scene.photograph(tmp_path, taken, with_post=True)
    wrong = []
    for occluder in (None, scene.post()):
        found = texture_surface(scene.tube(), occluder, photos, taken, TextureConfig(), Job())
        points, color, seen = texels(found)
        wrong.append((np.abs(color[seen] - scene.paint(points[seen])).max(axis=1) > 60).mean())
    assert wrong[0] > 0.02
    assert wrong[1] == 0


def test_the_same_bits_twice(tmp_path: Path, half: TexturedMesh) -> None:
    gains = np.exp(np.random.default_rng(3).uniform(-0.2, 0.2, (12, 3)))
    again = textured(tmp_path, 150.0, gains=gains, with_post=True)
    assert np.array_equal(again.picture, half.picture)
    assert np.array_equal(again.mesh.texture, half.mesh.texture)


def test_the_row_brings_cameras_and_scene_into_the_frame_of_the_garment(tmp_path: Path) -> None:
    """The scan has a frame and a unit of its own; the garment was placed in the form's, in metres."""
    garment_from_scan = np.eye(4)
    garment_from_scan[:3, :3] = 2.5 * np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    garment_from_scan[:3, 3] = (0.3, -0.2, 0.1)
    taken, back = scene.cameras(2, 16.0), np.linalg.inv(garment_from_scan)
    inputs = {
        "garment": scene.tube(),
        "garment_photos": scene.photograph(tmp_path, taken, with_post=True),
        "garment_cameras": transform_cameras(taken, back),
        "garment_surface": transform_mesh(scene.post(), back),
        "garment_placement": garment_from_scan,
    }
    row = next(stage for stage in CATALOGUE.stages if stage.name == "texture")
    job = Job()
    points, color, seen = texels(row.run(inputs, TextureConfig(), job)["garment_texture"])
    assert np.abs(color[seen] - scene.paint(points[seen])).max() < 60
    assert 0.2 < job.metrics["textured_share"] < 0.5  # less than half of a tube is seen from one side
    assert_allclose(job.metrics["textured_share"], seen.mean(), rtol=0, atol=0.02)  # margins are counted in one


def test_photos_are_laid_on_and_frames_are_not() -> None:
    for name, made in (("demo", True), ("garment_from_depth", False)):
        _, plan = planned(Path(__file__).parents[2] / "configs" / f"{name}.yaml", (), catalogue())
        steps = {step.stage.name: step.inputs for step in plan.steps}
        assert ("texture" in steps) == made
        assert ("garment_texture" in steps["transfer"]) == made
    assert "photos" in plan.left_out["texture"]


def test_a_strip_of_the_form_at_a_rim_is_not_on_it(tmp_path: Path) -> None:
    """Ten millimetres of form were cut off with the cloth; only the colours beside the garment tell."""
    taken = scene.cameras(5, 60.0)
    photos = scene.photograph(tmp_path, taken, skin=0.010)
    form = np.rint(scene.SKIN + np.random.default_rng(1).normal(0, 3, (500, 3))).astype(np.uint8)
    strips, cloths = [], []
    for known in (None, form):
        found = texture_surface(scene.tube(), None, photos, taken, TextureConfig(), Job(), known)
        points, color, seen = texels(found)
        strip = seen & (points[:, 1] > scene.HEIGHT - 0.008)
        strips.append((np.abs(color[strip] - scene.SKIN).max(axis=1) < 60).sum())
        cloth = seen & (points[:, 1] < scene.HEIGHT - 0.014)
        assert psnr(color[cloth], scene.paint(points[cloth])) > 33
        cloths.append(cloth.sum())
    assert strips[0] > 500
    assert strips[1] == 0
    assert cloths[1] == cloths[0]  # no cloth is taken for form
