"""The scale that a stated height gives: closed forms, and rendered photos of a figure whose height is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scan_scene import BOARD, Scene, make_scene, orbit, photos
from scipy.spatial.transform import Rotation

from vto_pipeline.errors import ScanError
from vto_pipeline.geometry.topology import concatenate, vertex_normals
from vto_pipeline.model.camera import CameraSet, Intrinsics
from vto_pipeline.model.frames import PhotoSet
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud, TriangleMesh
from vto_pipeline.scan.photos.scale import ScaleConfig, apply_scale
from vto_pipeline.scan.photos.stature import standing_height

UNIT = 3.7
"""Lengths of a scan without scale, in metres' place."""
HEIGHT = 0.5


def revolved(profile: np.ndarray, around: int = 60) -> TriangleMesh:
    """Turn a profile (N, 2) of radius and height about +Y, outside out."""
    angle = np.linspace(0, 2 * np.pi, around, endpoint=False)
    ring = np.stack([np.cos(angle), np.zeros(around), -np.sin(angle)], axis=1)
    vertices = (profile[:, :1, None] * ring[None] + profile[:, 1, None, None] * [0.0, 1.0, 0.0]).reshape(-1, 3)
    n, k = np.meshgrid(np.arange(len(profile) - 1), np.arange(around), indexing="ij")
    a, b = n * around + k, n * around + (k + 1) % around
    faces = np.concatenate([np.stack([a, b, a + around], -1), np.stack([b, b + around, a + around], -1)]).reshape(-1, 3)
    if profile[-1, 0] == 0.0:
        faces = np.minimum(faces, len(vertices) - around)  # the last ring is one point
        faces = faces[faces[:, 1] != faces[:, 2]]
    return TriangleMesh(vertices, faces)


def figure(cut: float = 0.0, height: float = HEIGHT) -> np.ndarray:
    """Profile of a column with a round top, cut off so far below it [share of the height]."""
    radius = 0.16 * height
    turn = np.linspace(0, np.pi / 2, 24)
    column = np.column_stack([np.full(40, radius), np.linspace(0, height - radius, 40)])
    dome = np.column_stack([radius * np.cos(turn), height - radius + radius * np.sin(turn)])[1:]
    dome[-1, 0] = 0.0
    whole = np.concatenate([column, dome])
    return whole[whole[:, 1] <= height * (1.0 - cut) + 1e-12]


def ground(size: float = 0.8) -> TriangleMesh:
    side = np.linspace(-size / 2, size / 2, 30)
    x, z = np.meshgrid(side, side, indexing="ij")
    i, j = np.meshgrid(np.arange(29), np.arange(29), indexing="ij")
    a = i * 30 + j
    faces = np.concatenate([np.stack([a, a + 1, a + 30], -1), np.stack([a + 1, a + 31, a + 30], -1)]).reshape(-1, 3)
    return TriangleMesh(np.stack([x, np.zeros_like(x), z], -1).reshape(-1, 3), faces)


def tilted(mesh: TriangleMesh, degrees: float, noise: float = 0.0) -> TriangleMesh:
    """In another unit, off upright, and rough."""
    turn = Rotation.from_euler("zx", [degrees, 0.6 * degrees], degrees=True).as_matrix()
    rough = np.random.default_rng(3).normal(0, noise, mesh.vertices.shape)
    return replace(mesh, vertices=UNIT * (mesh.vertices + rough) @ turn.T + [0.4, -2.0, 1.1])


@pytest.mark.parametrize(("degrees", "noise"), [(0.0, 0.0), (9.0, 0.0), (9.0, 4e-4)])
def test_the_height_above_a_floor_that_is_not_quite_level(degrees: float, noise: float) -> None:
    beside = revolved(figure(height=0.6))  # a lamp, thin and tall
    beside = replace(beside, vertices=beside.vertices * [0.2, 1.0, 0.2] + np.array([0.3, 0.0, 0.2]))
    height, error = standing_height(tilted(concatenate([ground(), revolved(figure()), beside]), degrees, noise))
    assert height == pytest.approx(UNIT * HEIGHT, abs=UNIT * (1e-5 + 5 * noise))
    assert 0 < error < 0.03 * height


def test_no_floor_tells_nothing_of_the_height() -> None:
    with pytest.raises(ScanError, match="do not show the floor"):
        standing_height(tilted(revolved(figure()), 5.0))


