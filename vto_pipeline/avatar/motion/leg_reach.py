"""Legs that reach for given ankles: two bones in closed form, and a root low enough for both."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import convolve1d, maximum_filter1d

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.kinematics import vector_matrices


def two_bones(
    hip: FloatArray,
    ankle: FloatArray,
    thigh: FloatArray,
    shank: FloatArray,
    hinge: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the rotations that thigh and shank make so that the shank ends at the ankle, shapes (T, 3, 3).

    The knee bends about the hinge. What is farther than both bones is reached for, straight.

    Args:
        hip: Where the thigh begins [m], shape (T, 3).
        ankle: Where the shank is to end [m], shape (T, 3).
        thigh: From hip to knee, as they are [m], shape (T, 3).
        shank: From knee to ankle, as they are [m], shape (T, 3).
        hinge: About which the shank turns back from the thigh, unit, shape (T, 3).
    """
    first, second = (np.linalg.norm(bone, axis=1, keepdims=True) for bone in (thigh, shank))
    u, w = thigh / first, shank / second
    way = ankle - hip
    distance = np.linalg.norm(way, axis=1, keepdims=True)
    along = way / np.maximum(distance, 1e-12)
    across = _across(hinge, along)
    distance = np.clip(distance, abs(first - second) + 1e-9, first + second)
    cosine = np.clip((first**2 + distance**2 - second**2) / (2 * first * distance), -1.0, 1.0)
    new_u = np.einsum("tab,tb->ta", vector_matrices(-np.arccos(cosine) * across), along)
    new_w = (distance * along - first * new_u) / second
    return (
        _frame(new_u, across) @ np.swapaxes(_frame(u, _across(hinge, u)), -1, -2),
        _frame(new_w, across) @ np.swapaxes(_frame(w, _across(hinge, w)), -1, -2),
    )


def _across(normal: FloatArray, along: FloatArray) -> FloatArray:
    rest = normal - (normal * along).sum(axis=1, keepdims=True) * along
    unit: FloatArray = rest / np.maximum(np.linalg.norm(rest, axis=1, keepdims=True), 1e-12)
    return unit


def _frame(along: FloatArray, across: FloatArray) -> FloatArray:
    return np.stack([along, across, np.cross(along, across)], axis=-1)


def lowering(need: FloatArray, reach: int) -> FloatArray:
    """Return a smooth curve that lies nowhere below the given one, shape (T,).

    A maximum over a window, then a mean over the same window weighted by a raised cosine.

    Args:
        need: At least 0, shape (T,).
        reach: Half the window, in frames.
    """
    if reach < 1 or not need.any():
        return need
    weights = np.hanning(2 * reach + 3)[1:-1]
    most = maximum_filter1d(need, 2 * reach + 1, mode="nearest")
    smooth: FloatArray = convolve1d(most, weights / weights.sum(), mode="nearest")
    return smooth
