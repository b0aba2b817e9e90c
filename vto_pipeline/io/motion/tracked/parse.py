"""Joints that a camera follows, as a clip."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.motion.standard_skeleton import NAMES
from vto_pipeline.io.motion.tracked.lines import TrackedFrames, read_lines
from vto_pipeline.io.motion.tracked.turns import fitted_skeleton, turns_of
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.kinematics import local_rotations, matrix_quaternions

NEEDED = tuple(
    f"{side}_{joint}" for joint in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle") for side in ("left", "right")
)
"""Joints without which nothing is known of the limbs."""

_BONES = (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist"))
_RATE = 30.0
"""Frames a second where the file does not say."""
_MOST_LOST = 0.5
"""Share of frames in which a joint may be lost."""
_LEAST_BONE = 1e-3
"""Of the trunk's length: shorter is no bone, and has no direction."""


def parse_tracked(name: str) -> Arrays:
    """Read joints that a camera follows, one frame a line. Runs in the sandbox.

    Places between frames follow straight lines: where a joint was not seen, and where frames came at uneven times.

    Args:
        name: Path of a .jsonl file.

    Returns:
        As `parse_bvh`.

    Raises:
        FormatError: it breaks the format, or a joint that is needed is missing, or lost in most frames.
    """
    read = read_lines(Path(name))
    missing = [joint for joint in NEEDED if joint not in read.places]
    if missing:
        raise FormatError(f"no {', '.join(missing)} in any frame", where=name, hint="names as in the docs on motion")
    notes, warnings = [f"joints are named by the convention {read.convention!r}"], []
    places, lost = _filled(read, name)
    if lost:
        warnings.append(f"joints that were not seen in some frames are guessed from others: {', '.join(lost)}")
    if read.times is None:
        frame_time = 1.0 / _RATE
        notes.append(f"the lines hold no time: {_RATE:g} frames a second are assumed")
    else:
        places, frame_time = _evenly(places, read.times, name)
    refuse_points(places, name)
    parents, offsets = fitted_skeleton(places)
    world, root = turns_of(places, offsets)
    hips = 0.5 * (places["left_hip"] + places["right_hip"])
    if len(hips) > 1 and np.abs(hips).max() < _LEAST_BONE * np.abs(offsets).max():
        root = root + carried_by_feet(places)
        notes.append("places count from the hips: the foot that stands carries the body")
    return moving_skeleton(parents, offsets, world, root, frame_time) | {
        "notes": np.array(notes, dtype=np.str_),
        "warnings": np.array(warnings, dtype=np.str_),
    }


def moving_skeleton(
    parents: list[int], offsets: FloatArray, world: FloatArray, root: FloatArray, frame_time: float
) -> Arrays:
    """Return a skeleton that turns, as `parse_bvh` does, without notes.

    Args:
        parents, offsets: Of `fitted_skeleton`.
        world: Rotations in the world, shape (T, J, 3, 3).
        root: Places of the root, shape (T, 3).
        frame_time: [s].
    """
    translations = np.tile(offsets, (len(root), 1, 1))
    translations[:, 0] = root
    return {
        "joint_names": np.array(NAMES, dtype=np.str_),
        "parents": np.array(parents, dtype=np.int64),
        "offsets": offsets,
        "rest": np.tile([0.0, 0.0, 0.0, 1.0], (len(NAMES), 1)),
        "rotations": matrix_quaternions(local_rotations(parents, world)),
        "translations": translations,
        "frame_time": np.array(frame_time),
        "dialect": np.array("joints followed by a camera"),
    }


def _filled(read: TrackedFrames, name: str) -> tuple[dict[str, FloatArray], list[str]]:
    """Return places without gaps, and which joints had some; a joint that is not needed and mostly lost is left out."""
    places: dict[str, FloatArray] = {}
    lost: list[str] = []
    for joint, there in read.places.items():
        seen = np.isfinite(there).all(axis=1)
        if seen.mean() < 1 - _MOST_LOST:
            if joint in NEEDED:
                raise FormatError(f"{joint} is seen in {seen.mean():.0%} of the frames", where=name)
            continue
        frames = np.flatnonzero(seen)
        places[joint] = np.stack([np.interp(np.arange(len(there)), frames, there[seen, k]) for k in range(3)], axis=1)
        lost += [joint] if len(frames) < len(there) else []
    return places, lost


def _evenly(places: dict[str, FloatArray], times: FloatArray, name: str) -> tuple[dict[str, FloatArray], float]:
    """Return places at even times, as many a second as there are in the middle frame, and the time between them [s]."""
    if not np.isfinite(times).all() or (np.diff(times) <= 0).any():
        late = int(np.argmin(np.diff(times) > 0)) + 2
        raise FormatError(f"the times of the frames do not rise, at frame {late}", where=name)
    if len(times) == 1:
        return places, 1.0 / _RATE
    frame_time = float(np.median(np.diff(times)))
    even = times[0] + frame_time * np.arange(int((times[-1] - times[0]) / frame_time + 1e-6) + 1)
    found = {
        joint: np.stack([np.interp(even, times, there[:, k]) for k in range(3)], axis=1)
        for joint, there in places.items()
    }
    return found, frame_time


def refuse_points(places: Mapping[str, FloatArray], name: str) -> None:
    """Refuse bones without length: they have no direction."""
    trunk = 0.5 * (places["left_shoulder"] + places["right_shoulder"] - places["left_hip"] - places["right_hip"])
    least = _LEAST_BONE * float(np.median(np.linalg.norm(trunk, axis=1)))
    bones = [(f"{side}_{one}", f"{side}_{other}") for side in ("left", "right") for one, other in _BONES]
    for one, other in [*bones, ("left_hip", "right_hip"), ("left_shoulder", "right_shoulder")]:
        if not (np.linalg.norm(places[one] - places[other], axis=1) > least).all():
            raise FormatError(f"{one} and {other} are in one place", where=name)
    if not (np.linalg.norm(trunk, axis=1) > 0).all():
        raise FormatError("hips and shoulders are in one place", where=name)


def carried_by_feet(places: Mapping[str, FloatArray]) -> FloatArray:
    """Return how far the body has gone, of which only places about the hips are known, shape (T, 3).

    From one frame to the next it goes as far as the lower foot goes back. Toes are better than ankles: they stand until
    the other foot does.
    """
    trunk = places["left_shoulder"] + places["right_shoulder"] - places["left_hip"] - places["right_hip"]
    up = trunk.mean(axis=0)
    point = "toe" if {"left_toe", "right_toe"} <= set(places) else "ankle"
    feet = np.stack([places[f"left_{point}"], places[f"right_{point}"]], axis=1)
    stands = np.argmin(feet @ up, axis=1)
    rows = np.arange(len(feet) - 1)
    steps = feet[rows, stands[:-1]] - feet[rows + 1, stands[:-1]]
    return np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
