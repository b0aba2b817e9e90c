"""A form placed by its outline in photos that Open3D cast ray by ray, with cameras and placement known."""

from __future__ import annotations

from dataclasses import replace

import cv2
import dressed_form
import numpy as np
import open3d as o3d
import pytest
import trimesh
from numpy.testing import assert_allclose

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.align import AlignConfig, PosedPhotos, align_to_mannequin
from vto_pipeline.garment.outline.contour import ContourMesh
from vto_pipeline.garment.outline.edges import load_edges
from vto_pipeline.garment.outline.fit import OutlineProblem
from vto_pipeline.geometry.rigid import transform_mesh
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import concatenate, submesh
from vto_pipeline.model.camera import CameraSet, Intrinsics
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

LENS = Intrinsics(400, 300, 560.0, 560.0, 199.5, 149.5)
PIXEL = 2.3 / 560.0  # on the form, seen from 2.3 m [m]
QUICK = AlignConfig(samples=2500, yaw_starts=8)
MOTION = dressed_form.rigid([2, 140, -3], [0.3, 0.1, -0.5])  # scan's frame to the form's
GRAY = 120


def photographs(folder, form, cloth, count=12, clutter=False, seed=0):
    """Photos round a form in a garment, cast by Open3D, and their cameras in the form's frame."""
    rng = np.random.default_rng(seed)
    rays = o3d.t.geometry.RaycastingScene()
    for mesh in (form, cloth):
        rays.add_triangles(o3d.core.Tensor(mesh.vertices.astype("f4")), o3d.core.Tensor(mesh.faces.astype("u4")))
    u, v = np.meshgrid(np.arange(0, LENS.width, 0.5) - 0.25, np.arange(0, LENS.height, 0.5) - 0.25)  # 2 x 2 a pixel
    local = np.stack([(u - LENS.cx) / LENS.fx, (v - LENS.cy) / LENS.fy, np.ones_like(u)], -1)
    middle, names, poses = np.array([0.0, 0.5, 0.0]), [], []
    folder.mkdir(exist_ok=True)
    for k in range(count):
        turn, rise = 2 * np.pi * k / count, np.deg2rad((5, 25)[k % 2])
        eye = middle + 2.3 * np.array([np.sin(turn) * np.cos(rise), np.sin(rise), np.cos(turn) * np.cos(rise)])
        ahead = (middle - eye) / np.linalg.norm(middle - eye)
        right = np.cross(ahead, [0, 1, 0]) / np.linalg.norm(np.cross(ahead, [0, 1, 0]))
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = np.column_stack([right, np.cross(ahead, right), ahead]), eye
        ways = local @ pose[:3, :3].T
        hit = rays.cast_rays(o3d.core.Tensor(np.concatenate([np.broadcast_to(eye, ways.shape), ways], -1).astype("f4")))
        what, away = hit["geometry_ids"].numpy(), hit["t_hit"].numpy()
        facing = np.abs((hit["primitive_normals"].numpy() * ways).sum(-1)) / np.linalg.norm(ways, axis=-1)
        at = eye + ways * np.where(np.isfinite(away), away, 0)[..., None]
        gray = np.full(what.shape, float(GRAY))
        if clutter:  # a backdrop of its own for each photo: nothing behind the form can be recognised
            wild = cv2.resize(rng.uniform(40, 220, (18, 24)), what.shape[::-1], interpolation=cv2.INTER_NEAREST)
            gray[:] = wild
        gray = np.where(what == 0, 150 + 70 * facing, gray)
        gray = np.where(what == 1, 90 + 60 * np.sign(np.sin(60 * at[..., 0]) * np.sin(60 * at[..., 1])), gray)
        picture = cv2.resize(gray, (LENS.width, LENS.height), interpolation=cv2.INTER_AREA)
        picture = np.clip(picture + rng.normal(0, 2, picture.shape), 0, 255).astype(np.uint8)
        names.append(f"{k:02d}.png")
        cv2.imwrite(str(folder / names[-1]), picture)
        poses.append(pose)
    return CameraSet(tuple(names), (LENS,) * count, np.array(poses))


