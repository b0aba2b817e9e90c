"""Depth frames as others lay them out: read exactly, in order, with their poses; what is broken is named."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from PIL import Image
from scipy.spatial.transform import Rotation

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.captures.depth import frame_color, frame_depth, holds_depth_frames, read_depth_frames
from vto_pipeline.io.captures.rgbd_layouts import find_layout
from vto_pipeline.io.sniff import find_kind
from vto_pipeline.model.job import Job

SIZE = (64, 48)
COUNT = 12
RANDOM = np.random.default_rng(3)
STORED = RANDOM.integers(500, 5000, (COUNT, 48, 64)).astype(np.uint16)
POSES = np.tile(np.eye(4), (COUNT, 1, 1))
POSES[:, :3, :3] = Rotation.from_rotvec(RANDOM.normal(0, 0.4, (COUNT, 3))).as_matrix()
POSES[:, :3, 3] = RANDOM.normal(0, 1, (COUNT, 3))
QUATERNIONS = Rotation.from_matrix(POSES[:, :3, :3]).as_quat()


def picture(path: Path, values: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(values).save(path)


def slope(width: int, height: int, scale: float, lens: tuple[float, float]) -> np.ndarray:
    """Colours that tell the direction of a pixel's ray: red its x, green its y."""
    v, u = np.mgrid[:height, :width]
    red, green = 128 + 100 * (u - lens[0]) / scale, 128 + 100 * (v - lens[1]) / scale
    return np.clip(np.round(np.stack([red, green, np.zeros_like(red)], 2)), 0, 255).astype(np.uint8)


def tum(folder: Path) -> Path:
    """Colour 7 ms after depth, in files that are not in the order of time; poses at other times."""
    order = RANDOM.permutation(COUNT)
    times = 100 + 0.05 * np.arange(COUNT)
    for k in range(COUNT):
        picture(folder / "depth" / f"{order[k]:04d}.png", STORED[k])
        picture(folder / "rgb" / f"{order[k]:04d}.png", np.full((48, 64, 3), k, np.uint8))
    for name, late, part in (("depth.txt", 0.0, "depth"), ("rgb.txt", 0.007, "rgb")):
        rows = [f"{times[k] + late:.6f} {part}/{order[k]:04d}.png" for k in RANDOM.permutation(COUNT)]
        (folder / name).write_text("\n".join(["# timestamp filename", *rows]))
    rows = [
        f"{times[k] + early:.6f} " + " ".join(f"{x:.6f}" for x in [*POSES[k, :3, 3], *QUATERNIONS[k]])
        for k in range(COUNT)
        for early in (-0.005, 0.005)
    ]
    (folder / "groundtruth.txt").write_text("\n".join(["# timestamp tx ty tz qx qy qz qw", *rows]))
    return folder


def seven_scenes(folder: Path) -> Path:
    for k in range(COUNT):
        stored = STORED[k].copy()
        stored[0, 0] = 65535
        picture(folder / f"frame-{k:06d}.depth.png", stored)
        picture(folder / f"frame-{k:06d}.color.png", np.full((48, 64, 3), k, np.uint8))
        np.savetxt(folder / f"frame-{k:06d}.pose.txt", POSES[k])
    return folder


def scannet(folder: Path) -> Path:
    """Colours of three times the size; tracking was lost in frame 4; 2 comes before 10."""
    for k in range(COUNT):
        picture(folder / "depth" / f"{k}.png", STORED[k])
        picture(folder / "color" / f"{k}.png", slope(192, 144, 180.0, (98.0, 70.0)))
        (folder / "pose").mkdir(exist_ok=True)
        np.savetxt(folder / "pose" / f"{k}.txt", np.full((4, 4), -np.inf) if k == 4 else POSES[k])
    (folder / "intrinsic").mkdir()
    depth, color = np.eye(4), np.eye(4)
    depth[:2, :3] = [[60, 0, 31.5], [0, 60, 23.5]]
    color[:2, :3] = [[180, 0, 98], [0, 180, 70]]
    np.savetxt(folder / "intrinsic" / "intrinsic_depth.txt", depth)
    np.savetxt(folder / "intrinsic" / "intrinsic_color.txt", color)
    return folder


def stray(folder: Path) -> Path:
    for k in range(COUNT):
        picture(folder / "depth" / f"{k:06d}.png", STORED[k])
        sure = np.full((48, 64), 2, np.uint8)
        sure[:, :8] = 0
        picture(folder / "confidence" / f"{k:06d}.png", sure)
    rows = [
        ", ".join([f"{0.1 * k:.3f}", f"{k:06d}", *(f"{x:.8f}" for x in [*POSES[k, :3, 3], *QUATERNIONS[k]])])
        for k in range(COUNT)
    ]
    (folder / "odometry.csv").write_text("\n".join(["timestamp, frame, x, y, z, qx, qy, qz, qw", *rows]))
    (folder / "camera_matrix.csv").write_text("1800, 0.0, 959.5\n0.0, 1800, 719.5\n0.0, 0.0, 1.0\n")
    (folder / "rgb.mp4").write_bytes(b"video")
    return folder


