"""Sliver triangles: too thin to count as cloth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SLIVER = 0.01
"""Height over longest side under which a triangle is a sliver.

Its corners turn it by a radian when they move by its height, so its stiffness rules the step while it stands for next
to no cloth: it is taken no stiffer than a triangle of this height, and hinges beside it do not bend.
"""


def slenderness(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the height of triangles over their longest side, shape (F,); corners of shape (F, 3, 3)."""
    sides = np.roll(corners, -1, axis=1) - corners
    double_area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    longest_sq = (sides**2).sum(axis=2).max(axis=1)
    return np.divide(double_area, longest_sq, out=np.zeros(len(corners)), where=longest_sq > 0.0)
