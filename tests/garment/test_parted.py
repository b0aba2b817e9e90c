"""Lost straps make one opening of neck and armholes. The photos, drawn by another ray caster, show them."""

from __future__ import annotations

import re
from contextlib import nullcontext
from pathlib import Path

import cv2
import numpy as np
import pytest
from dressed_form import HIGH, LOW, form_distance, largest, level_set, outward

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.align import PosedPhotos
from vto_pipeline.garment.openings import OpeningsConfig, list_openings
from vto_pipeline.garment.photographed.parted import parted_openings, refuse_parted
from vto_pipeline.garment.photographed.sightings import Sightings, look_at_mannequin
from vto_pipeline.geometry.topology import concatenate, submesh, surface_area
from vto_pipeline.model.camera import CameraSet, Intrinsics
from vto_pipeline.model.frames import DepthFrameSet
from vto_pipeline.model.garment import SurfaceLabels
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.stages.garment import STAGES

LENS = Intrinsics(400, 400, 480.0, 480.0, 199.5, 199.5)
STRAPS = 0.69
"""Above this height the straps are [m]."""
PRINT, SKIN, WALL = np.array([[200, 60, 90], [60, 90, 180], [230, 200, 60]]), np.array([225, 205, 180]), 128
CELL = 0.012


def form() -> TriangleMesh:
    return outward(*level_set(form_distance, LOW, HIGH, CELL))


def tank_top() -> TriangleMesh:
    """8 mm off the form, without sleeves."""
    cloth = outward(*level_set(lambda p: form_distance(p) - 0.008, LOW, HIGH, CELL))
    x, y, _ = cloth.vertices[cloth.faces].mean(axis=1).T
    neck = (np.abs(x) < 0.08) & (y > 0.76)
    return largest(submesh(cloth, (y > 0.25) & (np.abs(x) < 0.165) & ~neck)[0])


def without_straps(garment: TriangleMesh) -> TriangleMesh:
    return largest(submesh(garment, garment.vertices[garment.faces][..., 1].max(axis=1) < STRAPS)[0])


def around() -> list[np.ndarray]:
    """Sixteen poses, half of them from above."""
    middle, poses = np.array([0.0, 0.55, 0.0]), []
    for k in range(16):
        turn, rise = 2.0 * np.pi * k / 16, np.radians(15.0 if k % 2 else 40.0)
        eye = middle + 1.3 * np.array([np.sin(turn) * np.cos(rise), np.sin(rise), np.cos(turn) * np.cos(rise)])
        ahead = (middle - eye) / np.linalg.norm(middle - eye)
        right = np.cross(ahead, [0.0, 1.0, 0.0]) / np.cos(rise)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = np.column_stack([right, np.cross(ahead, right), ahead]), eye
        poses.append(pose)
    return poses


def photographs(folder, garment: TriangleMesh, body: TriangleMesh, cloth=PRINT) -> PosedPhotos:
    """A photo from each pose."""
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene()
    for mesh in (garment, body):
        scene.add_triangles(mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32))
    rng = np.random.default_rng(0)
    paint = cloth[rng.integers(0, len(cloth), len(garment.faces))]
    names, poses, folder = [], around(), folder / "photos"
    folder.mkdir()
    half_pixel = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [0.0, 0.0, 1.0]])
    for k, pose in enumerate(poses):
        cam_from_world = np.linalg.inv(pose)
        rays = o3d.t.geometry.RaycastingScene.create_rays_pinhole(
            o3d.core.Tensor(half_pixel @ LENS.matrix),
            o3d.core.Tensor(cam_from_world),
            LENS.width,
            LENS.height,
        )
        hit = scene.cast_rays(rays)
        thing, face = hit["geometry_ids"].numpy(), hit["primitive_ids"].numpy()
        picture = np.full((LENS.height, LENS.width, 3), WALL, float)
        picture[thing == 1] = SKIN
        picture[thing == 0] = paint[face[thing == 0]]
        picture = np.clip(picture * (0.8 + 0.02 * k) + rng.normal(0, 5, picture.shape), 0, 255)  # exposure changes
        names.append(f"{k:02}.png")
        cv2.imwrite(str(folder / names[-1]), picture[..., ::-1].astype(np.uint8))
    cameras = CameraSet(tuple(names), (LENS,) * 16, np.array(poses))
    return PosedPhotos(tuple(folder / name for name in names), cameras)


