"""How brightly each photo was exposed, from what the photos show of the same points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.model.arrays import FloatArray

DARKEST, BRIGHTEST = 8.0, 247.0
"""Darker and brighter pixels tell nothing: they are noise, or clipped."""
BLUR_PX = 2.0
"""A point's brightness is the mean over this many pixels around it, so that noise and small errors do not count."""
ROUNDS = 20
"""Of medians over points and over photos in turn."""


def exposures(pictures: Sequence[NDArray[np.uint8]], pixels: FloatArray, seen: NDArray[np.bool_]) -> FloatArray:
    """Return how much brighter each photo shows the same things than the photos do on the whole, shape (C,).

    A camera that meters each photo anew scales all of its light by one factor, which is a factor in the picture's
    gamma, too. It is fitted by medians, so that points that something else hides in some photo do no harm.

    Args:
        pictures: Grey photos, C of shape (H, W).
        pixels: Where each photo shows each point [px], shape (C, N, 2).
        seen: Which points each photo may show, shape (C, N).
    """
    import cv2

    log = np.full(seen.shape, np.nan)
    for index, (picture, place, shown) in enumerate(zip(pictures, pixels, seen, strict=True)):
        blurred = cv2.GaussianBlur(picture, (0, 0), BLUR_PX)
        which = np.flatnonzero(shown)
        column, row = np.rint(place[which]).astype(int).T
        inside = (column >= 0) & (row >= 0) & (column < picture.shape[1]) & (row < picture.shape[0])
        value = blurred[row[inside], column[inside]].astype(float)
        usable = (value > DARKEST) & (value < BRIGHTEST)
        log[index, which[inside][usable]] = np.log(value[usable])
    return relative_levels(log)


def relative_levels(log: FloatArray) -> FloatArray:
    """Return the factor by which each photo's values exceed those of the photos on the whole, shape (C,).

    Args:
        log: Logarithms of what each photo shows of each point, NaN where it shows nothing, shape (C, N).
    """
    measured = np.isfinite(log)
    log = log[:, measured.sum(axis=0) > 1]
    own = np.zeros(len(log))
    told = np.isfinite(log).any(axis=1)
    for _ in range(ROUNDS if told.any() else 0):
        of_point = np.nanmedian(log - own[:, None], axis=0)
        own[told] = np.nanmedian(log[told] - of_point, axis=1)
        own[told] -= own[told].mean()
    return np.asarray(np.exp(own))
