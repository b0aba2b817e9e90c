"""Alignment against a known motion."""

from __future__ import annotations

import dressed_form
import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.align import AlignConfig, align_to_mannequin
from vto_pipeline.garment.outline.inside import inside_share
from vto_pipeline.geometry.rigid import transform_mesh
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

QUICK = AlignConfig(samples=4000)


def misplacement(scene, found, motion):
    """Largest distance between where a point of the form should be and where it comes to [m]."""
    on_scan = transform_mesh(scene.form, np.linalg.inv(motion))
    return np.linalg.norm(transform_mesh(on_scan, found).vertices - scene.form.vertices, axis=1).max()


def test_a_turned_and_shifted_scan_comes_back(scene):
    job = Job()
    found = align_to_mannequin(scene.scan, scene.form, QUICK, job)
    error = misplacement(scene, found, scene.mannequin_from_surface)
    assert 1e-6 < error < 3e-4  # noise of 0.3 mm; exact would mean the answer leaked
    assert 2e-4 < job.metrics["inlier_rms_mm"] * 1e-3 < 4e-4  # the noise that was put in
    assert 0.1 < job.metrics["inlier_share"] < 0.5
    assert job.metrics["uncertainty_mm"] * 1e-3 < 1e-4
    assert job.left_out


@pytest.mark.parametrize(
    "turn",
    [pytest.param([20, 0, 0], id="leaning far", marks=pytest.mark.slow), pytest.param([0, 200, 15], id="turned")],
)
def test_a_scan_that_leans_comes_back_too(scene, turn):
    tilt = dressed_form.rigid(turn, [0.1, -0.3, 0.2])
    upright = transform_mesh(scene.scan, scene.mannequin_from_surface)
    found = align_to_mannequin(transform_mesh(upright, np.linalg.inv(tilt)), scene.form, QUICK, Job())
    assert misplacement(scene, found, tilt) < 5e-4


@pytest.mark.slow
def test_a_scan_lying_on_its_side_comes_back(scene):
    tilt = dressed_form.rigid([90, 0, 0], [0.1, -0.3, 0.2])
    upright = transform_mesh(scene.scan, scene.mannequin_from_surface)
    found = align_to_mannequin(transform_mesh(upright, np.linalg.inv(tilt)), scene.form, QUICK, Job())
    assert misplacement(scene, found, tilt) < 5e-4


def test_the_same_scan_gives_the_same_bits(scene):
    few = AlignConfig(samples=1000, candidates=2)
    one, two = (align_to_mannequin(scene.scan, scene.form, few, Job()) for _ in range(2))
    assert_array_equal(one, two)


@pytest.mark.slow
def test_something_else_than_the_mannequin_is_refused(scene):
    crate = trimesh.creation.box(extents=[0.5, 0.9, 0.5]).subdivide_to_size(0.03)
    with pytest.raises(GarmentError) as caught:
        align_to_mannequin(TriangleMesh(crate.vertices, crate.faces), scene.form, AlignConfig(samples=1000), Job())
    assert "right mannequin" in caught.value.hint


@pytest.mark.parametrize("size", [0.97, 1.015, 1.03])
def test_a_scan_of_another_size_than_its_mannequin_is_refused(scene, size):
    mannequin, job = TriangleMesh(size * scene.form.vertices, scene.form.faces), Job()
    with pytest.raises(GarmentError, match=f"only if it is made .* {'larger' if size > 1 else 'smaller'}") as caught:
        align_to_mannequin(scene.scan, mannequin, QUICK, job)
    assert "printed in its full size" in caught.value.hint
    assert_allclose(job.metrics["size_on_mannequin"], size, rtol=2e-3)


@pytest.mark.parametrize("off", [-1.5e-3, 1.5e-3])
def test_a_scan_a_little_too_thick_or_thin_is_not(scene, off):
    swollen = TriangleMesh(scene.scan.vertices + off * vertex_normals(scene.scan), scene.scan.faces)
    job = Job()
    align_to_mannequin(swollen, scene.form, QUICK, job)
    assert abs(job.metrics["size_on_mannequin"] - 1.0) < 0.01


def test_a_mannequin_that_looks_alike_all_round_is_refused():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.2)
    rough = ball.vertices + np.random.default_rng(0).normal(0.0, 3e-4, ball.vertices.shape)
    with pytest.raises(GarmentError, match="uncertain") as caught:
        align_to_mannequin(
            TriangleMesh(rough, ball.faces),
            TriangleMesh(ball.vertices, ball.faces),
            AlignConfig(samples=1000, worst_sigma_mm=0.2),  # the dressed form's is 0.03, this ball's facets leave 0.5
            Job(),
        )
    assert "several sides" in caught.value.hint