def checked(found: TriangleMesh, body: TriangleMesh, photos: PosedPhotos, answered=False) -> Job:
    job = Job()
    seen = np.ones(len(found.vertices), bool)
    sightings = look_at_mannequin(found, seen, body, photos, job)
    if sightings is not None:
        refuse_parted(sightings, found, list_openings(found), answered, job)
    return job


@pytest.fixture(scope="module")
def dressed(tmp_path_factory):
    body, top = form(), tank_top()
    assert len(list_openings(top)) == 4  # neck, armholes, hem
    assert len(list_openings(without_straps(top))) == 2
    return body, top, photographs(tmp_path_factory.mktemp("tank"), top, body)


def test_an_opening_without_the_straps_that_parted_it_is_refused_and_named(dressed):
    body, top, photos = dressed
    lost = without_straps(top)
    upper = list_openings(lost)[0]
    with pytest.raises(
        GarmentError, match=f"the opening of {1e3 * upper.perimeter:.0f} mm at .* should be at least 3:"
    ) as caught:
        checked(lost, body, photos)
    assert "openings.keep" in caught.value.hint
    assert caught.value.partial["garment"] is lost


def test_photos_show_the_same_on_one_core(dressed, monkeypatch):
    body, top, photos = dressed
    observed = np.ones(len(top.vertices), dtype=bool)
    first = look_at_mannequin(top, observed, body, photos, Job())
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    again = look_at_mannequin(top, observed, body, photos, Job())
    assert first.points.tobytes() == again.points.tobytes()
    assert first.cloth.tobytes() == again.cloth.tobytes()


@pytest.mark.parametrize("colored", [True, False])
def test_colour_frames_of_a_depth_camera_show_the_straps(dressed, colored):
    """The depth of all above the chest was lost: without colours nobody knows of it."""
    body, top, photos = dressed
    paths = tuple(Path(f"{k}.png") for k in range(16))
    shown = (lambda found: found, without_straps)
    for part, refused in zip(shown, (False, colored), strict=True):
        found = part(top)
        scan = concatenate([found, body])
        cloth = np.arange(len(scan.vertices)) < len(found.vertices)
        inputs = {
            "garment_shell": found,
            "mannequin_surface": body,
            "garment_surface": scan,
            "garment_placement": np.eye(4),
            "labels": SurfaceLabels(cloth, np.ones(len(cloth))),
            "garment_depth": DepthFrameSet(paths, photos.paths if colored else (), LENS, 1000.0),
            "garment_trajectory": photos.cameras.world_from_cam,
        }
        stage = {stage.name: stage for stage in STAGES}["openings"]
        settings = OpeningsConfig(look_again=False, edge_mm=12.0, flap_edges=1.0)
        with pytest.raises(GarmentError, match="the photos show .* of cloth") if refused else nullcontext():
            assert len(stage.run(inputs, settings, Job())["openings"]) == len(list_openings(found))


