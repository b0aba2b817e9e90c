"""How far a person's joints turn."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.io.documents import load_yaml
from vto_pipeline.model.arrays import FloatArray

_NOTICED_RAD = np.deg2rad(1.0)


@cache
def _table() -> dict[str, Any]:
    table: dict[str, Any] = load_yaml(Path(__file__).with_name("joint_limits.yaml")).data
    return table


def limit_turns(poses: FloatArray, names: tuple[str, ...]) -> tuple[FloatArray, dict[str, float]]:
    """Return poses within the limits of `joint_limits.yaml`.

    Args:
        poses: Rotation vectors relative to the bind pose, in the parents' frames [rad], shape (T, J, 3).
        names: Of the joints.

    Returns:
        Poses, and joint -> share of frames that were changed by more than a degree, where there are any.
    """
    limited = poses.copy()
    changed: dict[str, float] = {}
    for j, name in enumerate(names):
        side, _, kind = name.rpartition("_")
        entry = _table().get(kind)
        if entry is None:
            continue
        if "angle" in entry:
            size = np.linalg.norm(poses[:, j], axis=1, keepdims=True)
            limited[:, j] *= np.minimum(1.0, np.deg2rad(entry["angle"]) / np.maximum(size, 1e-12))
        else:
            low, high = np.deg2rad([entry[axis] for axis in "xyz"]).T
            if side == "right":
                low[1:], high[1:] = -high[1:].copy(), -low[1:].copy()
            limited[:, j] = np.clip(poses[:, j], low, high)
        share = float((np.linalg.norm(limited[:, j] - poses[:, j], axis=1) > _NOTICED_RAD).mean())
        if share > 0:
            changed[name] = share
    return limited, changed
