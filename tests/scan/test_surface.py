from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.errors import InputError
from vto_pipeline.geometry.topology import boundary_loops, face_normals
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud
from vto_pipeline.scan import normals
from vto_pipeline.scan.normals import oriented_normals
from vto_pipeline.scan.surface import SurfaceConfig, reconstruct_cloud


def bowl(count: int, noise: float, seed: int = 0) -> np.ndarray:
    """A sphere of radius 0.2 m without its cap above y = 0.12 m, centre at height 0."""
    random = np.random.default_rng(seed)
    points = random.normal(size=(4 * count, 3))
    points *= 0.2 / np.linalg.norm(points, axis=1, keepdims=True)
    points = points[points[:, 1] < 0.12][:count]
    return points * (1 + random.normal(0, noise / 0.2, (len(points), 1)))


@pytest.fixture(scope="module")
def mesh():
    job = Job()
    return reconstruct_cloud(PointCloud(bowl(20_000, 2e-4)), SurfaceConfig(), job), job


def test_surface_lies_on_the_sphere(mesh):
    error = np.abs(np.linalg.norm(mesh[0].vertices, axis=1) - 0.2)
    assert 1e-6 < np.percentile(error, 95) < 5e-4
    assert mesh[1].metrics["points_off_surface_share"] < 0.01


def test_the_opening_stays_open_and_is_the_only_one(mesh):
    loops = boundary_loops(mesh[0])
    assert len(loops) == 1
    rim = mesh[0].vertices[loops[0]]
    assert_allclose(rim[:, 1], 0.12, rtol=0, atol=0.02)  # a chance gap of the points at the rim
    assert_allclose(rim[:, 1].mean(), 0.12, rtol=0, atol=0.004)  # the points are 4.5 mm apart
    ring = np.linalg.norm(np.roll(rim, 1, axis=0) - rim, axis=1).sum()
    assert 0.95 < ring / (2 * np.pi * 0.16) < 1.6  # a cut along triangles is longer than the circle


def test_normals_point_out(mesh):
    centers = mesh[0].vertices[mesh[0].faces].mean(1)
    assert ((face_normals(mesh[0]) * centers).sum(1) > 0).mean() > 0.99


def test_order_and_repetition_of_points_do_not_matter(mesh):
    points = bowl(20_000, 2e-4)
    shuffled = np.random.default_rng(7).permutation(np.concatenate([points, points[:50]]))
    again = reconstruct_cloud(PointCloud(shuffled), SurfaceConfig(), Job())
    assert again.vertices.tobytes() == mesh[0].vertices.tobytes()
    assert again.faces.tobytes() == mesh[0].faces.tobytes()


def test_given_normals_are_used():
    points = bowl(6_000, 0.0)
    normals = -points / np.linalg.norm(points, axis=1, keepdims=True)  # on purpose inwards
    mesh = reconstruct_cloud(PointCloud(points, normals), SurfaceConfig(), Job())
    centers = mesh.vertices[mesh.faces].mean(1)
    assert ((face_normals(mesh) * centers).sum(1) < 0).mean() > 0.99


WRONG = {
    "anything": lambda true, random: random.normal(size=true.shape),
    "of any sign": lambda true, random: true * np.where(random.random(len(true)) < 0.5, -1.0, 1.0)[:, None],
    "other axes": lambda true, random: true[:, [0, 2, 1]],
    "all alike": lambda true, random: np.tile([0.0, 0.0, 1.0], (len(true), 1)),
}
"""What programs write in place of the normals of a ball."""


@pytest.mark.parametrize("kind", WRONG)
def test_normals_that_are_not_of_the_surface_are_not_used(kind: str) -> None:
    points = bowl(6_000, 2e-4)
    true = points / np.linalg.norm(points, axis=1, keepdims=True)
    given = WRONG[kind](true, np.random.default_rng(6))
    job = Job()
    found = oriented_normals(PointCloud(points, given / np.linalg.norm(given, axis=1, keepdims=True)), 20, job)
    assert np.percentile((found * true).sum(axis=1), 1) > 0.9
    assert any("normals are not used" in note for note in job.notes)