def test_straps_that_lamps_make_white_are_not_bare(dressed, tmp_path):
    """In twelve of sixteen photos all above the chest is clipped, as white as the form is there."""
    body, top, photos = dressed
    paths, lost = [], without_straps(top)
    for k, path in enumerate(photos.paths):
        picture = cv2.imread(str(path))
        if k % 4:
            picture[: picture.shape[0] // 2] = np.clip(picture[: picture.shape[0] // 2] * 8.0, 0, 255)
        paths.append(tmp_path / path.name)
        cv2.imwrite(str(paths[-1]), picture)
    with pytest.raises(GarmentError, match="should be at least 3:"):
        checked(lost, body, PosedPhotos(tuple(paths), photos.cameras))


def test_one_lost_strap_is_enough(dressed):
    body, top, photos = dressed
    middle = top.vertices[top.faces].mean(axis=1)
    lost = submesh(top, ~((middle[:, 1] > STRAPS) & (middle[:, 0] > 0.0)))[0]
    with pytest.raises(GarmentError, match="should be at least 2:"):
        checked(lost, body, photos)


def test_who_gives_the_number_of_openings_is_warned(dressed):
    body, top, photos = dressed
    job = checked(without_straps(top), body, photos, answered=True)
    assert len(job.warnings) == 1
    assert "should be at least 3" in job.warnings[0]


def test_a_whole_garment_passes(dressed):
    body, top, photos = dressed
    assert checked(top, body, photos).warnings == []


@pytest.mark.parametrize(("ends", "warned"), [(0.26, False), (0.29, True)])
def test_a_rim_that_is_short_passes_and_is_warned_of_where_much_is_lost(dressed, ends, warned):
    body, top, photos = dressed
    y = top.vertices[top.faces].mean(axis=1)[:, 1]
    warnings = checked(submesh(top, y > ends)[0], body, photos).warnings
    assert len(warnings) == warned
    lost = surface_area(submesh(top, y <= ends)[0])
    for warning in warnings:
        said = float(re.search(r"photos show (\d+) cm² of cloth that the garment lacks", warning)[1])
        assert 0.5 < 1e-4 * said / lost < 1.2  # of the form under it, but for the border


def test_a_garment_that_never_had_straps_passes(tmp_path):
    """Head and arms leave it through one opening, and the photos show them bare."""
    body, strapless = form(), without_straps(tank_top())
    assert checked(strapless, body, photographs(tmp_path, strapless, body)).warnings == []


def test_cloth_of_the_mannequins_colour_tells_nothing(tmp_path):
    body, top = form(), tank_top()
    job = checked(without_straps(top), body, photographs(tmp_path, top, body, cloth=SKIN[None]))
    assert job.left_out == [
        (
            "cloth beside the openings",
            "in the photos too little of the mannequin shows, or it is of the cloth's colours",
        )
    ]


def ribbon(x: tuple[float, float], y: tuple[float, float]) -> np.ndarray:
    """Points of a plane, 1 cm apart."""
    across, along = np.meshgrid(np.arange(*x, 0.01), np.arange(*y, 0.01), indexing="ij")
    return np.column_stack([across.ravel(), along.ravel(), np.zeros(across.size)])


@pytest.mark.parametrize(("until", "parts"), [(0.05, 2), (0.09, 2), (0.30, 0)])
def test_what_runs_away_from_the_garment_is_a_shadow(until, parts):
    """A band over a plate 20 cm high, with cloth below and above, or below only: then most of the band is far off."""
    plate = ribbon((-0.2, 0.2), (0.0, until))
    cloth = np.abs(plate[:, 0]) < 0.02
    garment = [[0.0, -0.01, 0.0]] if parts == 0 else [[0.0, -0.01, 0.0], [0.0, until + 0.01, 0.0]]
    found = parted_openings(Sightings(plate, cloth, 1e-4), np.array(garment))
    assert [one.parts for one in found] == [2] * (parts > 0)
    if parts:
        assert found[0].area == pytest.approx(cloth.sum() * 1e-4)


@pytest.mark.parametrize(("beyond", "parted"), [(0.02, False), (0.05, True)])
def test_a_sliver_beside_a_rim_is_no_part(beyond, parted):
    """A strap crosses a plate 20 cm high. What is left of it beyond is 40 or 100 cm²: a hand shows more than 60."""
    plate = ribbon((-0.3, 0.02 + beyond), (0.0, 0.2))
    cloth = np.abs(plate[:, 0]) < 0.02
    found = parted_openings(Sightings(plate, cloth, 1e-4), np.array([[0.0, -0.01, 0.0], [0.0, 0.21, 0.0]]))
    assert bool(found) == parted
