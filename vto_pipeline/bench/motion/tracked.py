"""`python -m vto_pipeline.bench.motion.tracked FILE...` gives motions as places of joints, and prints what is lost.

A recording's joints are written as JSON lines, read again, and held against the recording: joints, the avatar's skin,
and the way that the body goes where places count from the hips.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from vto_pipeline.avatar.model.pose import pose_avatar
from vto_pipeline.avatar.motion.retarget import retarget
from vto_pipeline.avatar.template.template import template
from vto_pipeline.bench.printed_table import print_table
from vto_pipeline.io.motion.read import MotionFile, read_motion
from vto_pipeline.io.motion.tracked.lines import LANDMARKS
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.kinematics import quaternion_matrices, world_transforms

_HEADS = (
    "clip",
    "frames",
    "joints off mm, median",
    "most",
    "skin off mm, median",
    "95 %",
    "way of the hips m",
    "its end off m",
    "most",
)
_LOOKED_AT = 12  # frames in which the skin is compared


def row(source: str, folder: Path) -> tuple[str, ...]:
    """Return a row of figures of one motion.

    Args:
        source: A file, or the name of a preset.
        folder: For what is written between.
    """
    motion = read_motion(source)
    truth = {name: place for name, place in _places(motion).items() if name in LANDMARKS}
    hips = 0.5 * (truth["left_hip"] + truth["right_hip"])
    read = _again(folder / "whole.jsonl", truth, motion.clip.frame_time)
    found = _places(read)
    off = np.stack([np.linalg.norm(found[name] - place, axis=1) for name, place in truth.items()])
    skin = np.stack(list(_skin_off(motion, read)))
    about = {name: place - hips for name, place in truth.items()}
    carried = _places(_again(folder / "about_the_hips.jsonl", about, motion.clip.frame_time))
    gone = 0.5 * (carried["left_hip"] + carried["right_hip"])
    astray = np.linalg.norm(((gone - gone[0]) - (hips - hips[0]))[:, [0, 2]], axis=1)
    way = np.linalg.norm(np.diff(hips[:, [0, 2]], axis=0), axis=1).sum()
    return (
        Path(source).stem,
        str(len(hips)),
        f"{1e3 * np.median(off):.1f}",
        f"{1e3 * off.max():.0f}",
        f"{1e3 * np.median(skin):.0f}",
        f"{1e3 * np.quantile(skin, 0.95):.0f}",
        f"{way:.2f}",
        f"{astray[-1]:.2f}",
        f"{astray.max():.2f}",
    )


def _places(motion: MotionFile) -> dict[str, FloatArray]:
    """Return joint -> world places [m], shape (T, 3)."""
    clip = motion.clip
    _, places = world_transforms(clip.parents, quaternion_matrices(clip.rotations), clip.translations)
    return {name: places[:, k] for name, k in motion.joints.indices.items()}


def _again(path: Path, places: Mapping[str, FloatArray], frame_time: float) -> MotionFile:
    """Write places as JSON lines, and read them."""
    with path.open("w") as file:
        for t in range(len(places["left_hip"])):
            joints = {name: place[t].tolist() for name, place in places.items()}
            file.write(json.dumps({"time_s": t * frame_time, "joints": joints}) + "\n")
    return read_motion(path, up="+Y", unit="m")


def _skin_off(one: MotionFile, other: MotionFile) -> Iterator[FloatArray]:
    """Yield how far the mean woman's skin is between both, in some frames [m]."""
    body = template(0.0)
    moved = [retarget(motion.clip, motion.joints, body)[0] for motion in (one, other)]
    last = min(len(motion.poses) for motion in moved) - 1
    for t in np.unique(np.linspace(0, last, _LOOKED_AT).astype(int)):
        a, b = (pose_avatar(body, motion.poses[t], motion.translations[t]).vertices for motion in moved)
        yield np.linalg.norm(a - b, axis=1)


def main() -> int:
    """Read the command line and print the table."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.motion.tracked", description=__doc__)
    parser.add_argument("sources", nargs="+", metavar="FILE", help="a motion of at least two frames")
    sources = parser.parse_args().sources
    with TemporaryDirectory() as folder:
        return print_table(_HEADS, (row(source, Path(folder)) for source in sources))


if __name__ == "__main__":
    sys.exit(main())
