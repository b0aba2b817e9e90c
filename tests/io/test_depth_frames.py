"""Folders of depth frames: what fits together is read exactly, what does not is named."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from PIL import Image

from vto_pipeline.errors import InputError
from vto_pipeline.io.captures.depth import read_depth, read_depth_frames
from vto_pipeline.model.job import Job

CAMERA = {"width": 64, "height": 48, "fx": 60.0, "fy": 61.0, "cx": 31.5, "cy": 23.5, "depth_scale": 1000.0}
MILLIMETRES = np.random.default_rng(6).integers(0, 5000, (48, 64)).astype(np.uint16)


def write_folder(folder: Path, count: int = 3, camera: dict[str, object] | None = None) -> Path:
    for name in ("depth", "color"):
        (folder / name).mkdir()
    for i in range(count):
        Image.fromarray(MILLIMETRES).save(folder / "depth" / f"{i:06d}.png")
        Image.fromarray((MILLIMETRES // 20).astype(np.uint8)).convert("RGB").save(folder / "color" / f"{i:06d}.jpg")
    (folder / "intrinsics.json").write_text(json.dumps(CAMERA if camera is None else camera))
    return folder


def write_poses(folder: Path, poses: np.ndarray) -> None:
    (folder / "poses.json").write_text(json.dumps({"world_from_cam": poses.tolist()}))


def test_a_folder_is_read_exactly(tmp_path: Path) -> None:
    write_folder(tmp_path)
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, 0, 3] = (0.0, 0.5, 1.0)
    write_poses(tmp_path, poses)
    job = Job()
    frames = read_depth_frames(tmp_path, job=job)
    assert [path.name for path in frames.depth_paths] == ["000000.png", "000001.png", "000002.png"]
    assert len(frames.color_paths) == 3
    assert (frames.intrinsics.width, frames.intrinsics.fy, frames.intrinsics.cx) == (64, 61.0, 31.5)
    assert np.array_equal(frames.world_from_cam, poses)
    depth = read_depth(frames.depth_paths[0], frames.depth_scale)
    assert depth.dtype == np.float32
    assert_allclose(depth, MILLIMETRES / 1000, rtol=1e-7)  # single precision
    assert job.notes == [f"{tmp_path.name}: 3 depth frames, colour, poses"]


def test_colour_and_poses_may_be_absent(tmp_path: Path) -> None:
    write_folder(tmp_path)
    for path in (tmp_path / "color").iterdir():
        path.unlink()
    (tmp_path / "color").rmdir()
    frames = read_depth_frames(tmp_path)
    assert frames.color_paths == ()
    assert frames.world_from_cam is None


def eight_bits(folder: Path) -> None:
    Image.fromarray((MILLIMETRES // 20).astype(np.uint8)).save(folder / "depth" / "000001.png")


def other_size(folder: Path) -> None:
    Image.fromarray(MILLIMETRES[:24]).save(folder / "depth" / "000001.png")


def colour_missing(folder: Path) -> None:
    (folder / "color" / "000001.jpg").unlink()


def cut(folder: Path) -> None:
    path = folder / "depth" / "000002.png"
    path.write_bytes(path.read_bytes()[:-500])


def scaled_pose(folder: Path) -> None:
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[1, :3, :3] *= 2.0
    write_poses(folder, poses)


def mirrored_pose(folder: Path) -> None:
    write_poses(folder, np.tile(np.diag([1.0, 1.0, -1.0, 1.0]), (3, 1, 1)))


def too_few_poses(folder: Path) -> None:
    write_poses(folder, np.tile(np.eye(4), (2, 1, 1)))


def no_intrinsics(folder: Path) -> None:
    (folder / "intrinsics.json").unlink()


def no_depth(folder: Path) -> None:
    for path in (folder / "depth").iterdir():
        path.unlink()


@pytest.mark.parametrize(
    ("damage", "problem", "where"),
    [
        (eight_bits, "pixel mode L; expected one 16-bit channel", "000001.png"),
        (other_size, "the frame is 64 x 24, intrinsics.json says 64 x 48", "000001.png"),
        (colour_missing, "3 depth frames but 2 colour frames", ""),
        (cut, "damaged or truncated", "000002.png"),
        (scaled_pose, "pose 1 is not a rigid transform", "poses.json"),
        (mirrored_pose, "pose 0 is not a rigid transform", "poses.json"),
        (too_few_poses, "poses have shape (2, 4, 4); expected (3, 4, 4)", "poses.json"),
        (no_intrinsics, "no such file", "intrinsics.json"),
        (no_depth, "there are no depth frames", "depth"),
    ],
)
def test_what_does_not_fit_is_named(tmp_path: Path, damage: Callable[[Path], None], problem: str, where: str) -> None:
    damage(write_folder(tmp_path))
    with pytest.raises(InputError) as caught:
        read_depth_frames(tmp_path)
    assert problem in caught.value.problem
    assert caught.value.where.endswith(where)


@pytest.mark.parametrize(
    ("change", "problem", "hint"),
    [
        ({"focal": 60}, "focal: unknown key (got 60)", "allowed: cx, cy, depth_scale, fx, fy, height, width"),
        ({"depth_scal": 1}, "depth_scal: unknown key (got 1)", "did you mean depth_scale?"),
        ({"fx": -60}, "fx: input should be greater than 0 (got -60)", ""),
        ({"depth_scale": 0.001}, "depth_scale: input should be greater than or equal to 1 (got 0.001)", ""),
    ],
)
def test_wrong_intrinsics_are_named(tmp_path: Path, change: dict[str, object], problem: str, hint: str) -> None:
    write_folder(tmp_path, camera=CAMERA | change)
    with pytest.raises(InputError) as caught:
        read_depth_frames(tmp_path)
    assert caught.value.problem == problem
    assert caught.value.hint == hint
    assert caught.value.where.endswith("intrinsics.json, line 1")
