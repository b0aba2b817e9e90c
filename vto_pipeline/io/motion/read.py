"""Motion from files of any kind, parsed in a limited child process."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.files import check_file
from vto_pipeline.io.motion.bvh import parse_bvh
from vto_pipeline.io.motion.gltf_animation import parse_animation
from vto_pipeline.io.motion.joint_map import JointMap, map_joints
from vto_pipeline.io.motion.keyframes import parse_keyframes
from vto_pipeline.io.motion.smpl_poses import parse_smpl_poses
from vto_pipeline.io.motion.tracked.parse import parse_tracked
from vto_pipeline.io.motion.upright import Axes, rest_places, upright
from vto_pipeline.io.sandbox import run_limited
from vto_pipeline.model.job import Job
from vto_pipeline.model.motion import Clip
from vto_pipeline.units import LENGTH_M

_LIMIT_BYTES = 300_000_000

PARSERS: dict[str, Callable[[str], Arrays]] = {
    ".bvh": parse_bvh,
    ".jsonl": parse_tracked,
    ".glb": parse_animation,
    ".gltf": parse_animation,
    ".npz": parse_smpl_poses,
    ".yaml": parse_keyframes,
    ".yml": parse_keyframes,
}
"""Suffix -> parser."""

UP_AXES = ("+X", "-X", "+Y", "-Y", "+Z", "-Z")
"""Axes that may point up."""


@dataclass(frozen=True)
class MotionFile:
    """A clip and what its file is.

    Args:
        clip: In metres, +Y up.
        joints: Which of its joints is which of ours.
        axes: Unit and up axis of the file.
        dialect: In words.
    """

    clip: Clip
    joints: JointMap
    axes: Axes
    dialect: str


def presets() -> dict[str, Path]:
    """Return the named poses and movements that come with the package: name -> file."""
    return {path.stem: path for path in sorted((Path(__file__).parent / "presets").glob("*.yaml"))}


def read_motion(
    path: Path | str, *, unit: str | None = None, up: str | None = None, job: Job | None = None
) -> MotionFile:
    """Read a motion.

    Args:
        path: BVH; glTF or GLB with a skeleton; poses of the SMPL family (.npz); poses in YAML;
            joints followed by a camera, as JSON lines (.jsonl); or the name of a preset.
        unit: Unit of length, a key of `units.LENGTH_M`; None: found from the length of the legs.
        up: One of `UP_AXES`; None: the axis along which the body stands.
        job: Notified of what was found, guessed or filled.

    Raises:
        InputError: no such file, or unit or axis are unknown; FormatError: it breaks its format, or is no person's
            skeleton.
    """
    job = job or Job()
    path = presets().get(str(path), Path(path))
    if not path.suffix and not path.exists():
        raise InputError(f"no file and no preset has the name {path}", hint=f"presets: {', '.join(presets())}")
    if unit is not None and unit not in LENGTH_M:
        raise InputError(f"unit is {unit!r}; expected one of {', '.join(LENGTH_M)}", where=str(path))
    if up is not None and up not in UP_AXES:
        raise InputError(f"up is {up!r}; expected one of {', '.join(UP_AXES)}", where=str(path))
    path = check_file(path, PARSERS, _LIMIT_BYTES)
    arrays = run_limited(PARSERS[path.suffix.lower()], str(path.resolve()), where=str(path))
    for text in arrays["notes"]:
        job.note(f"{path.name}: {text}")
    for text in arrays["warnings"]:
        job.warn(f"{path.name}: {text}")
    return understood(arrays, path, unit, up, job)


def clip_of(arrays: Arrays) -> Clip:
    """Return what a parser gave as a clip, in the file's unit and axes.

    Raises:
        InputError: it is none.
    """
    return Clip(
        tuple(map(str, arrays["joint_names"])),
        arrays["parents"],
        arrays["offsets"],
        arrays["rest"],
        arrays["rotations"],
        arrays["translations"],
        float(arrays["frame_time"]),
    )


def understood(arrays: Arrays, path: Path, unit: str | None, up: str | None, job: Job) -> MotionFile:
    """Return what a parser gave as a clip in metres, +Y up; see `read_motion`.

    Args:
        arrays: Of a parser.
        path: The file, for messages.
        unit: As for `read_motion`.
        up: As for `read_motion`.
        job: Notified of what was guessed.
    """
    try:
        clip = clip_of(arrays)
    except InputError as e:
        raise FormatError(e.problem, where=str(path)) from None
    joints = map_joints(clip.joint_names, clip.parents.tolist(), rest_places(clip)[1], str(path))
    clip, axes = upright(clip, joints, unit, up)
    if axes.unit == "unknown":
        job.warn(f"{path.name}: the legs have a usual length in no unit; the clip is scaled to ordinary ones")
    elif unit is None and axes.unit != "m":
        job.note(f"{path.name}: unit: assumed to be {axes.unit}, in which the legs have a usual length")
    if up is None and axes.up != "+Y":
        job.note(f"{path.name}: up is assumed to be {axes.up}, along which the body stands")
    if joints.convention == "form":
        job.note(f"{path.name}: names of joints are unknown; they are found by the form of the skeleton")
    if joints.unmapped:
        shown = ", ".join(joints.unmapped[:8]) + (" ..." if len(joints.unmapped) > 8 else "")
        job.note(f"{path.name}: {len(joints.unmapped)} joints stand for none of the avatar's: {shown}")
    return MotionFile(clip, joints, axes, str(arrays["dialect"]))
