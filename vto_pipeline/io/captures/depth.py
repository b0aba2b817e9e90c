"""Frames of a depth camera: depth/*.png (16 bit), color/*, intrinsics.json, and optionally poses.json."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.captures.images import SUFFIXES, check_images, read_gray16
from vto_pipeline.io.documents import check_schema, load_yaml, read_json
from vto_pipeline.io.files import check_folder, listed
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.frames import DepthFrameSet
from vto_pipeline.model.job import Job
from vto_pipeline.model.settings import Config


class IntrinsicsFile(Config):
    """intrinsics.json: the depth camera."""

    width: int = Field(ge=16, le=10_000, description="[px]")
    height: int = Field(ge=16, le=10_000, description="[px]")
    fx: float = Field(gt=0, description="[px]")
    fy: float = Field(gt=0, description="[px]")
    cx: float = Field(description="Principal point, from the centre of the first pixel [px]")
    cy: float = Field(description="Principal point, from the centre of the first pixel [px]")
    depth_scale: float = Field(1000.0, ge=1, le=1e6, description="Stored units per metre")


def read_depth_frames(folder: Path, *, job: Job | None = None) -> DepthFrameSet:
    """Find the frames of a folder and decode each once in a child process.

    Args:
        folder: Holds depth/, intrinsics.json, and maybe color/ and poses.json {"world_from_cam": [4x4, ...]}.
        job: Receives what was found.

    Raises:
        InputError: something is missing or does not fit together; FormatError: a frame is not a 16-bit picture of one
            channel.
    """
    folder = check_folder(Path(folder))
    depth = listed(check_folder(folder / "depth"), SUFFIXES)
    if not depth:
        raise InputError("there are no depth frames (PNG, TIFF)", where=str(folder / "depth"))
    camera = check_schema(load_yaml(folder / "intrinsics.json", error=InputError), IntrinsicsFile, error=InputError)
    found = check_images(depth)
    for path, mode in zip(depth, found["modes"], strict=True):
        if not mode.startswith("I;16"):
            problem = f"the frame has pixel mode {mode}; expected one 16-bit channel"
            raise FormatError(
                problem, where=str(path), hint="saving depth as a colour or 8-bit picture loses its values"
            )
    _check_sizes(depth, found["sizes"], camera)
    color = listed(folder / "color", SUFFIXES) if (folder / "color").is_dir() else ()
    if color:
        if len(color) != len(depth):
            raise InputError(f"{len(depth)} depth frames but {len(color)} colour frames", where=str(folder))
        _check_sizes(color, check_images(color)["sizes"], camera)
    poses = _read_poses(folder / "poses.json", len(depth)) if (folder / "poses.json").exists() else None
    if job is not None:
        extras = [name for name, there in (("colour", color), ("poses", poses is not None)) if there]
        job.note(f"{folder.name}: {', '.join([f'{len(depth)} depth frames', *extras])}")
    intrinsics = Intrinsics(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy)
    return DepthFrameSet(depth, color, intrinsics, camera.depth_scale, poses)


def read_depth(path: Path, scale: float) -> NDArray[np.float32]:
    """Decode one depth frame.

    Args:
        path: 16-bit picture.
        scale: Stored units per metre.

    Returns:
        Depth along the optical axis [m], 0 where there is no reading, shape (H, W).

    Raises:
        InputError: no such file; FormatError: not one channel of 16 bits.
    """
    return read_gray16(path).astype(np.float32) / np.float32(scale)


def _check_sizes(paths: tuple[Path, ...], sizes: NDArray[np.int64], camera: IntrinsicsFile) -> None:
    for path, (width, height) in zip(paths, sizes, strict=True):
        if (width, height) != (camera.width, camera.height):
            problem = f"the frame is {width} x {height}, intrinsics.json says {camera.width} x {camera.height}"
            raise InputError(problem, where=str(path), hint="colour must be registered to the depth")


def _read_poses(path: Path, count: int) -> FloatArray:
    """world_from_cam (N, 4, 4) [m]: rigid, to a thousandth.

    Raises:
        InputError: other shape, or not rigid.
    """
    stored = read_json(path)
    try:
        poses = np.array(stored["world_from_cam"], dtype=np.float64)
    except (KeyError, TypeError, ValueError):
        raise InputError("expected {'world_from_cam': [4x4, ...]}", where=str(path)) from None
    if poses.shape != (count, 4, 4) or not np.isfinite(poses).all():
        raise InputError(f"poses have shape {poses.shape}; expected ({count}, 4, 4), finite", where=str(path))
    rotation = poses[:, :3, :3]
    off = np.abs(rotation @ rotation.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    bad = np.flatnonzero((off > 1e-3) | (np.linalg.det(rotation) < 0) | (poses[:, 3] != (0, 0, 0, 1)).any(axis=1))
    if len(bad):
        raise InputError(
            f"pose {bad[0]} is not a rigid transform", where=str(path), hint="put the translation in the last column"
        )
    return poses
