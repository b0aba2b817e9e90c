"""The second look, against ray-cast truth, correlation by OpenCV, and all labellings tried one by one."""

from __future__ import annotations

import sys
from dataclasses import replace
from itertools import product

import cv2
import numpy as np
import open3d as o3d
import pytest
from numpy.testing import assert_allclose
from scan_scene import make_scene, photos, render

from vto_pipeline.errors import ScanError
from vto_pipeline.model.camera import CameraSet
from vto_pipeline.model.frames import DepthMaps
from vto_pipeline.model.job import Job
from vto_pipeline.numerics.cpu_threads import limited_threads
from vto_pipeline.scan.photos.rematch.guess import guess_surface
from vto_pipeline.scan.photos.rematch.look import RematchConfig
from vto_pipeline.scan.photos.rematch.patches import best_mean, correlations
from vto_pipeline.scan.photos.rematch.rematch import rematch
from vto_pipeline.scan.photos.rematch.smooth_choice import CHUNK, MOST_COST, STEP_COST, peak, smooth_choice

PIXEL = 0.0019
"""On the tube [m]."""


def truth_maps(scene, cameras):
    """Depth of every pixel of the tube, by ray casting."""
    posed = zip(cameras.intrinsics, cameras.world_from_cam, strict=True)
    depth = np.stack([render(scene, lens, pose, samples=1)[1] for lens, pose in posed])
    maps = DepthMaps(cameras.names, cameras.intrinsics, cameras.world_from_cam, depth.astype(np.float32))
    return without(maps, lambda points: points[:, 1] < 0.118)


def away(mesh, points):
    """Distance of each point from a mesh, by Open3D."""
    rays = o3d.t.geometry.RaycastingScene()
    rays.add_triangles(o3d.core.Tensor(np.float32(mesh.vertices)), o3d.core.Tensor(np.uint32(mesh.faces)))
    return rays.compute_distance(o3d.core.Tensor(np.float32(points))).numpy()


def world_points(maps, index):
    lens, pose, depth = maps.intrinsics[index], maps.world_from_cam[index], maps.depth[index]
    v, u = np.nonzero(depth)
    z = depth[v, u].astype(float)
    local = np.stack([(u - lens.cx) / lens.fx * z, (v - lens.cy) / lens.fy * z, z], axis=1)
    return v, u, local @ pose[:3, :3].T + pose[:3, 3]


def without(maps, gone):
    """The maps with nothing known of the points for which `gone` is true."""
    depth = maps.depth.copy()
    for index in range(len(depth)):
        v, u, points = world_points(maps, index)
        lost = gone(points)
        depth[index, v[lost], u[lost]] = 0
    return replace(maps, depth=depth)


def gap(points):
    """120 mm high, a quarter of the way round."""
    turn = np.degrees(np.arctan2(points[:, 0], points[:, 2]))
    return (points[:, 1] > 0.21) & (points[:, 1] < 0.33) & (np.abs(turn) < 45)


@pytest.fixture(scope="module")
def full(scene, true_cameras):
    return truth_maps(scene, true_cameras)


@pytest.fixture(scope="module")
def torn(full):
    return without(full, gap)


@pytest.fixture(scope="module")
def grays(shot):
    return [cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in shot[0].paths]


def test_a_gap_is_measured_not_guessed(full, torn, grays, scene):
    job = Job()
    found = rematch(grays, torn, RematchConfig(), job)
    lost = (full.depth > 0) & (torn.depth == 0)
    assert lost.sum() > 9000
    back = lost & (found.depth > 0)
    assert back.sum() > 0.6 * lost.sum()
    error = np.abs(found.depth - full.depth)[back]
    assert 1e-6 < np.median(error) < 0.5 * PIXEL
    assert np.percentile(error, 95) < 2 * PIXEL
    assert (found.depth[torn.depth > 0] == torn.depth[torn.depth > 0]).all()  # what was confirmed stays
    assert job.metrics["rematched_share"] == pytest.approx(back.sum() / (found.depth > 0).sum(), abs=0.05)
    guess, _ = guess_surface(torn, PIXEL)
    index = int(lost.sum(axis=(1, 2)).argmax())
    _, _, places = world_points(replace(full, depth=np.where(lost, full.depth, 0)), index)
    _, _, again = world_points(replace(found, depth=np.where(back, found.depth, 0)), index)
    assert np.median(away(scene, again)) < 0.5 * np.median(away(guess, places))


