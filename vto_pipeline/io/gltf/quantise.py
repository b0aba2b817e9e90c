"""Coordinates in two bytes each (KHR_mesh_quantization)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.model.arrays import FloatArray

_MOST, _MOST_SIGNED = 65_535, 32_767


def quantised_box(vertices: FloatArray) -> tuple[NDArray[np.uint16], FloatArray, float]:
    """Return positions on a lattice in a cube about them.

    They are off by half a step at most: by 0.015 mm where the cube's side is 2 m.

    Args:
        vertices: [m], shape (V, 3).

    Returns:
        Steps from the cube's lowest corner, shape (V, 3); that corner [m], shape (3,); a step [m].
    """
    low = vertices.min(axis=0)
    side = max(float(np.ptp(vertices, axis=0).max()), 1e-9)
    return quantised_share((vertices - low) / side), low, side / _MOST


def quantised_share(values: FloatArray) -> NDArray[np.uint16]:
    """Return values from 0 to 1 in 65535ths."""
    return np.rint(values * _MOST).astype("<u2")


def quantised_signed(values: NDArray[np.floating]) -> NDArray[np.int16]:
    """Return values from -1 to 1 in 32767ths."""
    return np.rint(values * _MOST_SIGNED).astype("<i2")
