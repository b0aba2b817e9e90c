"""The depth camera's faults against the formulas they come from, and the committed frames against the truth."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.bench.samples.captures.depth import BASELINE, SUBPIXEL, axial_sigma, noisy_depth, quantized
from vto_pipeline.io.captures.cameras import read_trajectory
from vto_pipeline.io.captures.depth import read_depth, read_depth_frames
from vto_pipeline.io.meshes import read_mesh

SAMPLES = Path(__file__).parents[2] / "sample_data"
FOCAL = 525.0


@pytest.mark.parametrize("depth", [0.8, 1.2, 2.0])
def test_noise_on_a_wall_is_the_models(depth):
    wall = np.full((300, 300), depth)
    read = noisy_depth(wall, np.ones_like(wall), FOCAL, np.random.default_rng(3))
    kept = read[read > 0]
    step = depth**2 / (FOCAL * BASELINE * SUBPIXEL)
    sigma = 0.0012 + 0.0019 * (depth - 0.4) ** 2  # Nguyen et al. 2012, eq. 2, written again
    assert_allclose(kept.std(), np.hypot(sigma, step / np.sqrt(12.0)), rtol=0.03, atol=0)  # Sheppard; wide steps
    assert abs(np.mean(kept) - depth) < 0.15 * step
    assert 0.001 < 1.0 - len(kept) / wall.size < 0.005
    assert_allclose(axial_sigma(np.array([depth])), sigma, rtol=1e-12, atol=0)


def test_readings_come_in_steps_of_an_eighth_of_a_pixel_of_disparity():
    levels = np.unique(quantized(np.linspace(1.0, 1.3, 100_000), FOCAL))
    assert_allclose(np.diff(FOCAL * BASELINE / levels), -1.0 / SUBPIXEL, rtol=1e-9, atol=0)
    assert_allclose(np.diff(levels), levels[1:] * levels[:-1] / (FOCAL * BASELINE * SUBPIXEL), rtol=1e-9, atol=0)


def test_edges_lose_pixels_and_let_some_fly():
    scene = np.full((200, 200), np.inf)
    scene[:, :100] = 1.0
    scene[:, 100:150] = 1.5
    read = noisy_depth(scene, np.ones_like(scene), FOCAL, np.random.default_rng(4))
    assert (read[:, 150:] == 0).all()
    near_edge = read[:, 99]
    assert 0.20 < (near_edge == 0).mean() < 0.42  # 0.30 of 200
    flying = (near_edge > 1.01) & (near_edge < 1.49)
    assert 0.01 < flying.mean() < 0.15
    assert (read[:, 20:90] > 0).mean() > 0.99
    assert read[:, 20:90].max() < 1.02


def test_grazing_surfaces_give_no_reading():
    wall = np.full((100, 100), 1.0)
    for incidence, low, high in ((0.10, 0.0, 0.0), (0.235, 0.45, 0.55), (0.40, 0.99, 1.0)):
        read = noisy_depth(wall, np.full_like(wall, incidence), FOCAL, np.random.default_rng(5))
        assert low <= (read > 0).mean() <= high


def true_depth(meshes, lens, pose):
    import open3d

    scene = open3d.t.geometry.RaycastingScene(nthreads=1)
    for mesh in meshes:
        scene.add_triangles(mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32))
    cam_from_world = np.linalg.inv(pose)
    open3d_matrix = lens.matrix.copy()
    open3d_matrix[:2, 2] += 0.5  # its ray caster counts from the pixel's corner
    rays = scene.create_rays_pinhole(open3d_matrix, cam_from_world, lens.width, lens.height)
    hit = scene.cast_rays(rays, nthreads=1)["t_hit"].numpy()
    return hit * (rays.numpy()[..., 3:] @ cam_from_world[2, :3])


@pytest.mark.parametrize(
    ("folder", "truth", "trajectory", "count"),
    [
        ("shirt_on_form/depth", ["shirt_on_form/form.ply", "truth/shirt.ply"], "truth/depth_trajectory.json", 60),
        ("customer/depth", ["truth/customer_body.ply"], "customer/depth/poses.json", 30),
    ],
)
def test_committed_frames_show_the_truth_with_the_models_noise(folder, truth, trajectory, count):
    frames = read_depth_frames(SAMPLES / folder)
    poses = read_trajectory(SAMPLES / trajectory)
    assert len(frames.depth_paths) == len(frames.color_paths) == len(poses) == count
    meshes = [read_mesh(SAMPLES / path, unit="m") for path in truth]
    for index in (0, count // 3, count - 1):
        read = read_depth(frames.depth_paths[index], frames.depth_scale)
        true = true_depth(meshes, frames.intrinsics, poses[index])
        both = (read > 0) & np.isfinite(true)
        error = read[both] - true[both]
        depth = np.median(true[both])
        expected = np.hypot(axial_sigma(depth), depth**2 / (FOCAL * BASELINE * SUBPIXEL) / np.sqrt(12.0))
        assert abs(np.median(error)) < 0.001
        assert 0.8 < 1.4826 * np.median(np.abs(error)) / expected < 1.5  # lateral jitter adds on slopes
        assert 0.0005 < (np.abs(error) > 0.015).mean() < 0.02  # flying pixels
        assert 0.85 < both.sum() / np.isfinite(true).sum() < 0.99  # dropouts


def test_form_frames_go_round_more_than_once_and_tell_no_poses():
    assert read_depth_frames(SAMPLES / "shirt_on_form/depth").world_from_cam is None
    eyes = read_trajectory(SAMPLES / "truth/depth_trajectory.json")[:, :3, 3]
    turn = np.unwrap(np.arctan2(eyes[:, 0], eyes[:, 2]))
    assert 380.0 < np.rad2deg(turn[-1] - turn[0]) < 400.0
    assert np.rad2deg(np.abs(np.diff(turn))).max() < 9.0


def test_customer_frames_come_with_poses():
    assert read_depth_frames(SAMPLES / "customer/depth").world_from_cam.shape == (30, 4, 4)
