"""Animated skeletons of glTF and GLB files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.gltf.document import GltfDocument, open_gltf
from vto_pipeline.io.motion.bvh import MOST_TURNS
from vto_pipeline.io.motion.gltf_samplers import WIDTHS, Keys, read_sampler, sample
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.kinematics import local_rotations, matrix_quaternions, quaternion_matrices

_MOST_NODES = 1000
_RATES = (10.0, 240.0)
"""Frames per second between which keys decide."""

_NO_ANIMATION_S = 1 / 30
_TINY = 1e-9


def parse_animation(name: str) -> Arrays:
    """Read the first skeleton of a file and the animation with most channels on it. Runs in the sandbox.

    Keys may lie anywhere; frames are taken at the rate of the densest channel.

    Args:
        name: Path of a .gltf or .glb file.

    Returns:
        As `parse_bvh`; the unit is the metre.

    Raises:
        FormatError: the file breaks the format, or has no joints.
    """
    path = Path(name)
    document = open_gltf(path)
    nodes = document.items("nodes")
    above = _parents(document)
    skins = document.items("skins")
    chosen = skins[0].get("joints", []) if skins else list(range(len(nodes)))
    if not isinstance(chosen, list) or not 0 < len(chosen) <= _MOST_NODES or not set(map(type, chosen)) <= {int}:
        raise FormatError(f"expected 1 to {_MOST_NODES} joints", where=name)
    if min(chosen) < 0 or max(chosen) >= len(nodes) or len(set(chosen)) < len(chosen):
        raise FormatError(f"a joint is outside 0..{len(nodes) - 1}, or there twice", where=name)
    needed = _with_ancestors(chosen, above, name)
    channels, notes = _channels(document, set(needed))
    times, frame_time = _times(channels)
    if len(times) * len(needed) > MOST_TURNS:
        raise FormatError(f"{len(times)} frames of {len(needed)} joints; at most {MOST_TURNS} turns", where=name)
    place = {node: k for k, node in enumerate(needed)}
    parents = [place.get(above.get(node, -1), -1) for node in needed]
    moved = _worlds([nodes[node] for node in needed], parents, [channels.get(node, {}) for node in needed], times, path)
    resting = _worlds([nodes[node] for node in needed], parents, [{} for _ in needed], times[:1], path)
    joints = [place[node] for node in needed if node in set(chosen)]
    holder = [_nearest(parents, k, joints) for k in joints]
    rotations, translations = _local(moved[:, joints], holder)
    rest, offsets = _local(resting[:, joints], holder)
    labels = [str(nodes[needed[k]].get("name", f"node_{needed[k]}")) for k in joints]
    kinds = sorted({kind for one in channels.values() for _, _, kind in one.values()})
    return {
        "joint_names": np.array(labels, dtype=np.str_),
        "parents": np.array(holder, dtype=np.int64),
        "offsets": offsets[0],
        "rest": rest[0],
        "rotations": rotations,
        "translations": translations,
        "frame_time": np.array(frame_time),
        "dialect": np.array(f"glTF, {'a skin' if skins else 'nodes'}, {' and '.join(kinds) or 'no animation'}"),
        "notes": np.array(notes, dtype=np.str_),
        "warnings": np.array([], dtype=np.str_),
    }


def _parents(document: GltfDocument) -> dict[int, int]:
    above: dict[int, int] = {}
    count = len(document.items("nodes"))
    for k, node in enumerate(document.items("nodes")):
        children = node.get("children", [])
        if not isinstance(children, list):
            raise FormatError(f"nodes[{k}].children is not a list", where=str(document.path))
        for child in children:
            if type(child) is not int or not 0 <= child < count or child in above:
                problem = f"nodes[{k}]: child {child} does not exist, or has two parents"
                raise FormatError(problem, where=str(document.path))
            above[child] = k
    return above


def _with_ancestors(chosen: list[int], above: Mapping[int, int], where: str) -> list[int]:
    """The joints and all above them, parents first."""
    depths: dict[int, int] = {}
    for node in chosen:
        path = [node]
        while path[-1] in above and path[-1] not in depths:
            path.append(above[path[-1]])
            if len(path) > _MOST_NODES:
                raise FormatError("the nodes form a loop, or there are too many", where=where)
        first = depths.get(path[-1], 0)
        for k, one in enumerate(reversed(path)):
            depths[one] = first + k
    return sorted(depths, key=lambda node: (depths[node], node))


def _channels(document: GltfDocument, needed: set[int]) -> tuple[dict[int, dict[str, Keys]], list[str]]:
    """Node -> path -> times, values, interpolation, of the animation with most channels on these nodes; and notes."""
    where = str(document.path)
    best: dict[int, dict[str, Keys]] = {}
    animations = document.items("animations")
    sizes = []
    for animation in animations:
        entries = animation.get("channels", [])
        if not isinstance(entries, list) or not all(isinstance(one, dict) for one in entries):
            raise FormatError("an animation's channels are not a list of objects", where=where)
        targets = [one.get("target") for one in entries]
        if not all(isinstance(target, dict) for target in targets):
            raise FormatError("a channel of an animation has no target", where=where)
        sizes.append([one for one in entries if _moves_joint(one["target"], needed)])
    if not sizes or not max(map(len, sizes)):
        return {}, ["no animation: the skeleton at rest is a single pose"]
    index = max(range(len(sizes)), key=lambda k: len(sizes[k]))
    samplers = animations[index].get("samplers", [])
    for channel in sizes[index]:
        key = channel.get("sampler")
        if not isinstance(samplers, list) or type(key) is not int or not 0 <= key < len(samplers):
            raise FormatError(f"animations[{index}] has no sampler {key!r}", where=where)
        if not isinstance(samplers[key], dict):
            raise FormatError(f"animations[{index}].samplers[{key}] is not an object", where=where)
        target = channel["target"]
        read = read_sampler(document, samplers[key], target["path"])
        best.setdefault(target["node"], {})[target["path"]] = read
    others = [str(one.get("name", k)) for k, one in enumerate(animations) if k != index]
    notes = [f"animation {animations[index].get('name', index)} is read; the file also holds {', '.join(others)}"[:300]]
    return best, notes if others else []


def _moves_joint(target: Mapping[str, Any], needed: set[int]) -> bool:
    node, path = target.get("node"), target.get("path")
    return type(node) is int and node in needed and isinstance(path, str) and path in WIDTHS


def _times(channels: Mapping[int, Mapping[str, Keys]]) -> tuple[FloatArray, float]:
    """Times of the frames and their distance [s]."""
    keys = [times for one in channels.values() for times, _, _ in one.values()]
    moving = [times for times in keys if len(times) > 1]
    if not moving:
        return np.zeros(1), _NO_ANIMATION_S
    densest = max(moving, key=len)
    rate = float(np.clip(1.0 / np.median(np.diff(densest)), *_RATES))
    first, last = min(times[0] for times in moving), max(times[-1] for times in moving)
    count = int(min(round((last - first) * rate) + 1, MOST_TURNS))
    return first + np.arange(count) / rate, 1.0 / rate


def _worlds(
    nodes: list[Mapping[str, Any]],
    parents: list[int],
    channels: list[Mapping[str, Keys]],
    times: FloatArray,
    path: Path,
) -> FloatArray:
    """World transforms, shape (T, N, 4, 4), parents first."""
    world = np.empty((len(times), len(nodes), 4, 4))
    for k, (node, moved) in enumerate(zip(nodes, channels, strict=True)):
        local = _local_matrices(node, moved, times, path)
        world[:, k] = local if parents[k] < 0 else world[:, parents[k]] @ local
    if not np.isfinite(world).all():
        raise FormatError("a node's transform is not finite", where=str(path))
    return world


def _local_matrices(node: Mapping[str, Any], moved: Mapping[str, Keys], times: FloatArray, path: Path) -> FloatArray:
    local = np.tile(np.eye(4), (len(times), 1, 1))
    try:
        if "matrix" in node and not moved:
            local[:] = np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
            return local
        still = {
            "translation": np.array(node.get("translation", (0, 0, 0)), dtype=np.float64).reshape(3),
            "rotation": np.array(node.get("rotation", (0, 0, 0, 1)), dtype=np.float64).reshape(4),
            "scale": np.array(node.get("scale", (1, 1, 1)), dtype=np.float64).reshape(3),
        }
        values = {
            name: sample(moved[name], name, times) if name in moved else np.tile(value, (len(times), 1))
            for name, value in still.items()
        }
        turn = quaternion_matrices(values["rotation"])
    except (TypeError, ValueError) as e:
        raise FormatError(f"cannot parse a node's transform: {e}", where=str(path)) from None
    local[:, :3, :3] = turn * values["scale"][:, None, :]
    local[:, :3, 3] = values["translation"]
    return local


def _nearest(parents: list[int], k: int, joints: list[int]) -> int:
    """The place among the joints of the nearest joint above, -1 if there is none."""
    k = parents[k]
    while k >= 0 and k not in joints:
        k = parents[k]
    return joints.index(k) if k >= 0 else -1


def _local(worlds: FloatArray, parents: list[int]) -> tuple[FloatArray, FloatArray]:
    """Quaternions and places in the parents' frames, shapes (T, J, 4) and (T, J, 3), without any scale."""
    axes = worlds[..., :3, :3]
    axes = axes / np.maximum(np.linalg.norm(axes, axis=-2, keepdims=True), _TINY)
    flat = matrix_quaternions(axes)  # the nearest rotation, where scales were uneven
    turn = quaternion_matrices(flat)
    rotations = matrix_quaternions(local_rotations(parents, turn))
    places = worlds[..., :3, 3]
    translations = places.copy()
    for j, parent in enumerate(parents):
        if parent >= 0:
            translations[:, j] = np.einsum("tba,tb->ta", turn[:, parent], places[:, j] - places[:, parent])
    return rotations, translations
