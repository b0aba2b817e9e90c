"""Frames of a depth camera: depth/*.png (16 bit), color/*, intrinsics.json and maybe poses.json, or another layout."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.captures.images import SUFFIXES, check_images, read_gray16, read_image
from vto_pipeline.io.captures.rgbd_layouts import RgbdLayout, camera_of, find_layout, read_layout
from vto_pipeline.io.documents import check_schema, load_yaml, read_json
from vto_pipeline.io.files import check_folder, listed
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.frames import DepthFrameSet
from vto_pipeline.model.job import Job
from vto_pipeline.model.settings import Config

SATURATED = 65535
"""Stored where a camera has no reading, as an alternative to 0."""


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
        folder: Holds depth/, intrinsics.json, and maybe color/ and poses.json {"world_from_cam": [4x4, ...]}; or a
            layout that `rgbd_layouts` knows.
        job: Receives what was found.

    Raises:
        InputError: something is missing or does not fit together; FormatError: a frame is not a 16-bit picture of one
            channel.
    """
    folder = check_folder(Path(folder))
    if not (folder / "intrinsics.json").is_file() and find_layout(folder) is not None:
        return _from_layout(folder, read_layout(folder), Job() if job is None else job)
    depth = listed(check_folder(folder / "depth"), SUFFIXES)
    if not depth:
        raise InputError("there are no depth frames (PNG, TIFF)", where=str(folder / "depth"))
    camera = check_schema(load_yaml(folder / "intrinsics.json", error=InputError), IntrinsicsFile, error=InputError)
    _check_sizes(depth, _check_depth(depth), camera)
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


def holds_depth_frames(folder: Path) -> bool:
    """Whether a folder holds depth frames in a layout that is known."""
    return (folder / "depth").is_dir() or find_layout(folder) is not None


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
    stored = read_gray16(path)
    return np.where(stored == SATURATED, 0, stored).astype(np.float32) / np.float32(scale)


def frame_depth(frames: DepthFrameSet, index: int) -> NDArray[np.float32]:
    """Decode the depth of one frame, without the readings that the camera itself does not trust.

    Returns:
        As `read_depth`.

    Raises:
        InputError: as `read_depth`, or its confidence has another size.
    """
    depth = read_depth(frames.depth_paths[index], frames.depth_scale)
    if not frames.confidence_paths:
        return depth
    path = frames.confidence_paths[index]
    sure = read_image(path)[..., 0] > 0
    if sure.shape != depth.shape:
        raise InputError(f"confidence of {sure.shape} pixels, depth of {depth.shape}", where=str(path))
    return np.where(sure, depth, np.float32(0))


def frame_color(frames: DepthFrameSet, index: int) -> ByteArray | None:
    """Decode the colours of one frame, as the depth camera would see them, shape (H, W, 3); None without colour.

    Raises:
        InputError: as `read_image`.
    """
    import cv2

    if not frames.color_paths:
        return None
    picture, camera, lens = read_image(frames.color_paths[index]), frames.intrinsics, frames.color_intrinsics
    if lens is None:
        return picture
    factor = max(1, int(lens.fx / camera.fx))
    if factor > 1:  # the average of the colour pixels that a depth pixel covers
        lens = lens.reduced(factor)
        whole = picture[: lens.height * factor, : lens.width * factor]
        picture = np.asarray(cv2.resize(whole, (lens.width, lens.height), interpolation=cv2.INTER_AREA), dtype=np.uint8)
    across, down = lens.fx / camera.fx, lens.fy / camera.fy
    place = np.array([[across, 0, lens.cx - across * camera.cx], [0, down, lens.cy - down * camera.cy]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    size = (camera.width, camera.height)
    return np.asarray(
        cv2.warpAffine(picture, place, size, flags=flags, borderMode=cv2.BORDER_REPLICATE), dtype=np.uint8
    )


def _from_layout(folder: Path, layout: RgbdLayout, job: Job) -> DepthFrameSet:
    """The frames of another program's folder that have a pose, if any has."""
    kept = np.arange(len(layout.depth))
    if layout.poses is not None:
        kept = np.flatnonzero(np.isfinite(layout.poses).all(axis=(1, 2)))
        if len(kept) == 0:
            raise FormatError("no depth frame has a pose", where=str(folder))
    depth, color, confidence = (
        tuple(paths[k] for k in kept) if paths else () for paths in (layout.depth, layout.color, layout.confidence)
    )
    sizes = _check_depth(depth)
    if (sizes != sizes[0]).any():
        odd = int(np.flatnonzero((sizes != sizes[0]).any(axis=1))[0])
        problem = f"the frame is {sizes[odd][0]} x {sizes[odd][1]}, the first is {sizes[0][0]} x {sizes[0][1]}"
        raise InputError(problem, where=str(depth[odd]))
    camera = camera_of(layout.lens, (int(sizes[0][0]), int(sizes[0][1])), layout.lens_size)
    color_camera = None
    if color:
        shapes = check_images(color)["sizes"]
        if layout.color_lens is not None:
            color_camera = camera_of(layout.color_lens, (int(shapes[0][0]), int(shapes[0][1])), None)
        expected = camera if color_camera is None else color_camera
        for path, shape in zip(color, shapes, strict=True):
            if tuple(shape) != (expected.width, expected.height):
                problem = f"the colour frame is {shape[0]} x {shape[1]}; expected {expected.width} x {expected.height}"
                raise InputError(problem, where=str(path), hint="colour must be registered to the depth")
    if confidence:
        check_images(confidence)
    poses = None if layout.poses is None else _check_rigid(layout.poses[kept], folder)
    extras = [name for name, there in (("colour", color), ("poses", poses is not None)) if there]
    job.note(f"{folder.name}: {layout.name}, {', '.join([f'{len(depth)} depth frames', *extras])}")
    if len(kept) < len(layout.depth):
        job.note(f"left out {len(layout.depth) - len(kept)} frames without a pose")
    if layout.assumed:
        job.note(layout.assumed)
    approximate = poses is not None
    return DepthFrameSet(depth, color, camera, layout.scale, poses, approximate, color_camera, confidence)


def _check_depth(paths: tuple[Path, ...]) -> NDArray[np.int64]:
    """Sizes (N, 2) of depth frames, each decoded once in a child process.

    Raises:
        FormatError: one is no 16-bit picture of one channel.
    """
    found = check_images(paths)
    for path, mode in zip(paths, found["modes"], strict=True):
        if not mode.startswith("I;16"):
            problem = f"the frame has pixel mode {mode}; expected one 16-bit channel"
            raise FormatError(
                problem, where=str(path), hint="saving depth as a colour or 8-bit picture loses its values"
            )
    return np.asarray(found["sizes"])


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
    return _check_rigid(poses, path)


def _check_rigid(poses: FloatArray, path: Path) -> FloatArray:
    """The poses, if they are rigid to a thousandth."""
    rotation = poses[:, :3, :3]
    off = np.abs(rotation @ rotation.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    bad = np.flatnonzero((off > 1e-3) | (np.linalg.det(rotation) < 0) | (poses[:, 3] != (0, 0, 0, 1)).any(axis=1))
    if len(bad):
        raise InputError(
            f"pose {bad[0]} is not a rigid transform", where=str(path), hint="put the translation in the last column"
        )
    return poses
