"""Shading of a picture."""

from __future__ import annotations

import numpy as np
from numba import njit

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.rasterise import rasterise

KEY_LIGHT = np.array([-0.45, 0.55, 0.70]) / np.linalg.norm([-0.45, 0.55, 0.70])
"""From where the brightest light comes, a unit vector in the viewer's frame (right, up, towards the viewer)."""

_FILL_LIGHT = np.array([0.75, 0.15, 0.65]) / np.linalg.norm([0.75, 0.15, 0.65])
_KEY, _FILL, _AMBIENT = 0.64, 0.22, 0.40  # how bright they are, and what comes from everywhere
_FAR_SIDE = 0.70  # brightness of the inside of a garment against its outside
_DEEP = 0.03  # [m] behind the surroundings, where a fold is darkest
_DARKEST = 0.55
_ENOUGH = 800  # rows of depth that show crevices
_REACH = 0.01  # of a picture's height: how far the surroundings reach


@njit(cache=True, error_model="numpy")
def matt_brightness(x, y, z, far_side, lit):  # type: ignore[no-untyped-def]  # typed by Numba
    """Return the brightness of a matt surface, 0 to 1.

    Args:
        x, y, z: Its normal in the viewer's frame, of any length.
        far_side: Seen from behind: lit with the normal turned, and darker.
        lit: How much of the key light reaches it, 0 to 1.
    """
    length = max(np.sqrt(x * x + y * y + z * z), 1e-12)
    if far_side:
        length = -length
    x, y, z = x / length, y / length, z / length
    key = max(x * KEY_LIGHT[0] + y * KEY_LIGHT[1] + z * KEY_LIGHT[2], 0.0)
    fill = max(x * _FILL_LIGHT[0] + y * _FILL_LIGHT[1] + z * _FILL_LIGHT[2], 0.0)
    total = min(_AMBIENT * (0.75 + 0.25 * y) + _KEY * key * lit + _FILL * fill, 1.0)
    return _FAR_SIDE * total if far_side else total


def surroundings(corners: FloatArray, width: int, height: int) -> tuple[FloatArray, int]:
    """Return how deep a picture is about each place, on average.

    Args:
        corners: Of all triangles [px], as of `rasterise`.
        width, height: Of the picture [px].

    Returns:
        The mean depth of what is seen about every n-th pixel, shape (R, C, 1), and n.
    """
    import cv2

    step = max(1, height // _ENOUGH)  # what is smooth over a hundredth of the picture needs no more places
    depth = rasterise(corners / (step, step, 1.0), -(-width // step), -(-height // step))[2]
    seen = np.isfinite(depth)
    sigma = _REACH * height / step
    window = (2 * round(2.0 * sigma) + 1,) * 2  # two sigma to each side
    weight, total = (
        cv2.GaussianBlur(one, window, sigma, borderType=cv2.BORDER_REFLECT)
        for one in (seen.astype(np.float64), np.where(seen, depth, 0.0))
    )
    return (total / np.maximum(weight, 1e-6))[..., None], step


@njit(cache=True, error_model="numpy")
def crevice(behind):  # type: ignore[no-untyped-def]  # typed by Numba
    """Return a factor of brightness that darkens crevices such as folds.

    Unsharp masking of the depth buffer (Luft, Colditz, Deussen 2006).

    Args:
        behind: How far a place lies behind its surroundings [m].
    """
    return 1.0 - (1.0 - _DARKEST) * min(max(behind / _DEEP, 0.0), 1.0)
