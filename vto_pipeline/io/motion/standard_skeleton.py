"""An ordinary skeleton in the T-pose, for poses that come without one."""

from __future__ import annotations

import numpy as np

from vto_pipeline.model.arrays import FloatArray

_HALF = {
    "pelvis": ("", (0.0, 0.0, 0.0)),
    "hip": ("pelvis", (0.09, -0.04, 0.01)),
    "spine": ("pelvis", (0.0, 0.12, -0.01)),
    "knee": ("hip", (0.01, -0.41, 0.0)),
    "spine_2": ("spine", (0.0, 0.13, 0.0)),
    "ankle": ("knee", (0.0, -0.39, -0.02)),
    "chest": ("spine_2", (0.0, 0.06, 0.0)),
    "toe": ("ankle", (0.01, -0.06, 0.12)),
    "neck": ("chest", (0.0, 0.21, 0.0)),
    "clavicle": ("chest", (0.04, 0.15, 0.01)),
    "head": ("neck", (0.0, 0.09, 0.03)),
    "shoulder": ("clavicle", (0.14, 0.0, -0.02)),
    "elbow": ("shoulder", (0.29, 0.0, 0.0)),
    "wrist": ("elbow", (0.26, 0.0, 0.0)),
}
"""Left or central joint -> parent, place from there [m]; rounded means of women and men of 1.7 m."""

_CENTRAL = ("pelvis", "spine", "spine_2", "chest", "neck", "head")


def _order() -> list[str]:
    names: list[str] = []
    for name in _HALF:
        names += [name] if name in _CENTRAL else [f"left_{name}", f"right_{name}"]
    return names


NAMES = tuple(_order())
"""In the order of the SMPL family: pelvis, hips, spine, knees ..."""


def standard_skeleton() -> tuple[list[int], FloatArray]:
    """Return the parents of `NAMES`, and their places from them [m], shape (22, 3)."""
    parents, offsets = [], []
    for name in NAMES:
        side, _, rest = name.partition("_")
        own = rest if side in ("left", "right") else name
        above, place = _HALF[own]
        parent = above if above in _CENTRAL or not above else f"{side}_{above}"
        parents.append(NAMES.index(parent) if parent else -1)
        offsets.append(np.array(place) * (-1.0 if side == "right" else 1.0, 1.0, 1.0))
    return parents, np.array(offsets)
