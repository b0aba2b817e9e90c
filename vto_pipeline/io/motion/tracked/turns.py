"""The rotations of a skeleton whose joints are at given places.

Places leave the turn about a bone open. Elbows and knees are hinges: where they are bent, the plane of the bend shows
the turn; where they are straight, the bone turns no more than its direction asks for.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vto_pipeline.io.motion.standard_skeleton import NAMES, standard_skeleton
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.kinematics import matrix_vectors, shortest_rotations, vector_matrices

_BENT = (np.sin(np.radians(10.0)), np.sin(np.radians(30.0)))
"""Sine of a hinge's bend from which its plane counts, and from which it counts fully: trackers err by some degrees."""
_HINGES = {"left_knee": (1, 0, 0), "right_knee": (1, 0, 0), "left_elbow": (0, -1, 0), "right_elbow": (0, 1, 0)}
"""About which a joint bends in the T-pose, the way it can."""


def fitted_skeleton(places: Mapping[str, FloatArray]) -> tuple[list[int], FloatArray]:
    """Return parents and offsets of `NAMES`, an ordinary skeleton with the bones that are seen, in their unit.

    Args:
        places: Joint -> places, no NaN, shape (T, 3); shoulders, elbows, wrists, hips, knees and ankles at least.
    """
    parents, usual = standard_skeleton()
    index = {name: k for k, name in enumerate(NAMES)}

    def length(one: str, other: str) -> float:
        return float(np.median(np.linalg.norm(places[one] - places[other], axis=1)))

    def both(one: str, other: str) -> float:
        return 0.5 * sum(length(f"{side}_{one}", f"{side}_{other}") for side in ("left", "right"))

    offsets = usual.copy()
    for side in ("left", "right"):
        for above, below in (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist")):
            k = index[f"{side}_{below}"]
            offsets[k] *= both(above, below) / np.linalg.norm(usual[k])
    leg = both("hip", "knee") / np.linalg.norm(usual[index["left_knee"]])
    hips = length("left_hip", "right_hip") / (2 * usual[index["left_hip"], 0])
    across = 2 * (usual[index["left_clavicle"], 0] + usual[index["left_shoulder"], 0])
    shoulders = length("left_shoulder", "right_shoulder") / across
    tall = float(np.median(np.linalg.norm(_trunk(places), axis=1))) / _usual_trunk(usual, index)
    for name in NAMES:
        own = name.removeprefix("left_").removeprefix("right_")
        k = index[name]
        if own == "hip":
            offsets[k] *= (hips, tall, tall)
        elif own in ("clavicle", "shoulder"):
            offsets[k] *= (shoulders, tall, tall)
        elif own in ("spine", "spine_2", "chest", "neck", "head"):
            offsets[k] *= tall
        elif own == "toe":
            offsets[k] *= leg
    return parents, offsets


def turns_of(places: Mapping[str, FloatArray], offsets: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return world rotations of `NAMES`, shape (T, J, 3, 3), and the places of the root, shape (T, 3).

    Args:
        places: As for `fitted_skeleton`; toes, ears and nose are used where they are.
        offsets: Of `fitted_skeleton`.
    """
    index = {name: k for k, name in enumerate(NAMES)}
    up = _trunk(places)
    world = np.empty((len(up), len(NAMES), 3, 3))
    pelvis = _frame(places["left_hip"] - places["right_hip"], up)
    chest = _frame(places["left_shoulder"] - places["right_shoulder"], up)
    way = matrix_vectors(chest @ np.swapaxes(pelvis, -1, -2))
    for name, share in (("pelvis", 0.0), ("spine", 1 / 3), ("spine_2", 2 / 3), ("chest", 1.0)):
        world[:, index[name]] = vector_matrices(share * way) @ pelvis
    for name in ("neck", "head", "left_clavicle", "right_clavicle"):
        world[:, index[name]] = chest
    if {"left_ear", "right_ear", "nose"} <= set(places):
        across = places["left_ear"] - places["right_ear"]
        ahead = places["nose"] - 0.5 * (places["left_ear"] + places["right_ear"])
        world[:, index["head"]] = _frame(across, np.cross(ahead, across))
    for side in ("left", "right"):
        for base, above, hinge, below in (("pelvis", "hip", "knee", "ankle"), ("chest", "shoulder", "elbow", "wrist")):
            above, hinge, below = f"{side}_{above}", f"{side}_{hinge}", f"{side}_{below}"
            upper = places[hinge] - places[above]
            lower = places[below] - places[hinge]
            carried = world[:, index[base]]
            thigh = shortest_rotations(carried @ offsets[index[hinge]], upper) @ carried
            thigh = _turned_to_hinge(thigh, upper, lower, np.array(_HINGES[hinge], dtype=float))
            world[:, index[above]] = thigh
            world[:, index[hinge]] = shortest_rotations(thigh @ offsets[index[below]], lower) @ thigh
            world[:, index[below]] = world[:, index[hinge]]
        foot, shin = index[f"{side}_toe"], world[:, index[f"{side}_ankle"]]
        if f"{side}_toe" in places:
            ahead = places[f"{side}_toe"] - places[f"{side}_ankle"]
            world[:, index[f"{side}_ankle"]] = shortest_rotations(shin @ offsets[foot], ahead) @ shin
        world[:, foot] = world[:, index[f"{side}_ankle"]]
    hips = 0.5 * (offsets[index["left_hip"]] + offsets[index["right_hip"]])
    root = 0.5 * (places["left_hip"] + places["right_hip"]) - pelvis @ hips
    return world, root


def _turned_to_hinge(bone: FloatArray, upper: FloatArray, lower: FloatArray, hinge: FloatArray) -> FloatArray:
    """Return rotations of a bone after turning about it, so that its hinge bends in the plane of both bones."""
    along = upper / np.linalg.norm(upper, axis=1, keepdims=True)
    bend = np.cross(along, lower / np.linalg.norm(lower, axis=1, keepdims=True))
    sine = np.linalg.norm(bend, axis=1)
    low, high = _BENT
    share = np.clip((sine - low) / (high - low), 0.0, 1.0)
    usual = bone @ hinge
    usual -= along * (usual * along).sum(axis=1, keepdims=True)
    angle = np.arctan2((np.cross(usual, bend) * along).sum(axis=1), (usual * bend).sum(axis=1))
    return vector_matrices((share * share * (3 - 2 * share) * angle)[:, None] * along) @ bone


def _trunk(places: Mapping[str, FloatArray]) -> FloatArray:
    """From the middle of the hips to that of the shoulders, shape (T, 3)."""
    tops, hips = (sum(places[f"{side}_{joint}"] for side in ("left", "right")) for joint in ("shoulder", "hip"))
    return 0.5 * (np.asarray(tops) - np.asarray(hips))


def _usual_trunk(usual: FloatArray, index: Mapping[str, int]) -> float:
    """The same of the ordinary skeleton."""
    above = sum(usual[index[name]] for name in ("spine", "spine_2", "chest", "left_clavicle", "left_shoulder"))
    return float(np.asarray(above)[1] - usual[index["left_hip"], 1])


def _frame(left: FloatArray, up: FloatArray) -> FloatArray:
    """Return rotations whose x is to the left, and whose y is as near to up as that allows, shape (T, 3, 3)."""
    x = left / np.linalg.norm(left, axis=1, keepdims=True)
    y = up - x * (up * x).sum(axis=1, keepdims=True)
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    return np.stack([x, y, np.cross(x, y)], axis=-1)
