"""Collapsed starts, where forces have no direction.

Corners that coincide, or lie on one line, leave springs and Green's strain without a direction and hinges without a
normal: every gradient there is zero, and no method, however exact, would ever move it. A trace of the rest shape
added to such places breaks the tie: from a point a cloth then grows as it was made, instead of at random. A tenth of
it is noise, the same in every run: what is flat to the last bit would else stay in its plane.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.model.arrays import FloatArray, IntArray

_TRACE = 1e-4  # of the rest shape: 1 µm an edge of 10 mm. Stiffness against shear grows with its inverse square
_NOISE = 0.1  # of the length of an edge of that trace
_COLLAPSED = 1e-9  # twice the area over the longest side squared, where a direction drowns in rounding


def expand_collapsed_triangles(
    positions: FloatArray, rest: FloatArray, faces: IntArray, pinned: Sequence[int] = ()
) -> FloatArray:
    """Return the positions, with a trace of the rest shape added at the corners of collapsed triangles.

    Args:
        positions: Where the cloth starts [m], shape (V, 3).
        rest: Its shape without forces [m], shape (V, 3). A triangle without area there is never opened.
        faces: Shape (F, 3).
        pinned: Vertices that stay where they are.
    """
    tied = _collapsed(positions, faces) & ~_collapsed(rest, faces)
    if not tied.any():
        return positions
    chosen = np.setdiff1d(faces[tied], np.asarray(pinned, dtype=np.int64))
    moved = positions.copy()
    edge = np.sqrt(_longest_sq(rest[faces[tied]]).mean())
    noise = _NOISE * edge * np.random.default_rng(0).standard_normal(rest.shape)
    moved[chosen] += _TRACE * (rest - rest[chosen].mean(axis=0) + noise)[chosen]
    return moved


def _collapsed(positions: FloatArray, faces: IntArray) -> NDArray[np.bool_]:
    a, b, c = (positions[faces[:, corner]] for corner in range(3))
    double_area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return np.asarray(double_area <= _COLLAPSED * _longest_sq(positions[faces]))


def _longest_sq(corners: FloatArray) -> FloatArray:
    """Return the square of each triangle's longest side [m²], shape (F,); corners of shape (F, 3, 3)."""
    sides = np.roll(corners, -1, axis=1) - corners
    return np.asarray((sides**2).sum(axis=2).max(axis=1))