def test_plain_cloth_is_left_open(full, torn, true_cameras, tmp_path):
    plain = make_scene(contrast=0.0)
    shots = photos(plain, tmp_path, true_cameras.world_from_cam, true_cameras.intrinsics[0], board=False)
    blank = [cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in shots.paths]
    lost = (full.depth > 0) & (torn.depth == 0)
    assert (rematch(blank, torn, RematchConfig(), Job()).depth[lost] > 0).mean() < 0.05


@pytest.mark.parametrize(
    ("added", "rounds", "looks"),
    [
        ((1000, 500, 1, 500), 6, 3),  # a look that adds a share of 1 in 10,000 is the last
        ((1000, 500, 300, 500), 2, 2),
        ((0, 500), 6, 1),
        ((900,) * 8, 6, 6),
    ],
)
def test_it_is_looked_again_until_a_look_adds_little(full, grays, monkeypatch, added, rounds, looks):
    depth = np.zeros_like(full.depth)
    depth[0, :100, :100] = 0.9
    start, shown = replace(full, depth=depth), []

    def look(photos, maps, pixel, config):
        more = maps.depth.copy()
        unknown = np.flatnonzero(more == 0)[: added[len(shown)]]
        more.flat[unknown] = 0.9
        shown.append(len(unknown))
        return replace(maps, depth=more)

    monkeypatch.setattr(sys.modules[rematch.__module__], "_round", look)
    job = Job()
    found = rematch(grays, start, RematchConfig(rounds=rounds), job)
    assert shown == list(added[:looks])
    assert (found.depth > 0).sum() == 10_000 + sum(shown)
    assert job.metrics["rematched_share"] == round(sum(shown) / (10_000 + sum(shown)), 3)


def test_same_bits_again_and_on_one_core(torn, grays, monkeypatch):
    first = rematch(grays, torn, RematchConfig(rounds=1), Job())
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    assert rematch(grays, torn, RematchConfig(rounds=1), Job()).depth.tobytes() == first.depth.tobytes()


def test_too_little_depth_is_no_surface(full):
    depth = np.zeros_like(full.depth)
    depth[0, 100:104, 100:104] = 0.9
    with pytest.raises(ScanError, match="no surface"):
        guess_surface(replace(full, depth=depth), PIXEL)


def test_patches_correlate_best_where_the_surface_is(full, grays, true_cameras: CameraSet):
    """On the true surface; the correlation there is that of patches cut out by OpenCV."""
    _, _, points = world_points(full, 0)
    facing = points * [1, 0, 1]
    normals = facing / np.linalg.norm(facing, axis=1, keepdims=True)
    to_eye = true_cameras.world_from_cam[0, :3, 3] - points
    good = np.flatnonzero((normals * to_eye).sum(1) / np.linalg.norm(to_eye, axis=1) > 0.8)[::500]
    points, normals = points[good], normals[good]
    views = np.tile([0, 1, 15], (len(points), 1))
    sizes = np.array([gray.shape for gray in grays])
    matrices = np.stack([lens.matrix for lens in true_cameras.intrinsics])
    inverse = np.linalg.inv(true_cameras.world_from_cam)
    offsets = PIXEL * np.arange(-4.0, 4.5, 0.5)
    args = (np.stack(grays), sizes, matrices, inverse, offsets, 5, PIXEL, 2)
    found, column = correlations(points, normals, views, *args)
    assert (column == 0).mean() > 0.5  # between the two others
    mean = np.nanmean(found, axis=2)
    assert np.median(np.abs(offsets[np.nanargmax(np.nan_to_num(mean, nan=-1), axis=1)])) <= 0.5 * PIXEL
    for p in range(0, len(points), 7):
        n, middle = normals[p], points[p] + offsets[3] * normals[p]
        first = np.zeros(3)
        first[np.abs(n).argmin()] = 1
        across = np.cross(n, first) / np.linalg.norm(np.cross(n, first))
        i, j = np.meshgrid(np.arange(-5, 6), np.arange(-5, 6), indexing="ij")
        grid = middle + PIXEL * (i[..., None] * across + j[..., None] * np.cross(n, across))
        cut = []
        for k in views[p]:
            local = grid @ inverse[k, :3, :3].T + inverse[k, :3, 3]
            at = local @ matrices[k].T
            x, y = (at[..., :2] / at[..., 2:]).astype(np.float32).transpose(2, 0, 1)
            cut.append(cv2.remap(grays[k].astype(np.float32), x, y, cv2.INTER_LINEAR).ravel())
        for m in range(3):
            if m != column[p] and np.isfinite(found[p, 3, m]):
                assert_allclose(found[p, 3, m], np.corrcoef(cut[column[p]], cut[m])[0, 1], atol=5e-3)


