"""What is kept of depth readings beside a jump, beside a truth for each pixel: which surface it shows, or both."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.scan.depth.depth_mask import clean_depth

CAMERA = Intrinsics(320, 240, 525.0, 525.0, 159.5, 119.5)
BASE = 0.075
FINE = 8


def strap_before_wall(width: float, behind: float, turn_deg: float, seed: int):
    """Readings (H, W) of a strap [m] at 1.1 m, so far before a wall, by a pair of cameras 75 mm apart: noise, steps of
    1/8 px, and pixels that see 1.4 px. Also how far strap and wall are there [m], and which share of each the strap
    fills."""
    noise = np.random.default_rng(seed)
    columns = np.broadcast_to(np.arange(CAMERA.width), (CAMERA.height, CAMERA.width))
    tangent = np.tan(np.deg2rad(turn_deg))
    fine = (np.arange(CAMERA.width * FINE) + 0.5) / FINE - 0.5
    ray = (fine - CAMERA.cx) / CAMERA.fx
    near = 1.1 / (1.0 + ray * tangent)
    hit = np.abs(ray * near) < 0.5 * width * np.cos(np.deg2rad(turn_deg))
    footprint = np.exp(-0.5 * np.square((np.arange(-12, 13) / FINE) / 0.6))
    share = np.convolve(hit, footprint / footprint.sum(), "same").reshape(-1, FINE).mean(axis=1)
    strap = np.broadcast_to(1.1 / (1.0 + (columns - CAMERA.cx) / CAMERA.fx * tangent), columns.shape)
    wall = np.full(columns.shape, 1.1 + behind)
    share = np.broadcast_to(share, columns.shape)
    disparity = CAMERA.fx * BASE / (share * strap + (1.0 - share) * wall) + noise.normal(0.0, 0.06, columns.shape)
    depth = CAMERA.fx * BASE / (np.round(8.0 * disparity) / 8.0)
    return depth.astype(np.float32), strap, wall, share


@pytest.mark.parametrize(
    ("width", "turn_deg", "least"), [(0.012, 0.0, 0.55), (0.012, 40.0, 0.55), (0.02, 0.0, 0.8), (0.02, 40.0, 0.8)]
)
def test_a_strap_beside_jumps_keeps_its_readings(width, turn_deg, least):
    depth, strap, wall, share = strap_before_wall(width, 0.3, turn_deg, seed=1)
    kept = clean_depth(depth, CAMERA) > 0
    inner = np.zeros_like(kept)
    inner[3:-3, 3:-3] = True
    right = inner & (share > 0.99)
    assert right.sum() > 400
    assert kept[right].mean() > least
    assert kept[inner & (share < 0.01)].mean() > 0.97
    flying = inner & (np.minimum(np.abs(depth - strap), np.abs(depth - wall)) > 0.02)
    assert flying.sum() > 300
    assert kept[flying].mean() < 0.02


@pytest.mark.parametrize("behind", [0.06, 0.1, 0.3, 1.0])
def test_flying_pixels_between_two_surfaces_are_dropped_at_any_gap(behind):
    depth, strap, wall, share = strap_before_wall(0.15, behind, 10.0, seed=2)
    kept = clean_depth(depth, CAMERA) > 0
    off = np.minimum(np.abs(depth - strap), np.abs(depth - wall))
    assert (off > 0.02).sum() > 200
    assert kept[off > 0.02].mean() < 0.05
    beside = (share > 0.99) & (np.roll(share, 2, axis=1) < 0.99)  # two pixels wide
    beside[:3] = beside[-3:] = False
    assert kept[beside].mean() > 0.8


def test_readings_without_noise_keep_a_step_and_lose_what_lies_between():
    camera = Intrinsics(64, 48, 60.0, 60.0, 31.5, 23.5)
    depth = np.full((48, 64), 1.0, np.float32)
    depth[:, 30:] = 1.2
    depth[:, 29] = 1.1
    clean = clean_depth(depth, camera)
    assert not clean[:, 29].any()
    assert_array_equal(clean[1:-1, 1:29], depth[1:-1, 1:29])
    assert_array_equal(clean[1:-1, 30:-1], depth[1:-1, 30:-1])


def test_readings_that_are_nothing_but_jumps_are_all_dropped():
    noise = np.random.default_rng(3)
    depth = noise.uniform(0.5, 4.0, (48, 64)).astype(np.float32)
    assert not clean_depth(depth, Intrinsics(64, 48, 60.0, 60.0, 31.5, 23.5)).any()
    assert not clean_depth(np.zeros_like(depth), Intrinsics(64, 48, 60.0, 60.0, 31.5, 23.5)).any()
