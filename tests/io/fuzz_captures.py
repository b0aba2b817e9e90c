"""More for the fuzzer: folders of depth frames, videos, HEIC pictures, skinned bodies, LAZ. For the child process.

Of a folder, one file is damaged and the whole is read.
"""

from __future__ import annotations

import os
import shutil
import signal
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from test_fuzz_readers import read_one, write_others
from test_heic import SAMPLE
from test_rgbd_layouts import LAYOUTS, POSES, STORED, picture
from test_skinned import WRITERS

from vto_pipeline.errors import FormatError, VtoError
from vto_pipeline.io import meshes
from vto_pipeline.io.bodies.skinned import read_skinned
from vto_pipeline.io.captures import images
from vto_pipeline.io.captures.depth import read_depth_frames
from vto_pipeline.io.captures.heic import encode_jpeg
from vto_pipeline.io.captures.video import measure_all, probe
from vto_pipeline.io.documents import write_json

Reader = Callable[[Path], Any]
REFUSED = 3


def directly(function: Callable[..., Any], *args: Any, **_: Any) -> Any:
    """Call what is else called in a child."""
    return function(*args)


def read_frames(folder: Path) -> Any:
    images.run_limited = directly  # type: ignore[assignment]
    return read_depth_frames(folder)


def read_body(path: Path) -> Any:
    meshes.run_limited = directly  # type: ignore[assignment]
    return read_skinned(path)


def read_video(path: Path) -> Any:
    probe(str(path))
    return measure_all(str(path))


def own_layout(folder: Path) -> Path:
    """This program's own layout, of three frames with colours."""
    for k in range(3):
        picture(folder / "depth" / f"{k}.png", STORED[k])
        picture(folder / "color" / f"{k}.png", np.full((48, 64, 3), k, np.uint8))
    lens = {"width": 64, "height": 48, "fx": 60.0, "fy": 60.0, "cx": 31.5, "cy": 23.5}
    write_json(folder / "intrinsics.json", lens)
    write_json(folder / "poses.json", {"world_from_cam": POSES[:3].tolist()})
    return folder


def write_video(path: Path, codec: str) -> None:
    """Eight frames of a texture that slides."""
    texture = cv2.GaussianBlur(np.random.default_rng(5).uniform(0, 255, (48, 80)), (0, 0), 2.0)
    wide = np.clip(128 + 4 * (texture - texture.mean()), 0, 255).astype(np.uint8)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), 10, (64, 48))
    for k in range(8):
        writer.write(np.ascontiguousarray(np.repeat(wide[:, k : k + 64, None], 3, axis=2)))
    writer.release()


def in_a_fork(read: Reader, dies_of: int) -> Reader:
    """Read in a process of its own, as the library may end it by one signal, which in earnest is refused."""

    def forked(path: Path) -> None:
        answer, tell = os.pipe()
        if not (child := os.fork()):
            signal.alarm(10)  # s; timers stay with the parent
            code = REFUSED
            try:
                read(path)
                code = 0
            except VtoError:
                pass
            except Exception:
                os.write(tell, traceback.format_exc().encode()[-1000:])
                code = 1
            os._exit(code)
        os.close(tell)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        said = os.read(answer, 1000).decode()
        os.close(answer)
        if code in (REFUSED, -dies_of):
            raise FormatError("refused")
        if code != 0:
            raise RuntimeError(said or f"it ended with {code}")

    return forked


OF_FRAMES: dict[str, tuple[Callable[[Path], Path], str]] = {
    "frames": (own_layout, "intrinsics.json"),
    "frames_poses": (own_layout, "poses.json"),
    "frames_depth": (own_layout, "depth/1.png"),
    "tum_poses": (LAYOUTS["TUM"], "groundtruth.txt"),
    "tum_depth": (LAYOUTS["TUM"], "depth.txt"),
    "tum_color": (LAYOUTS["TUM"], "rgb.txt"),
    "seven_scenes_pose": (LAYOUTS["7-Scenes"], "frame-000003.pose.txt"),
    "scannet_pose": (LAYOUTS["ScanNet"], "pose/3.txt"),
    "scannet_lens": (LAYOUTS["ScanNet"], "intrinsic/intrinsic_color.txt"),
    "stray_poses": (LAYOUTS["Stray Scanner"], "odometry.csv"),
    "stray_lens": (LAYOUTS["Stray Scanner"], "camera_matrix.csv"),
}
OF_BODIES = {
    "smpl": ("smpl", "model.npz"),
    "skinned_gltf": ("gltf", "body.glb"),
    "makehuman": ("makehuman", "base.obj"),
    "makehuman_rig": ("makehuman", "rig.two.json"),
    "makehuman_weights": ("makehuman", "weights.two.json"),
    "makehuman_target": ("makehuman", "taller.target.gz"),
}
VIDEOS = {"video_mp4": ("a.mp4", "mp4v"), "video_avi": ("a.avi", "MJPG")}
CAPTURES = [*OF_FRAMES, *OF_BODIES, *VIDEOS, "heic", "laz"]


def sound_capture(target: str, folder: Path) -> tuple[Path, Reader]:
    """Return the file of a target that is damaged, and what reads all of it."""
    if target in OF_FRAMES:
        write, name = OF_FRAMES[target]
        write(folder)
        return folder / name, lambda _: read_frames(folder)
    if target in OF_BODIES:
        kind, name = OF_BODIES[target]
        if target == "makehuman_target":
            (folder / "targets.yaml").write_text("taller.target.gz: 0.5\n")
        whole = WRITERS[kind](folder)
        return folder / name, lambda _: read_body(whole)
    if target in VIDEOS:
        name, codec = VIDEOS[target]
        write_video(folder / name, codec)
        return folder / name, read_video
    if target == "heic":
        found = Path(shutil.copy(SAMPLE, folder / "a.heic"))
        return found, in_a_fork(lambda path: encode_jpeg(str(path)), signal.SIGSEGV)  # pi-heif, of broken metadata
    return write_others(folder)["a.laz"], in_a_fork(read_one, signal.SIGABRT)  # lazrs, where memory is short
