"""Shading of a picture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from vto_pipeline.model.arrays import FloatArray

_LIGHTS = (((-0.45, 0.55, 0.70), 0.64), ((0.75, 0.15, 0.65), 0.22))
"""From where each light comes, in the viewer's frame (right, up, towards the viewer), and how bright it is."""

_AMBIENT = 0.40
_FAR_SIDE = 0.70  # brightness of the inside of a garment against its outside
_DEEP = 0.03  # [m] behind the surroundings, where a fold is darkest
_DARKEST = 0.55


def matt_brightness(normal: FloatArray, far_side: NDArray[np.bool_]) -> FloatArray:
    """Return the brightness of matt surfaces, 0 to 1, shape (N,).

    Args:
        normal: In the viewer's frame, any length, shape (N, 3).
        far_side: Seen from behind, shape (N,): lit with the normal turned, and darker.
    """
    unit = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    unit = np.where(far_side[:, None], -unit, unit)
    total = _AMBIENT * (0.75 + 0.25 * unit[:, 1])
    for direction, brightness in _LIGHTS:
        towards = np.asarray(direction) / np.linalg.norm(direction)
        total = total + brightness * np.maximum(unit @ towards, 0.0)
    return np.where(far_side, _FAR_SIDE, 1.0) * np.minimum(total, 1.0)


def crevices(depth: FloatArray) -> FloatArray:
    """Return a brightness factor that darkens crevices such as folds, shape (H, W).

    Unsharp masking of the depth buffer (Luft, Colditz, Deussen 2006).

    Args:
        depth: [m], infinite where nothing is seen, shape (H, W).
    """
    seen = np.isfinite(depth)
    filled = np.where(seen, depth, 0.0)
    sigma = 0.01 * len(depth)
    inside = gaussian_filter(seen.astype(np.float64), sigma, truncate=2.0)
    around = gaussian_filter(filled, sigma, truncate=2.0) / np.maximum(inside, 1e-6)
    behind = np.where(seen, depth, around) - around
    return 1.0 - (1.0 - _DARKEST) * np.clip(behind / _DEEP, 0.0, 1.0)