LAYOUTS = {"TUM": tum, "7-Scenes": seven_scenes, "ScanNet": scannet, "Stray Scanner": stray}


@pytest.mark.parametrize("name", LAYOUTS)
def test_frames_and_poses_are_read_in_order(tmp_path: Path, name: str) -> None:
    LAYOUTS[name](tmp_path)
    assert find_layout(tmp_path) == name
    assert holds_depth_frames(tmp_path)
    assert find_kind(tmp_path)[0] == "depth"
    job = Job()
    frames = read_depth_frames(tmp_path, job=job)
    kept = [k for k in range(COUNT) if not (name == "ScanNet" and k == 4)]
    assert len(frames.depth_paths) == len(kept)
    assert frames.poses_approximate
    assert_allclose(frames.world_from_cam, POSES[kept], rtol=0, atol=2e-6)  # six digits
    scale = 5000 if name == "TUM" else 1000
    for place, k in enumerate(kept):
        depth = frame_depth(frames, place)
        start = 8 if name == "Stray Scanner" else 1
        assert_allclose(depth[1:, start:], STORED[k, 1:, start:] / scale, rtol=1e-6)  # single precision
        if name in ("TUM", "7-Scenes"):
            assert (frame_color(frames, place) == k).all()
    assert name in job.notes[0]


def test_what_the_camera_does_not_trust_is_no_reading(tmp_path: Path) -> None:
    assert frame_depth(read_depth_frames(seven_scenes(tmp_path / "a")), 0)[0, 0] == 0
    frames = read_depth_frames(stray(tmp_path / "b"))
    assert (frame_depth(frames, 0)[:, :8] == 0).all()
    assert frame_color(frames, 0) is None
    assert_allclose([frames.intrinsics.fx, frames.intrinsics.cx, frames.intrinsics.cy], [60, 31.5, 23.5])


def test_colours_of_another_size_are_brought_to_the_depth_camera(tmp_path: Path) -> None:
    frames = read_depth_frames(scannet(tmp_path))
    expected = slope(64, 48, 60.0, (31.5, 23.5)).astype(int)
    assert np.abs(frame_color(frames, 0)[2:-2, 2:-2].astype(int) - expected[2:-2, 2:-2]).max() <= 1  # rounding


def other_size(folder: Path) -> None:
    picture(folder / "depth" / "3.png", STORED[3][:24])


def no_pose(folder: Path) -> None:
    (folder / "pose" / "3.txt").unlink()


def words_for_a_pose(folder: Path) -> None:
    (folder / "pose" / "3.txt").write_text("1 0 0 zero\n" * 4)


def all_lost(folder: Path) -> None:
    for path in (folder / "pose").iterdir():
        np.savetxt(path, np.full((4, 4), np.inf))


def no_lens(folder: Path) -> None:
    (folder / "intrinsic" / "intrinsic_depth.txt").unlink()


def mirrored(folder: Path) -> None:
    np.savetxt(folder / "pose" / "3.txt", np.diag([1.0, 1.0, -1.0, 1.0]))


@pytest.mark.parametrize(
    ("damage", "problem", "where"),
    [
        (other_size, "the frame is 64 x 24, the first is 64 x 48", "3.png"),
        (no_pose, "1 of 12 depth frames have no pose; the first is 3", ""),
        (words_for_a_pose, "'zero' is not a number", "3.txt, line 1"),
        (all_lost, "no depth frame has a pose", ""),
        (no_lens, "no such file", "intrinsic_depth.txt"),
        (mirrored, "pose 3 is not a rigid transform", ""),
    ],
)
def test_what_does_not_fit_is_named(tmp_path: Path, damage: Callable[[Path], None], problem: str, where: str) -> None:
    damage(scannet(tmp_path))
    with pytest.raises(InputError) as caught:
        read_depth_frames(tmp_path)
    assert problem in caught.value.problem
    assert caught.value.where.endswith(where)


def test_lists_that_lead_elsewhere_are_refused(tmp_path: Path) -> None:
    tum(tmp_path)
    (tmp_path / "depth.txt").write_text("1.0 ../../secret.png\n")
    with pytest.raises(FormatError, match="leads out of the folder"):
        read_depth_frames(tmp_path)
    (tmp_path / "depth.txt").write_text("one two three\n")
    with pytest.raises(FormatError, match="not a time and a file name"):
        read_depth_frames(tmp_path)
    (tmp_path / "depth.txt").write_text("999.0 depth/0001.png\n")
    with pytest.raises(FormatError, match="no colour frame is within"):
        read_depth_frames(tmp_path)


def test_wrong_columns_and_quaternions_are_refused(tmp_path: Path) -> None:
    stray(tmp_path)
    text = (tmp_path / "odometry.csv").read_text()
    (tmp_path / "odometry.csv").write_text(text.replace("qw", "w"))
    with pytest.raises(FormatError, match="expected frame, x"):
        read_depth_frames(tmp_path)
    (tmp_path / "odometry.csv").write_text("frame, x, y, z, qx, qy, qz, qw\n0, 0, 0, 0, 2, 0, 0, 1\n")
    with pytest.raises(FormatError, match="row 1 is not a position and a unit quaternion"):
        read_depth_frames(tmp_path)
