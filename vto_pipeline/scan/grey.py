"""One channel out of three: the grey in which a print shows best.

A photo's usual grey is what the eye finds bright. Prints of one brightness in several colours are all but lost in it,
and where red and green are clipped by too much light, so is what they printed. Such colours are often told apart best
by one channel less another: compression leaves most of its noise in brightness.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.model.arrays import ByteArray, FloatArray

USUAL = (0.299, 0.587, 0.114)
"""Shares of red, green and blue in what the eye finds bright (ITU-R BT.601)."""
PRINT_PX = 8.0
"""What changes over a longer distance is shading [px]."""
FAINT = 5.0
"""Weaker detail counts less; what is stronger counts as much, or a few outlines would outweigh a print [levels]."""
CLIPPED = 254
"""A channel at this level or above tells nothing, nor do the places beside it."""
STEP = 0.1
"""Shares are tried in steps of this."""
CLEARLY = 1.2
"""What is gained by other shares than the usual ones, when the usual ones do well."""
_STEPS = round(1.0 / STEP)
LEAST = 1000
"""Fewer places tell nothing."""
BLUR_PX = 1.0
"""Noise is averaged over this distance, as what looks for features does [px]."""
QUARTER, EVERY = 25.0, 3
"""What is about the quietest of a photo's pixels is noise, what is about the loudest is a print [%]; those of so many
rows and columns are looked at."""
ROUNDED = 1.0 / 12.0
"""Variance of what rounding to whole levels adds [levels²]."""


def best_shares(shown: Iterable[tuple[ByteArray, FloatArray]], least_gain: float = CLEARLY) -> tuple[FloatArray, float]:
    """Return the shares of red, green and blue, (3,), that show a print best against noise, and how many times better
    than the usual ones; those where the gain is small.

    Noise is taken to be as strong in each channel, and independent.

    Args:
        shown: Photos (H, W, 3), and where each shows the object [px], shape (N, 2).
        least_gain: Other shares than the usual ones must show it so many times better.
    """
    import cv2

    moment, count = np.zeros((3, 3)), 0
    for picture, pixels in shown:
        column, row = np.rint(pixels).astype(int).T
        inside = (column >= 0) & (row >= 0) & (column < picture.shape[1]) & (row < picture.shape[0])
        there = row[inside], column[inside]
        lost: Any = cv2.dilate((picture >= CLIPPED).astype(np.uint8), np.ones((5, 5), np.uint8))
        level, told = picture.astype(np.float32), (lost == 0).astype(np.float32)
        about, weight = (cv2.GaussianBlur(part, (0, 0), PRINT_PX) for part in (level * told, told))
        detail = ((level - about / np.maximum(weight, np.finfo(np.float32).tiny)) * told)[there]
        detail /= np.sqrt(np.square(detail).sum(axis=1, keepdims=True) + FAINT**2)
        moment += detail.T.astype(float) @ detail
        count += len(detail)
    usual = np.array(USUAL)
    steps = np.arange(_STEPS + 1)
    tried = STEP * np.array([c for c in product(steps, repeat=3) if sum(c) == steps[-1]])
    signal = np.einsum("nc,cd,nd->n", tried, moment, tried) / np.square(tried).sum(axis=1)
    before = usual @ moment @ usual / (usual @ usual)
    best = int(np.argmax(signal))
    gain = float(np.sqrt(signal[best] / before)) if before > 0.0 else 1.0
    if count < LEAST or gain < least_gain:
        return usual, 1.0
    return tried[best], gain


def best_differences(pictures: Iterable[ByteArray]) -> tuple[FloatArray, float]:
    """Return the shares of red, green and blue, (3,), some of which may be negative, that show what there is to see
    best against the noise that there is, and how many times better than the usual ones; those where the gain is small.

    The largest ratio of signal to noise of all sums of channels (Green et al. 1988, the transform of minimum noise
    fractions), both between the scales of features and of shading.

    Args:
        pictures: Photos (H, W, 3).
    """
    import cv2

    moment, noise, count = np.zeros((3, 3)), np.zeros((3, 3)), 0
    for picture in pictures:
        level = picture.astype(np.float32)
        about = cv2.GaussianBlur(level, (0, 0), PRINT_PX)
        power = cv2.GaussianBlur(np.square(level - about).sum(axis=2), (0, 0), PRINT_PX)
        lost: Any = cv2.dilate((picture >= CLIPPED).astype(np.uint8), np.ones((5, 5), np.uint8))
        chosen = np.zeros(power.shape, dtype=bool)
        chosen[::EVERY, ::EVERY] = True
        chosen &= ~lost.any(axis=2)
        if not chosen.any():
            continue
        detail, loud = (cv2.GaussianBlur(level, (0, 0), BLUR_PX) - about)[chosen], power[chosen]
        quiet = detail[loud <= np.percentile(loud, QUARTER)].astype(float)
        noise += quiet.T @ quiet / len(quiet)
        shown = detail[loud >= np.percentile(loud, 100.0 - QUARTER)].astype(float)
        shown /= np.sqrt(np.square(shown).sum(axis=1, keepdims=True) + FAINT**2)
        moment += shown.T @ shown / len(shown)
        count += 1
    usual = np.array(USUAL)
    steps = range(-_STEPS, _STEPS + 1)
    whole = [c for c in product(steps, repeat=3) if sum(map(abs, c)) == _STEPS and (sum(c), c) > (0, (0, 0, 0))]
    tried = np.vstack([usual, STEP * np.array(whole)])
    signal, against = (np.einsum("nc,cd,nd->n", tried, part, tried) for part in (moment, noise))
    ratio = signal / (against + max(count, 1) * ROUNDED)
    best = int(np.argmax(ratio))
    gain = float(np.sqrt(ratio[best] / ratio[0])) if ratio[0] > 0.0 else 1.0
    return (tried[best], gain) if gain >= CLEARLY else (usual, 1.0)


def in_grey(picture: ByteArray, shares: FloatArray) -> NDArray[np.uint8]:
    """Return a photo (H, W, 3) in grey, shape (H, W). Where shares are negative, black is as bright as leaves room."""
    import cv2

    if tuple(shares) == USUAL:
        usual: Any = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
        return np.asarray(usual, dtype=np.uint8)
    black = np.float32(-255.0 * np.minimum(shares, 0.0).sum())
    level = picture.astype(np.float32) @ shares.astype(np.float32) + black
    return np.rint(level).clip(0, 255).astype(np.uint8)
