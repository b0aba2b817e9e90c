"""Where the points of a panel are in space before they are simulated.

A panel that was worn is known at some of its points. Between and beside these its places are the affine map that fits
the nearest ones best, the nearer the more (moving least squares; Lancaster & Salkauskas 1981). A triangulation of the
points would have slivers along straight rims, whose corners lie far apart.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.pattern import Placement

_NEAREST = 9
_TOUCHING = 0.02  # of the farthest of these: at a known point, its own place counts nearly alone
_STIFF = 1e-3  # against a slope, where points on one line leave it open: then it is that of the panel as it stands


def as_it_stands(place: Placement, points: FloatArray) -> FloatArray:
    """Return where points of a flat panel stand, shapes (N, 2) and (N, 3) [m]."""
    return np.asarray(points @ place.rotation[:, :2].T + place.translation)


def as_worn(place: Placement, points: FloatArray) -> FloatArray:
    """Return where points of a panel that was worn were, shapes (N, 2) and (N, 3) [m]."""
    assert place.worn_at is not None
    known = place.worn_at[:, :2]
    off = place.worn_at[:, 2:] - as_it_stands(place, known)
    away, near = cKDTree(known).query(points, min(_NEAREST, len(known)))
    away, near = away.reshape(len(points), -1), near.reshape(len(points), -1)
    reach = np.maximum(away[:, -1:], 1e-12)
    weight = 1.0 / ((away / reach) ** 2 + _TOUCHING**2) ** 2
    to = (known[near] - points[:, None]) / reach[:, :, None]
    terms = np.concatenate([np.ones_like(to[:, :, :1]), to], axis=2)
    weighted = np.swapaxes(weight[:, :, None] * terms, 1, 2)
    normal = weighted @ terms
    normal[:, [1, 2], [1, 2]] += _STIFF * normal[:, 1:, 1:].trace(axis1=1, axis2=2)[:, None] + _STIFF
    return as_it_stands(place, points) + np.linalg.solve(normal, weighted @ off[near])[:, 0]
