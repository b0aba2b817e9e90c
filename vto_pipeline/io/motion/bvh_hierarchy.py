"""The skeleton of a BVH file: HIERARCHY up to MOTION."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.model.arrays import FloatArray

_MOST_JOINTS, _MOST_CHANNELS = 1000, 12
_HINT = "a BVH file begins with HIERARCHY and a ROOT"


@dataclass
class BvhJoint:
    """A joint or an end site.

    Args:
        name: As in the file; an end site has its parent's name and "_end".
        parent: Index, -1 for the root.
        offset: In the file's unit, shape (3,).
        channels: Lower case, in the order of the file.
    """

    name: str
    parent: int
    offset: FloatArray | None = None
    channels: list[str] = field(default_factory=list)

    @property
    def positions(self) -> list[int]:
        """Which of its channels are positions."""
        return [k for k, channel in enumerate(self.channels) if channel.endswith("position")]

    @property
    def turns(self) -> list[int]:
        """Which of its channels are rotations."""
        return [k for k, channel in enumerate(self.channels) if channel.endswith("rotation")]


_CHANNELS = {f"{axis}{kind}" for axis in "xyz" for kind in ("position", "rotation")}


def read_hierarchy(lines: list[str], path: Path) -> tuple[list[BvhJoint], int]:
    """Read the skeleton.

    Args:
        lines: Of the file.
        path: The file, for messages.

    Returns:
        Joints, parents first, and the index of the line after MOTION.

    Raises:
        FormatError: braces, names, offsets or channels are wrong; with the line.
    """
    joints: list[BvhJoint] = []
    open_joints: list[int] = []
    for number, line in enumerate(lines, start=1):
        where = f"{path}, line {number}"
        rest = line.replace("{", " { ").replace("}", " } ").replace("\t", " ").strip("\ufeff ")
        while rest:
            word, _, rest = rest.partition(" ")
            rest = rest.strip()
            key = word.lower().rstrip(":")
            if key == "motion":
                _check_whole(joints, open_joints, where)
                return joints, number
            if key in ("root", "joint", "end"):
                name, brace, after = rest.partition("{")
                _begin(joints, open_joints, key, name.strip(), where)
                rest = f"{brace}{after}".strip()
            elif key == "}":
                if not open_joints:
                    raise FormatError("a closing brace without an opening one", where=where)
                open_joints.pop()
            elif key == "offset":
                rest = _offset(joints, open_joints, rest, where)
            elif key == "channels":
                rest = _channels(joints, open_joints, rest, where)
            elif key not in ("", "hierarchy", "{"):
                raise FormatError(f"{word[:40]!r} is not a word of BVH", where=where, hint=_HINT)
    raise FormatError("no MOTION: the file ends inside of its skeleton", where=str(path), hint="is it cut off?")


def _begin(joints: list[BvhJoint], open_joints: list[int], key: str, name: str, where: str) -> None:
    if key == "root" and joints:
        raise FormatError("a second ROOT; files of two people are not read", where=where, hint="split the file")
    if key != "root" and not open_joints:
        raise FormatError(f"{key.upper()} outside of a ROOT", where=where, hint=_HINT)
    if len(joints) >= _MOST_JOINTS:
        raise FormatError(f"more than {_MOST_JOINTS} joints", where=where)
    parent = open_joints[-1] if open_joints else -1
    if key == "end":
        name = f"{joints[parent].name}_end"
    joints.append(BvhJoint(name or f"joint_{len(joints)}", parent))
    open_joints.append(len(joints) - 1)


def _offset(joints: list[BvhJoint], open_joints: list[int], rest: str, where: str) -> str:
    words = rest.split()
    try:
        values = np.array(words[:3], dtype=np.float64)
    except ValueError:
        values = np.empty(0)
    if not open_joints or values.shape != (3,) or not np.isfinite(values).all() or abs(values).max() > 1e7:
        raise FormatError(f"OFFSET {rest[:40]!r}; expected three numbers inside of a joint", where=where)
    joints[open_joints[-1]].offset = values
    return " ".join(words[3:])


def _channels(joints: list[BvhJoint], open_joints: list[int], rest: str, where: str) -> str:
    count, *names = rest.split() or [""]
    number = int(count) if count.isdecimal() and len(count) < 4 else -1
    taken = [name.lower() for name in names[: max(number, 0)]]
    if not open_joints or not 0 <= number <= _MOST_CHANNELS or len(taken) < number:
        raise FormatError(f"CHANNELS {rest[:40]!r}; expected a count and as many names", where=where)
    unknown = [name for name in taken if name not in _CHANNELS]
    if unknown or len(set(taken)) < len(taken):
        problem = f"channels {', '.join(taken)[:80]}; expected each of X, Y, Zposition and X, Y, Zrotation at most once"
        raise FormatError(problem, where=where)
    joints[open_joints[-1]].channels = taken
    return " ".join(names[number:])


def _check_whole(joints: list[BvhJoint], open_joints: list[int], where: str) -> None:
    if not joints or open_joints:
        problem = "MOTION inside of a joint: a brace is missing" if open_joints else "no ROOT before MOTION"
        raise FormatError(problem, where=where, hint=_HINT)
    bare = [joint.name for joint in joints if joint.offset is None]
    if bare:
        raise FormatError(f"joint {bare[0]!r} has no OFFSET", where=where)
    if not any(joint.channels for joint in joints):
        raise FormatError("no joint has channels: nothing moves", where=where)