@pytest.mark.parametrize("noisy", [False, True])
def test_a_wrong_mannequin_is_in_the_garment_whatever_stereo_says_of_the_limbs(scene, noisy):
    """Turned by 6 degrees or 6 % too large, as against noise of a centimetre on all that is bare."""
    placed = transform_mesh(scene.scan, scene.mannequin_from_surface)
    if noisy:
        shift = np.random.default_rng(0).normal(0.0, 0.012, placed.vertices.shape)
        limbs = ~scene.is_shirt & (placed.vertices[:, 1] > 0.3)
        placed = TriangleMesh(placed.vertices + np.where(limbs[:, None], shift, 0.0), placed.faces)
    middle = np.array([0.0, 0.45, 0.0])

    def share(motion):
        about = np.eye(4)
        about[:3, 3] = middle
        moved = transform_mesh(placed, about @ motion @ np.linalg.inv(about))
        return inside_share(moved, scene.form, 0.004, seed=0)

    right = share(np.eye(4))
    deep = SurfaceDistance(scene.form).signed(sample_surface(placed, 8000, 0)[0]).distance < -0.004
    most = AlignConfig().most_inside
    assert right < 0.5 * most
    assert deep.mean() > 3.0 * most if noisy else deep.mean() < most
    for wrong in (
        dressed_form.rigid([6, 0, 0], [0, 0, 0]),
        dressed_form.rigid([0, 0, 6], [0, 0, 0]),
        np.diag([1 / 1.06] * 3 + [1.0]),
    ):
        assert share(wrong) > 1.2 * most  # rough limbs have more area, of which cloth is a smaller share


UNSCALED = 0.137  # units of the scan per metre: as arbitrary as structure from motion has it


@pytest.fixture(scope="module")
def unscaled(scene):
    """The dressed form in units that nobody knows, upright and turned, among walls and things of a room."""
    upright = transform_mesh(scene.scan, scene.mannequin_from_surface)
    turned = transform_mesh(upright, np.linalg.inv(dressed_form.rigid([2, 140, -3], [0.3, 0.1, -0.5])))
    return TriangleMesh(turned.vertices / UNSCALED, turned.faces, turned.colors, metric=False)


def with_room(surface):
    """The scan with patches of walls round it, as photos of a room leave them."""
    walls = [trimesh.creation.box(extents=[0.6, 0.5, 0.02]).subdivide_to_size(0.05) for _ in range(5)]
    for number, wall in enumerate(walls):
        wall.apply_translation([0.0, 0.4 + 0.2 * number, 1.1 + 0.1 * number])
        wall.apply_transform(trimesh.transformations.rotation_matrix(1.1 * number, [0, 1, 0]))
    every = trimesh.util.concatenate(walls)
    vertices = np.concatenate([surface.vertices, every.vertices / UNSCALED])
    faces = np.concatenate([surface.faces, every.faces + len(surface.vertices)])
    return TriangleMesh(vertices, faces, metric=False)


@pytest.mark.parametrize("room", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_scan_without_scale_gets_it_from_the_mannequin(scene, unscaled, room):
    job = Job()
    surface = with_room(unscaled) if room else unscaled
    found = align_to_mannequin(surface, scene.form, QUICK, job)
    back = np.linalg.inv(dressed_form.rigid([2, 140, -3], [0.3, 0.1, -0.5]))
    on_scan = transform_mesh(scene.form, np.diag([1 / UNSCALED] * 3 + [1.0]) @ back)
    off = np.linalg.norm(transform_mesh(on_scan, found).vertices - scene.form.vertices, axis=1)
    assert 1e-6 < off.max() < 1e-3  # noise of 0.3 mm; exact would mean the answer leaked
    scale = np.cbrt(np.linalg.det(found[:3, :3]))
    assert_allclose(scale, UNSCALED, rtol=2e-3, atol=0)  # asked of a mannequin: 1 %
    assert abs(scale / UNSCALED - 1) < 4e-2 * job.metrics["scale_error_percent"] + 1e-6  # within four of its sigmas
    assert job.metrics["scale_source"] == "mannequin"


@pytest.mark.slow
def test_something_else_is_refused_at_any_size(scene):
    crate = trimesh.creation.box(extents=[0.5, 0.9, 0.5]).subdivide_to_size(0.03)
    with pytest.raises(GarmentError):
        align_to_mannequin(TriangleMesh(crate.vertices, crate.faces, metric=False), scene.form, QUICK, Job())


@pytest.mark.slow
def test_a_scan_that_shows_only_a_plane_is_refused():
    """Its size does not matter: it lies on the mannequin in all."""
    plane = trimesh.creation.box(extents=[1.0, 0.2, 1.0]).subdivide_to_size(0.05)
    middle = np.abs(plane.triangles_center[:, [0, 2]]).max(axis=1) < 0.3
    part = plane.submesh([np.flatnonzero(middle & (plane.triangles_center[:, 1] > 0.09))], append=True)
    rough = part.vertices + np.random.default_rng(0).normal(0.0, 3e-4, part.vertices.shape)
    with pytest.raises(GarmentError):
        align_to_mannequin(
            TriangleMesh(rough, part.faces, metric=False), TriangleMesh(plane.vertices, plane.faces), QUICK, Job()
        )