def test_a_chain_gets_the_cheapest_labels():
    """On a chain the messages are exact: all 4^6 labellings, one by one."""
    pairs = np.array([(k, k + 1) for k in range(5)])
    both = np.concatenate([pairs, pairs[:, ::-1]])
    both = both[np.lexsort(both.T[::-1])]
    start = np.searchsorted(both[:, 0], np.arange(7))
    key = both[:, 0] * 6 + both[:, 1]
    back = np.searchsorted(key, both[:, 1] * 6 + both[:, 0])
    every = np.array(list(product(range(4), repeat=6)))
    jumps = np.minimum(STEP_COST * np.abs(np.diff(every, axis=1)), MOST_COST).sum(axis=1)
    for seed in range(20):
        costs = np.random.default_rng(seed).uniform(0, 0.2, (6, 4)).astype(np.float32)
        energy = costs[np.arange(6), every].sum(axis=1) + jumps
        found = np.rint(smooth_choice(costs, start, both[:, 1].copy(), back)).astype(int)
        assert energy[(every == found).all(axis=1)] <= energy.min() + 1e-6


def test_a_long_chain_gets_the_cheapest_labels_on_any_number_of_threads():
    """Viterbi's algorithm, along a chain that several threads share."""
    count, labels = 3 * CHUNK, 9
    costs = np.random.default_rng(5).uniform(0, 1, (count, labels)).astype(np.float32)
    jump = np.minimum(STEP_COST * np.abs(np.subtract.outer(np.arange(labels), np.arange(labels))), MOST_COST)
    least, came = costs[0].astype(float), np.zeros((count, labels), int)
    for node in range(1, count):
        came[node] = (least[:, None] + jump).argmin(axis=0)
        least = (least[:, None] + jump).min(axis=0) + costs[node]
    cheapest = np.full(count, least.argmin())
    for node in range(count - 1, 0, -1):
        cheapest[node - 1] = came[node, cheapest[node]]
    pairs = np.stack([np.arange(count - 1), np.arange(1, count)], axis=1)
    both = np.concatenate([pairs, pairs[:, ::-1]])
    both = both[np.lexsort(both.T[::-1])]
    start = np.searchsorted(both[:, 0], np.arange(count + 1))
    key = both[:, 0] * count + both[:, 1]
    back = np.searchsorted(key, both[:, 1] * count + both[:, 0])
    found = smooth_choice(costs, start, both[:, 1].copy(), back)
    assert np.abs(found - cheapest).max() <= 0.5  # of its parabola
    with limited_threads(1):
        assert smooth_choice(costs, start, both[:, 1].copy(), back).tobytes() == found.tobytes()


def test_the_best_of_some_values_are_those_of_a_sort():
    rng = np.random.default_rng(6)
    for held in (1, 2, 3):
        values = rng.choice([-0.5, 0.25, 0.5, np.nan], 12)
        assert_allclose(best_mean(values, held), np.sort(values[~np.isnan(values)])[-held:].mean(), rtol=1e-12)


def test_a_parabola_has_its_peak_where_it_has():
    values = -((np.arange(7) - 3.3) ** 2)
    assert_allclose(peak(values, 3), 3.3, rtol=0, atol=1e-12)
    assert peak(values, 0) == 0.0
    assert best_mean(np.array([0.2, np.nan, 0.8, 0.6]), 2) == pytest.approx(0.7)
    assert best_mean(np.array([np.nan, 0.5]), 2) == -np.inf