@pytest.mark.parametrize("noise", [0.0, 2e-3])
def test_normals_of_the_surface_are_kept_to_the_bit(noise: float) -> None:
    points = bowl(6_000, noise)  # 6 mm apart
    true = points / np.linalg.norm(points, axis=1, keepdims=True)
    job = Job()
    assert oriented_normals(PointCloud(points, true), 20, job).tobytes() == true.tobytes()
    assert not job.notes + job.warnings


def test_inward_normals_and_coarse_points_are_warned_of() -> None:
    points = bowl(200, 0.0)
    job = Job()
    reconstruct_cloud(PointCloud(points, -points / np.linalg.norm(points, axis=1, keepdims=True)), SurfaceConfig(), job)
    inwards, coarse = sorted(job.warnings, key=len, reverse=False)
    apart = np.sqrt(0.8 * 4 * np.pi * 0.2**2 / 200)  # the sphere's area for each point [m]
    assert float(coarse.split(" mm apart")[0].split()[-1]) == pytest.approx(1000 * apart, rel=0.2)
    assert "point inwards" in inwards


def test_outliers_are_left_out(mesh):
    random = np.random.default_rng(3)
    points = np.concatenate([bowl(20_000, 2e-4), random.uniform(-0.5, 0.5, (60, 3))])
    job = Job()
    found = reconstruct_cloud(PointCloud(points), SurfaceConfig(), job)
    assert np.percentile(np.abs(np.linalg.norm(found.vertices, axis=1) - 0.2), 99) < 2e-3
    assert any("isolated" in text for text in job.notes)


def test_three_points_are_refused():
    with pytest.raises(InputError, match="3 distinct points; at least 100"):
        reconstruct_cloud(PointCloud(np.eye(3)), SurfaceConfig(), Job())


def test_one_point_many_times_is_refused():
    with pytest.raises(InputError, match="1 distinct points"):
        reconstruct_cloud(PointCloud(np.ones((500, 3))), SurfaceConfig(), Job())


def test_line_is_refused():
    with pytest.raises(InputError, match="one line"):
        reconstruct_cloud(PointCloud(np.outer(np.linspace(0, 1, 500), [1.0, 2.0, 3.0])), SurfaceConfig(), Job())


def test_plane_is_refused():
    random = np.random.default_rng(5)
    flat = np.column_stack([random.uniform(0, 0.3, (5000, 2)), np.zeros(5000)])
    with pytest.raises(InputError, match="one plane"):
        reconstruct_cloud(PointCloud(flat), SurfaceConfig(), Job())


def two_balls(gap):
    """Points on two balls side by side, this far apart [m], normals that point out, and which lie away from the gap."""
    random = np.random.default_rng(5)
    true = random.normal(size=(6000, 3))
    true /= np.linalg.norm(true, axis=1, keepdims=True)
    side = np.where(np.arange(6000) < 3000, -1.0, 1.0)[:, None] * [0.1 + gap / 2, 0.0, 0.0]
    told = np.abs(side[:, 0] + 0.1 * true[:, 0]) > 0.01  # two spacings from the gap, which is less than one wide
    return 0.1 * true + side, true, told


@pytest.mark.parametrize("gap", [1e-3, 4e-3])
def test_normals_do_not_turn_over_where_two_surfaces_nearly_touch(gap: float) -> None:
    """Neighbours across the gap have opposite normals, and both point out."""
    points, true, told = two_balls(gap)
    found = oriented_normals(PointCloud(points), 20, Job())
    assert ((found * true).sum(axis=1) > 0)[told].all()


def test_points_that_have_no_vote_follow_those_near_them(monkeypatch) -> None:
    monkeypatch.setattr(normals, "_VOTERS", 3000)
    points, true, told = two_balls(0.02)  # wide enough for half of the points to show it
    found = oriented_normals(PointCloud(points), 20, Job())
    assert ((found * true).sum(axis=1) > 0)[told].all()


def test_points_may_be_there_twice() -> None:
    points, true, told = two_balls(4e-3)
    again = np.concatenate([np.arange(6000), np.arange(1000)])
    found = oriented_normals(PointCloud(points[again]), 20, Job())
    assert ((found * true[again]).sum(axis=1) > 0)[told[again]].all()