def test_what_hangs_above_and_lies_below_is_no_floor() -> None:
    """A table top beside a form on a pole: most of the form lies below it."""
    table = ground(0.4)
    table = replace(table, vertices=table.vertices + np.array([0.4, 0.3, 0.0]))
    with pytest.raises(ScanError, match="do not show the floor"):
        standing_height(concatenate([table, revolved(figure())]))


def test_what_was_seen_of_it_has_to_reach_the_floor() -> None:
    """A shirt on a form without texture hangs in the air."""
    profile = figure()
    with pytest.raises(ScanError, match="does not reach the floor"):
        standing_height(concatenate([ground(), revolved(profile[profile[:, 1] > 0.3 * HEIGHT])]))


@pytest.mark.parametrize("cut", [0.004, 0.015])
def test_a_hole_in_the_crown_is_rounded_off(cut: float) -> None:
    height, error = standing_height(tilted(concatenate([ground(), revolved(figure(cut))]), 5.0))
    assert height == pytest.approx(UNIT * HEIGHT, rel=0.002)
    assert error > abs(height / (UNIT * HEIGHT) - 1.0)


@pytest.mark.parametrize("cut", [0.04, 0.1, 0.4])
def test_a_top_that_was_not_seen_whole_is_refused(cut: float) -> None:
    with pytest.raises(ScanError, match="top of what stands there"):
        standing_height(tilted(concatenate([ground(), revolved(figure(cut))]), 5.0))


@pytest.fixture(scope="module")
def standing(tmp_path_factory: pytest.TempPathFactory) -> tuple[PhotoSet, CameraSet, PointCloud]:
    """Photos of a printed figure on a printed floor, without a board's name, and their cameras in another unit."""
    column, print_ = revolved(figure(height=HEIGHT), 240), make_scene()
    angle = np.arctan2(-column.vertices[:, 2], column.vertices[:, 0]) / (2 * np.pi) % 1.0
    uv = np.column_stack([np.abs(2 * angle - 1), column.vertices[:, 1] / HEIGHT])  # without a seam
    scene = Scene(column.vertices, column.faces, uv, print_.texture, print_.floor)
    camera = Intrinsics(600, 450, 560.0, 560.0, 299.5, 224.5, 0.0)
    poses = orbit(24, elevations_deg=(18.0, 38.0))
    taken = photos(scene, tmp_path_factory.mktemp("standing"), poses, camera, board=False)
    turn = Rotation.from_euler("zx", [4.0, -3.0], degrees=True).as_matrix()
    moved = np.tile(np.eye(4), (len(poses), 1, 1))
    moved[:, :3, :3] = turn @ poses[:, :3, :3]
    moved[:, :3, 3] = UNIT * poses[:, :3, 3] @ turn.T
    random = np.random.default_rng(4)
    floor = np.column_stack([random.uniform(-0.15, 0.15, 300), np.zeros(300), random.uniform(-0.12, 0.12, 300)])
    some = random.permutation(len(column.vertices))[:1500]
    seen = np.concatenate([column.vertices[some], floor])
    normals = np.concatenate([vertex_normals(column)[some], np.tile([0.0, 1.0, 0.0], (300, 1))]) @ turn.T
    names = tuple(path.name for path in taken.paths)
    return (
        taken,
        CameraSet(names, taken.intrinsics, moved, metric=False),
        PointCloud(UNIT * seen @ turn.T, normals, None),
    )


@pytest.mark.slow
def test_photos_become_metric_by_a_stature(standing) -> None:
    job = Job()
    cameras, cloud = apply_scale(*standing, ScaleConfig(stature=HEIGHT), job)
    assert cameras.metric
    scale = np.linalg.norm(np.ptp(cloud.points, axis=0)) / np.linalg.norm(np.ptp(standing[2].points, axis=0))
    off = abs(scale * UNIT - 1.0)
    assert off < 0.005
    assert job.metrics["scale_source"] == "stature"
    assert off < 2 * job.metrics["scale_error_percent"] / 100
    assert any("fixes the scale to" in text for text in job.warnings)


def test_a_board_that_is_seen_wins_over_a_stature(standing) -> None:
    taken, cameras, cloud = standing
    job = Job()
    placed, _ = apply_scale(replace(taken, board=BOARD), cameras, cloud, ScaleConfig(stature=1.9), job)
    assert job.metrics["scale_source"] == "board"
    size = np.linalg.norm(np.ptp(placed.world_from_cam[:, :3, 3], axis=0))
    assert size == pytest.approx(np.linalg.norm(np.ptp(cameras.world_from_cam[:, :3, 3], axis=0)) / UNIT, rel=0.01)