def in_scan_frame(mesh, cameras, folder, unit=1.0):
    """The cloth and the cameras as a scan would have them, in its own frame and unit."""
    back = np.linalg.inv(MOTION)
    moved = transform_mesh(mesh, back)
    poses = back @ cameras.world_from_cam
    poses[:, :3, 3] /= unit
    metric = unit == 1.0
    surface = replace(moved, vertices=moved.vertices / unit, metric=metric)
    paths = tuple(folder / name for name in cameras.names)
    return surface, PosedPhotos(paths, CameraSet(cameras.names, cameras.intrinsics, poses, metric=metric))


def misplacement(form, found, unit=1.0):
    """Largest distance between where a point of the form should be and where it comes to [m]."""
    on_scan = transform_mesh(form, np.diag([1 / unit] * 3 + [1.0]) @ np.linalg.inv(MOTION))
    return np.linalg.norm(transform_mesh(on_scan, found).vertices - form.vertices, axis=1).max()


@pytest.fixture(scope="module")
def worn(scene):
    """The shirt, a third of it lost in patches, as of a scan that saw nothing of the bare form."""
    middle = scene.shirt.vertices[scene.shirt.faces].mean(axis=1)
    lost = np.sin(17 * middle[:, 0]) * np.sin(19 * middle[:, 1] + 2) * np.sin(23 * middle[:, 2]) > 0.12
    return submesh(scene.shirt, ~lost)[0]


@pytest.fixture(scope="module")
def shots(scene, tmp_path_factory):
    folder = tmp_path_factory.mktemp("plain")
    return folder, photographs(folder, scene.form, scene.shirt)


def test_a_form_of_which_nothing_was_scanned_is_found_by_its_outline(scene, worn, shots):
    surface, photos = in_scan_frame(worn, shots[1], shots[0])
    job = Job()  # without the photos, cloth that lies close passes for bare form, and the shirt slips by 20 mm
    found = align_to_mannequin(surface, scene.form, QUICK, job, photos)
    error = misplacement(scene.form, found)
    assert 1e-6 < error < 0.5 * PIXEL
    assert job.metrics["placed_by"] == "outline"
    assert error < 3e-3 * job.metrics["uncertainty_mm"]
    assert job.metrics["uncertainty_mm"] < 1e3 * PIXEL


@pytest.mark.slow
def test_the_outline_tells_the_scale_where_there_is_none(scene, worn, shots):
    surface, photos = in_scan_frame(worn, shots[1], shots[0], unit=0.137)
    job = Job()
    found = align_to_mannequin(surface, scene.form, QUICK, job, photos)
    assert misplacement(scene.form, found, unit=0.137) < PIXEL
    assert_allclose(np.cbrt(np.linalg.det(found[:3, :3])), 0.137, rtol=3e-3, atol=0)  # asked of a mannequin: 1 %
    assert job.metrics["scale_source"] == "mannequin"
    assert job.metrics["scale_error_percent"] < 0.5


def test_a_cluttered_backdrop_does_no_harm(scene, worn, tmp_path):
    cameras = photographs(tmp_path, scene.form, scene.shirt, clutter=True)
    surface, photos = in_scan_frame(worn, cameras, tmp_path)
    assert misplacement(scene.form, align_to_mannequin(surface, scene.form, QUICK, Job(), photos)) < PIXEL


def test_same_bits_on_one_core(scene, shots, monkeypatch):
    """Photos are read and asked side by side."""
    folder, cameras = shots
    paths, start = [folder / name for name in cameras.names], dressed_form.rigid([1, 3, 0], [0.01, 0.0, 0.02])

    def fit():
        edges = load_edges(paths, cameras, scene.shirt)
        forms, distance = [ContourMesh(scene.form)], SurfaceDistance(scene.form)
        return OutlineProblem(forms, distance, scene.shirt.vertices, edges).step(start, 0.05, range(7))

    first = fit()
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    again = fit()
    assert again.scan_from_form.tobytes() == first.scan_from_form.tobytes()
    assert again.covariance.tobytes() == first.covariance.tobytes()
    assert (again.support, again.rms, again.photos) == (first.support, first.rms, first.photos)
    assert first.photos == 12


