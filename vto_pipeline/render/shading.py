"""Shading of a picture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates

from vto_pipeline.model.arrays import FloatArray

_LIGHTS = (((-0.45, 0.55, 0.70), 0.64), ((0.75, 0.15, 0.65), 0.22))
"""From where each light comes, in the viewer's frame (right, up, towards the viewer), and how bright it is."""

KEY_LIGHT = np.asarray(_LIGHTS[0][0]) / np.linalg.norm(_LIGHTS[0][0])
"""From where the brightest light comes, a unit vector in the viewer's frame."""

_AMBIENT = 0.40
_FAR_SIDE = 0.70  # brightness of the inside of a garment against its outside
_DEEP = 0.03  # [m] behind the surroundings, where a fold is darkest
_DARKEST = 0.55
_ENOUGH = 800  # rows of depth that show crevices


def matt_brightness(normal: FloatArray, far_side: NDArray[np.bool_], lit: FloatArray) -> FloatArray:
    """Return the brightness of matt surfaces, 0 to 1, shape (N,).

    Args:
        normal: In the viewer's frame, any length, shape (N, 3).
        far_side: Seen from behind, shape (N,): lit with the normal turned, and darker.
        lit: How much of the key light reaches it, 0 to 1, shape (N,).
    """
    unit = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    unit = np.where(far_side[:, None], -unit, unit)
    total = _AMBIENT * (0.75 + 0.25 * unit[:, 1])
    for k, (direction, brightness) in enumerate(_LIGHTS):
        towards = np.asarray(direction) / np.linalg.norm(direction)
        total = total + brightness * np.maximum(unit @ towards, 0.0) * (lit if k == 0 else 1.0)
    return np.where(far_side, _FAR_SIDE, 1.0) * np.minimum(total, 1.0)


def crevices(depth: FloatArray) -> FloatArray:
    """Return a brightness factor that darkens crevices such as folds, shape (H, W).

    Unsharp masking of the depth buffer (Luft, Colditz, Deussen 2006).

    Args:
        depth: [m], infinite where nothing is seen, shape (H, W).
    """
    seen = np.isfinite(depth)
    filled = np.where(seen, depth, 0.0)
    step = max(1, len(depth) // _ENOUGH)  # what is smooth over a hundredth of the picture needs no more places
    sigma = 0.01 * len(depth) / step
    inside = gaussian_filter(seen[::step, ::step].astype(np.float64), sigma, truncate=2.0)
    around = gaussian_filter(filled[::step, ::step], sigma, truncate=2.0) / np.maximum(inside, 1e-6)
    if step > 1:
        rows, columns = (np.arange(count) / step for count in depth.shape)
        around = map_coordinates(around, np.meshgrid(rows, columns, indexing="ij"), order=1, mode="nearest")
    behind = np.where(seen, depth, around) - around
    return 1.0 - (1.0 - _DARKEST) * np.clip(behind / _DEEP, 0.0, 1.0)
