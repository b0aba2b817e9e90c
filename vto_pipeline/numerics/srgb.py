"""sRGB and linear light, IEC 61966-2-1."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def decode_srgb(colors: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return linear light 0 to 1 of sRGB bytes."""
    curved = colors / 255.0
    return np.where(curved <= 0.04045, curved / 12.92, ((curved + 0.055) / 1.055) ** 2.4)


def srgb_curve(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return sRGB 0 to 1 of linear light 0 to 1."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)


def encode_srgb(linear: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return sRGB bytes of linear light; what is beyond 0 to 1 is clipped, what is no number is black."""
    curved = srgb_curve(np.clip(np.nan_to_num(linear.astype(np.float64)), 0.0, 1.0))
    return np.round(curved * 255).astype(np.uint8)
