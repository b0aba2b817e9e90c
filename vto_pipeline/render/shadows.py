"""Soft shadows: what a light does not see lies in its shadow (shadow maps; Williams 1978).

Each place is compared with all of the map about it within the light's breadth (percentage closer filtering; Reeves,
Salesin & Cook 1987), so that edges are soft, and no stairs show.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.rasterise import rasterise

_MAP = 1024  # texels a side
_ASIDE = 3  # texels to each side that are compared, twice the distance of a pixel's neighbours
_CLEAR, _STEEP = 1.5, 24.0  # texels: how far behind what the light sees a place is lit all the same, and most of it


class ShadowMap(NamedTuple):
    """What a distant light sees.

    Args:
        towards: Where the light comes from, a unit vector, shape (3,).
        axes: Right, up and away of the light, as rows, shape (3, 3).
        shift: Where the map begins, along these axes [m], shape (3,).
        texels: A metre has so many.
        depth: Of what the light sees [texels], shape (N, N); of shape (0, 0) where nothing throws a shadow.
    """

    towards: FloatArray
    axes: FloatArray
    shift: FloatArray
    texels: float
    depth: FloatArray


def no_shadows() -> ShadowMap:
    """Return the map of a light that nothing stands before."""
    return ShadowMap(np.zeros(3), np.eye(3), np.zeros(3), 1.0, np.empty((0, 0)))


def shadow_map(corners: FloatArray, towards: FloatArray) -> ShadowMap:
    """Return what a light sees.

    Args:
        corners: Of the triangles that throw shadows [m], shape (F, 3, 3).
        towards: Where the light comes from, a unit vector, shape (3,).
    """
    right = np.cross([0.0, 1.0, 0.0], towards)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(towards, right), -towards])  # depth grows away from the light
    seen = corners @ axes.T
    low, high = seen.reshape(-1, 3).min(axis=0), seen.reshape(-1, 3).max(axis=0)
    texels = (_MAP - 2 * _ASIDE - 1) / max(float((high - low)[:2].max()), 1e-9)
    shift = low - _ASIDE / texels
    return ShadowMap(towards, axes, shift, texels, rasterise((seen - shift) * texels, _MAP, _MAP)[2])


@njit(cache=True, error_model="numpy")
def lit_share(shadow, x, y, z, normal_x, normal_y, normal_z):  # type: ignore[no-untyped-def]  # typed by Numba
    """Return how much of the light a place sees, 0 to 1.

    Args:
        shadow: What the light sees.
        x, y, z: The place, in the frame of the triangles [m].
        normal_x, normal_y, normal_z: Of the surface there, of any length and sign.
    """
    towards, axes, shift, depth = shadow.towards, shadow.axes, shadow.shift, shadow.depth
    if len(depth) == 0:
        return 1.0
    length = np.sqrt(normal_x * normal_x + normal_y * normal_y + normal_z * normal_z)
    across = abs(normal_x * towards[0] + normal_y * towards[1] + normal_z * towards[2]) / max(length, 1e-12)
    slope = np.sqrt(1.0 - min(across, 1.0) ** 2) / max(across, 1e-6)
    clear = min(_CLEAR + (_ASIDE + 0.5) * slope, _STEEP)  # so a tilted surface does not shade itself
    column = int(np.round((x * axes[0, 0] + y * axes[0, 1] + z * axes[0, 2] - shift[0]) * shadow.texels))
    row = int(np.round((x * axes[1, 0] + y * axes[1, 1] + z * axes[1, 2] - shift[1]) * shadow.texels))
    behind = (x * axes[2, 0] + y * axes[2, 1] + z * axes[2, 2] - shift[2]) * shadow.texels - clear
    seen = 0
    for i in range(row - _ASIDE, row + _ASIDE + 1):
        for j in range(column - _ASIDE, column + _ASIDE + 1):
            inside = 0 <= i < depth.shape[0] and 0 <= j < depth.shape[1]
            if not inside or behind <= depth[i, j]:
                seen += 1
    return seen / (2 * _ASIDE + 1) ** 2
