"""Alignment of the template's bust points with the scan's, where the tape passes."""

from __future__ import annotations

import numpy as np

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar

_AROUND_M = 0.045
_TIP_M = 0.0005
"""Depth of what counts as the tip: so far behind it a point counts 1/e."""
_OFF_M = 0.015
_CARRIED_M = 0.030
"""How far around a bust point its neighbours are carried along, standard deviation."""


def toward_bust_points(upright: FloatArray, scan: FloatArray, body: Avatar) -> FloatArray:
    """Return the shift [m] that brings the bust points to the scan's tips and their neighbours along, shape (V, 3).

    Args:
        upright: A standing body of our topology, +Y up, facing +Z [m], shape (V, 3).
        scan: Points of the scan in that frame [m], shape (N, 3).
        body: Its landmarks.
    """
    shift = np.zeros_like(upright)
    for side in ("left", "right"):
        at = upright[body.landmarks[f"{side}_bust_point"]]
        near = scan[(np.linalg.norm((scan - at)[:, :2], axis=1) < _AROUND_M) & (np.abs(scan[:, 2] - at[2]) < _OFF_M)]
        if len(near) == 0:
            continue
        weight = np.exp((near[:, 2] - near[:, 2].max()) / _TIP_M)
        move = weight @ near / weight.sum() - at
        move[2] = 0.0
        share = np.exp(-0.5 * (np.linalg.norm(upright - at, axis=1) / _CARRIED_M) ** 2)
        shift += np.outer(share, move)
    return shift
