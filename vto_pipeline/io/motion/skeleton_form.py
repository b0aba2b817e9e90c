"""Joints of a person found from the form of a skeleton alone, where names say nothing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vto_pipeline.model.arrays import FloatArray

_LEVEL = 0.5
"""A bone that rises or falls less than this share of its length belongs to the foot."""

_SHORT = 0.7
"""Of the arm's longest bone: what is shorter at its end belongs to the hand; forearms are nine tenths of upper arms."""


def ancestors(parents: Sequence[int], joint: int) -> list[int]:
    """Return a joint and all above it, from the joint to the root."""
    found = []
    while joint >= 0:
        found.append(joint)
        joint = int(parents[joint])
    return found


def lowest_common(parents: Sequence[int], first: int, second: int) -> int:
    """Return the lowest joint that both hang on, -1 if there is none."""
    above = set(ancestors(parents, second))
    return next((joint for joint in ancestors(parents, first) if joint in above), -1)


def joints_by_form(parents: Sequence[int], places: FloatArray) -> dict[str, int]:
    """Find legs, arms and head of a person who stands at rest, +Y or +Z up, with the feet pointing ahead.

    Legs end in the lowest tips on either side, arms in the tips farthest apart, the head in the highest tip.

    Args:
        parents: Index of each joint's parent, -1 for a root.
        places: At rest, shape (J, 3).

    Returns:
        Our joint -> index there; empty where no such limbs are found.
    """
    extent = np.ptp(places, axis=0)
    up = 1 if extent[1] >= extent[2] else 2
    side, ahead = sorted({0, 1, 2} - {up}, key=lambda axis: -extent[axis])
    tips = [j for j in range(len(parents)) if j not in set(parents)]
    middle = places[:, side].min() + extent[side] / 2
    halves = [[j for j in tips if places[j, side] > middle], [j for j in tips if places[j, side] < middle]]
    if not all(halves) or extent[up] == 0.0:
        return {}
    feet = [min(some, key=lambda j: places[j, up]) for some in halves]
    if _left_sign(parents, places, feet, up, side, ahead) < 0:
        feet, halves = feet[::-1], halves[::-1]
    found: dict[str, int] = {}
    fork = lowest_common(parents, *feet)
    for half, foot in zip(("left", "right"), feet, strict=True):
        leg = ancestors(parents, foot)
        leg = leg[: leg.index(fork)][::-1] if fork in leg else []
        found |= _limb(leg, places, up, half, ("hip", "knee", "ankle"))
    hands = [max((j for j in some if j not in feet), key=lambda j: abs(places[j, side]), default=-1) for some in halves]
    fork = lowest_common(parents, *hands) if min(hands) >= 0 else -1
    if fork >= 0:
        for half, hand in zip(("left", "right"), hands, strict=True):
            arm = ancestors(parents, hand)
            found |= _limb(arm[: arm.index(fork)][::-1], places, None, half, ("shoulder", "elbow", "wrist"))
        top = max(tips, key=lambda j: places[j, up])
        if fork in ancestors(parents, top) and top not in hands:
            found["head"] = int(parents[top]) if parents[top] != fork else top
    return found


def _left_sign(
    parents: Sequence[int], places: FloatArray, feet: Sequence[int], up: int, side: int, ahead: int
) -> float:
    """Sign of the body's left along the axis of its breadth, from where the feet point."""
    toes = sum(places[foot, ahead] - places[parents[foot], ahead] for foot in feet if parents[foot] >= 0)
    forward = np.zeros(3)
    forward[ahead] = (1.0 if up == 1 else -1.0) if toes == 0.0 else np.sign(toes)
    return float(np.cross(np.eye(3)[up], forward)[side])


def _limb(chain: list[int], places: FloatArray, up: int | None, half: str, names: Sequence[str]) -> dict[str, int]:
    """Three joints of a limb: where it begins, the last before hand or foot, and the one nearest the middle."""
    chain = [j for k, j in enumerate(chain) if k == 0 or np.linalg.norm(places[j] - places[chain[k - 1]]) > 0]
    if up is not None:  # cut the foot off: its bones are level
        while len(chain) > 3 and abs(places[chain[-1], up] - places[chain[-2], up]) < _LEVEL * np.linalg.norm(
            places[chain[-1]] - places[chain[-2]]
        ):
            chain = chain[:-1]
    else:  # cut the hand off: its bones are short
        bones = np.linalg.norm(np.diff(places[chain], axis=0), axis=1)
        while len(chain) > 3 and bones[len(chain) - 2] < _SHORT * bones.max():
            chain = chain[:-1]
    if len(chain) < 3:
        return {}
    lengths = np.linalg.norm(np.diff(places[chain], axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    first = 0
    if up is None and lengths[0] < 0.35 * along[-1] and len(chain) > 3:
        first = 1  # the bone from the neck to the shoulder
    middle = first + 1 + int(np.argmin(abs(along[first + 1 : -1] - (along[first] + along[-1]) / 2)))
    return {f"{half}_{name}": chain[k] for name, k in zip(names, (first, middle, len(chain) - 1), strict=True)}
