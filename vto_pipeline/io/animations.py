"""Moving pictures: GIF, and VP9 in MP4, which browsers play."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path

from vto_pipeline.errors import ConfigError, MissingDependencyError
from vto_pipeline.io.files import replacing
from vto_pipeline.model.arrays import ByteArray

_CODEC = "vp09"  # OpenCV's wheels hold no encoder of H.264


def write_animation(path: Path, frames: Iterator[ByteArray], per_second: float) -> None:
    """Write frames one by one as they come; the file appears once it is whole.

    Args:
        path: Ends with .gif or .mp4.
        frames: sRGB, all of one shape (H, W, 3); at least one.
        per_second: Of the frames.

    Raises:
        ConfigError: another ending.
        MissingDependencyError: this installation's OpenCV has no such encoder.
    """
    write = animation_writer(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as beside:
        write(beside, frames, per_second)


def animation_writer(path: Path) -> Callable[[Path, Iterator[ByteArray], float], None]:
    """Return what writes such a file.

    Raises:
        ConfigError: its name ends otherwise than with .gif or .mp4.
    """
    writers = {".gif": _write_gif, ".mp4": _write_mp4}
    if path.suffix.lower() not in writers:
        raise ConfigError(f"{path.name!r} cannot hold a moving picture", hint="its name ends with .gif or .mp4")
    return writers[path.suffix.lower()]


def _write_gif(path: Path, frames: Iterator[ByteArray], per_second: float) -> None:
    from PIL import Image

    pictures = (Image.fromarray(frame).quantize(128) for frame in frames)
    first = next(pictures)
    first.save(path, format="gif", save_all=True, append_images=pictures, duration=round(1000 / per_second), loop=0)


def _write_mp4(path: Path, frames: Iterator[ByteArray], per_second: float) -> None:
    import cv2

    first = next(frames)
    height, width = (2 * (side // 2) for side in first.shape[:2])  # its colours have half the pixels
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*_CODEC), per_second, (width, height))
    if not writer.isOpened():
        raise MissingDependencyError(f"OpenCV has no encoder {_CODEC}", hint="write a .gif instead")
    try:
        for frame in chain([first], frames):
            writer.write(frame[:height, :width, ::-1].copy())
    finally:
        writer.release()