@pytest.mark.parametrize("most_lost", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_photos_of_another_form_are_refused(scene, worn, tmp_path, most_lost):
    larger = np.array([1.1, 1.25, 1.5])
    other, shirt, scan = (replace(mesh, vertices=mesh.vertices * larger) for mesh in (scene.form, scene.shirt, worn))
    surface, photos = in_scan_frame(scan, photographs(tmp_path, other, shirt), tmp_path)
    count = len(photos.paths)
    lost = tuple(f"lost{k}.png" for k in range(count + most_lost))
    some = replace(photos, cameras=replace(photos.cameras, unregistered=lost))
    with pytest.raises(GarmentError, match="outline") as caught:
        align_to_mannequin(surface, scene.form, QUICK, Job(), some)
    told = f"{count + 1} of {2 * count + 1} photos could not be placed"
    assert caught.value.hint.startswith(told) is most_lost


def test_without_scale_or_outline_bare_parts_alone_are_not_believed(scene, shots, tmp_path):
    """All of the form is in the scan, but photos show nothing: what is bare could be cloth of another size."""
    for name in shots[1].names:
        cv2.imwrite(str(tmp_path / name), np.full((LENS.height, LENS.width), GRAY, np.uint8))
    both = concatenate([scene.form, scene.shirt])
    surface, photos = in_scan_frame(both, shots[1], tmp_path, unit=0.137)
    with pytest.raises(GarmentError, match="outline is not in the photos") as caught:
        align_to_mannequin(surface, scene.form, QUICK, Job(), photos)
    assert "scale.lengths" in caught.value.hint


def test_what_stereo_guesses_of_bare_limbs_does_not_count_as_inside(scene, worn, shots):
    """Arms and neck lie on both sides of the form, a centimetre and more off, as photos of white limbs have them."""
    out = dressed_form.shirt_region(scene.form.vertices) > 0.01
    limbs, _ = submesh(scene.form, (out & (scene.form.vertices[:, 1] > 0.3))[scene.form.faces].all(axis=1))
    limbs = replace(limbs, vertices=limbs.vertices + np.random.default_rng(0).normal(0.0, 0.01, limbs.vertices.shape))
    both = concatenate([worn, limbs])
    deep = SurfaceDistance(scene.form).signed(sample_surface(both, 4000, 0)[0]).distance < -1.5 * PIXEL
    assert deep.mean() > 1.25 * AlignConfig().most_inside
    surface, photos = in_scan_frame(both, shots[1], shots[0], unit=0.137)
    job = Job()
    found = align_to_mannequin(surface, scene.form, QUICK, job, photos)
    assert misplacement(scene.form, found, unit=0.137) < 2.0 * PIXEL  # the guesses inside still push the form
    assert job.metrics["inside_share"] < 0.3 * deep.mean()


def test_a_form_that_is_round_is_refused(tmp_path):
    profile = np.array([[0.0, 0.0], [0.12, 0.0], [0.1, 0.3], [0.17, 0.5], [0.1, 0.75], [0.06, 0.9], [0.0, 0.95]])
    round_form = trimesh.creation.revolve(profile, sections=96)
    round_form.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0]))
    form = dressed_form.outward(round_form.vertices, round_form.faces)
    wide = trimesh.creation.revolve(np.array([[0.13, 0.3], [0.19, 0.5], [0.13, 0.7]]), sections=96)
    wide.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0]))
    cloth = TriangleMesh(wide.vertices, wide.faces)
    surface, photos = in_scan_frame(cloth, photographs(tmp_path, form, cloth), tmp_path)
    config = AlignConfig(samples=2500, yaw_starts=8, enough_bare=0.5, upright_bare=0.5)
    with pytest.raises(GarmentError, match=r"two places|uncertain"):
        align_to_mannequin(surface, form, config, Job(), photos)


def test_close_cloth_does_not_pass_for_a_form_of_another_size(scene, tmp_path):
    """A vest 4 mm off the trunk, alone in the scan: 2 % larger, a good part of it lies on the form."""
    middle = scene.form.vertices[scene.form.faces].mean(axis=1)
    trunk = submesh(scene.form, (middle[:, 1] > 0.2) & (middle[:, 1] < 0.62) & (np.abs(middle[:, 0]) < 0.19))[0]
    normals = trimesh.Trimesh(trunk.vertices, trunk.faces, process=False).vertex_normals
    vest = TriangleMesh(trunk.vertices + 0.004 * normals, trunk.faces)
    surface, photos = in_scan_frame(vest, photographs(tmp_path, scene.form, vest), tmp_path, unit=0.137)
    found = align_to_mannequin(surface, scene.form, QUICK, Job(), photos)
    assert_allclose(np.cbrt(np.linalg.det(found[:3, :3])), 0.137, rtol=5e-3, atol=0)
