"""Evidence from how colours vary from place to place: a print has several side by side, a form and its shadows one."""

from __future__ import annotations

from math import ceil

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, diags, identity

from vto_pipeline.garment.subtraction.color_model import (
    BINS,
    MOST_MIXED,
    cielab,
    evidence_of_cells,
)
from vto_pipeline.geometry.topology import edges
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.mesh import TriangleMesh

RANGE = (0.1, 32.0)
"""Variety that is told apart, in CIELAB: below is a sensor's noise."""
REACH = 0.012
"""Root mean square distance of the places whose colours count [m]: some flowers of a print."""
MOST_ROUNDS = 150
"""Of averaging over neighbours: on very fine surfaces the reach is less."""


def variety_evidence(
    variety: FloatArray, pure: NDArray[np.bool_], mixed: NDArray[np.bool_], most_mixed: float = MOST_MIXED
) -> FloatArray:
    """Return log p(variety | the pure material) - log p(variety | the other), shape (V,), as `color_evidence` does.

    Args:
        variety: How far colours vary about each place, shape (V,).
        pure, mixed, most_mixed: As in `color_evidence`.
    """
    low, high = np.log(RANGE)
    scaled = (np.log(np.clip(variety, *RANGE)) - low) / (high - low)
    cell = (np.minimum((BINS * scaled).astype(int), BINS - 1),)
    return evidence_of_cells(cell, pure, mixed, BINS, most_mixed)


def picture_variety(picture: ByteArray, among: NDArray[np.bool_], side: int) -> FloatArray:
    """Return how far colours vary about each pixel, shape (H, W): the standard deviation of CIELAB's a* and b*.

    Lightness has no say: folds and shadows change it on any material.

    Args:
        picture: sRGB, shape (H, W, 3).
        among: Pixels that count, shape (H, W); the others are of another material.
        side: Of the square about each pixel [px].
    """
    import cv2

    weight = among.astype(np.float32)
    chroma = np.zeros((*among.shape, 2), np.float32)
    chroma[among] = cielab(picture[among])[:, 1:]
    count = np.maximum(cv2.blur(weight, (side, side)), 1e-6)[..., None]
    mean, square = (cv2.blur(x, (side, side)) / count for x in (chroma, chroma**2))
    return _deviation(mean, square)


def surface_variety(surface: TriangleMesh, material: NDArray[np.bool_]) -> FloatArray:
    """Return how far colours vary about each vertex among those of its material, shape (V,), as `picture_variety`.

    Args:
        surface: With colours.
        material: Which of two each vertex seems to be of, shape (V,); so a hem does not make the form beside it vary.
    """
    assert surface.colors is not None
    pair, count = edges(surface), len(surface.vertices)
    pair = pair[material[pair[:, 0]] == material[pair[:, 1]]]
    length = np.linalg.norm(surface.vertices[pair[:, 0]] - surface.vertices[pair[:, 1]], axis=1)
    joined = coo_matrix((np.ones(len(pair), np.float32), pair.T), (count, count)).tocsr()
    joined = joined + joined.T + identity(count, dtype=np.float32, format="csr")
    mean_of = diags(1.0 / np.asarray(joined.sum(axis=1)).ravel()).astype(np.float32) @ joined
    chroma = cielab(surface.colors)[:, 1:].astype(np.float32)
    moments = np.column_stack([chroma, chroma**2])
    steps = (REACH / length.mean()) ** 2 if len(length) > 0 else 0.0  # a random walk of n steps goes as far as √n
    for _ in range(min(ceil(steps), MOST_ROUNDS)):
        moments = mean_of @ moments
    return _deviation(moments[:, :2], moments[:, 2:])


def _deviation(mean: NDArray[np.floating], square: NDArray[np.floating]) -> FloatArray:
    """Return the standard deviation of several values together, by the means of them and of their squares (..., K)."""
    return np.asarray(np.sqrt(np.maximum(square - mean**2, 0.0).sum(axis=-1)), dtype=np.float64)
