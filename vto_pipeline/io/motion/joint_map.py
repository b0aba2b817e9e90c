"""Which joint of a foreign skeleton is which of ours: by a table of names, else by the form of the skeleton."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.documents import load_yaml
from vto_pipeline.io.motion.skeleton_form import ancestors, joints_by_form, lowest_common
from vto_pipeline.model.arrays import FloatArray

_SIDED = ("clavicle", "shoulder", "elbow", "wrist", "hip", "knee", "ankle", "toe")
_NEEDED = tuple(f"{side}_{joint}" for side in ("left", "right") for joint in ("hip", "knee", "ankle"))
_CHAINS = (("hip", "knee", "ankle", "toe"), ("clavicle", "shoulder", "elbow", "wrist"))
_SHARED = 0.6
"""Share of joints with one prefix from which it says nothing."""


@dataclass(frozen=True)
class JointMap:
    """What stands for our joints.

    Args:
        indices: Our joint, or "left_toe", "right_toe" -> index there.
        convention: The names' convention, or "form" where the form of the skeleton decided.
        unmapped: Names there that stand for none of ours, without end sites.
    """

    indices: Mapping[str, int]
    convention: str
    unmapped: tuple[str, ...]


def map_joints(names: Sequence[str], parents: Sequence[int], places: FloatArray, where: str) -> JointMap:
    """Find the joints.

    Args:
        names: J names.
        parents: Index of each joint's parent, -1 for a root.
        places: World positions at rest, in any unit and axes, shape (J, 3).
        where: The file, for messages.

    Raises:
        FormatError: it has no two legs.
    """
    best: dict[str, int] = {}
    convention = "form"
    for candidate, table in _conventions().items():
        found = _by_name(_plain(names), table)
        if _is_body(found, parents) and len(found) > len(best):
            best, convention = found, candidate
    if not best:
        best = joints_by_form(parents, places)
    if not _is_body(best, parents):
        shown = ", ".join(names[:12])
        hint = "name the joints as Mixamo, CMU, SMPL or MakeHuman do"
        raise FormatError(f"not the skeleton of a person: no two legs among {shown}", where=where, hint=hint)
    best = _trunk(best, parents)
    used = set(best.values())
    rest = tuple(name for k, name in enumerate(names) if k not in used and not name.endswith("_end"))
    return JointMap(best, convention, rest)


def joints_by_name(names: Sequence[str]) -> tuple[str, dict[str, str]]:
    """Return the convention that names most joints, and our joint -> the name there."""
    found = {convention: _by_name(_plain(names), table) for convention, table in _conventions().items()}
    best = max(found, key=lambda convention: len(found[convention]))
    return best, {joint: names[k] for joint, k in found[best].items()}


@cache
def _conventions() -> dict[str, dict[str, list[str]]]:
    """Convention -> our joint -> the names it may have, reduced."""
    document = load_yaml(Path(__file__).with_name("joint_names.yaml"))
    tables: dict[str, dict[str, list[str]]] = {}
    for convention, entry in document.data.items():
        table = {joint: [_reduced(name) for name in entry[joint]] for joint in ("neck", "head")}
        for side, word in zip(("left", "right"), entry["sides"], strict=True):
            for joint in _SIDED:
                table[f"{side}_{joint}"] = [_reduced(name.replace("*", word)) for name in entry[joint]]
        tables[convention] = table
    return tables


def _reduced(name: str) -> str:
    """Letters and digits; a leading line is kept, for it marks a helper that does not move."""
    return ("_" if name.startswith("_") else "") + re.sub(r"[^a-z0-9]", "", name.lower())


def _plain(names: Sequence[str]) -> list[str]:
    """Names reduced to letters and digits, without namespaces and without a prefix that most share."""
    last = [re.split(r"[:|]", name)[-1] for name in names]
    heads = Counter(found[0] for name in last if (found := re.match(r"[^_ .]+[_ .]", name)))
    if heads:
        prefix, count = heads.most_common(1)[0]
        if count >= _SHARED * len(last):
            last = [name.removeprefix(prefix) for name in last]
    return [_reduced(name) for name in last]


def _by_name(plain: Sequence[str], table: Mapping[str, Sequence[str]]) -> dict[str, int]:
    found = {}
    for joint, allowed in table.items():
        hits = [plain.index(name) for name in allowed if name in plain]
        if hits:
            found[joint] = hits[0]
    return found


def _is_body(found: Mapping[str, int], parents: Sequence[int]) -> bool:
    """Whether both legs are there, no joint stands for two, and limbs hang in the right order."""
    if any(name not in found for name in _NEEDED) or len(set(found.values())) < len(found):
        return False
    for side in ("left", "right"):
        for chain in _CHAINS:
            there = [found[f"{side}_{joint}"] for joint in chain if f"{side}_{joint}" in found]
            if any(a not in ancestors(parents, b) for a, b in pairwise(there)):
                return False
    return True


def _trunk(found: dict[str, int], parents: Sequence[int]) -> dict[str, int]:
    """Add pelvis, chest and spine: what both legs and both arms hang on, and the middle between."""
    trunk = {"pelvis": lowest_common(parents, found["left_hip"], found["right_hip"])}
    arms = [found.get(f"{side}_clavicle", found.get(f"{side}_shoulder")) for side in ("left", "right")]
    if arms[0] is not None and arms[1] is not None:
        trunk["chest"] = lowest_common(parents, arms[0], arms[1])
    elif "head" in found:
        trunk["chest"] = parents[found.get("neck", found["head"])]
    if "chest" in trunk:
        above = [k for k in ancestors(parents, trunk["chest"]) if k not in ancestors(parents, trunk["pelvis"])]
        between = [k for k in above if k not in (trunk["chest"], trunk["pelvis"])]
        if between:
            trunk["spine"] = between[len(between) // 2]
    taken = set(found.values())
    return found | {name: k for name, k in trunk.items() if k >= 0 and (k not in taken or name == "pelvis")}


def rest_left(joints: JointMap, places: FloatArray) -> FloatArray:
    """Return the direction to the body's left at rest, of any length, shape (3,)."""
    left: FloatArray = places[joints.indices["left_hip"]] - places[joints.indices["right_hip"]]
    if np.linalg.norm(left) == 0.0 and "left_shoulder" in joints.indices and "right_shoulder" in joints.indices:
        return places[joints.indices["left_shoulder"]] - places[joints.indices["right_shoulder"]]
    return left
