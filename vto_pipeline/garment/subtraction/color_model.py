"""Colour evidence for one of two materials, learnt where the material is certain."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from vto_pipeline.model.arrays import ByteArray, FloatArray, IntArray
from vto_pipeline.numerics.srgb import decode_srgb

BINS = 24
HISTOGRAM_SIGMA = 1.0
"""Standard deviation of the histogram's smoothing [bins]."""
ELSEWHERE, UNEVEN = 0.2, 25.0
"""Such a share of a material lies in other light than what was seen of it: its lightness (CIELAB) has this standard
deviation. A shoulder under lamps is lighter than any other cloth."""
SURPRISE = 0.02
"""Share of each material that may have any colour: dirt, shadow, seams."""
RARE = 0.05
"""Share of a material's own vertices that have unusual colours for it."""
MOST_MIXED = 0.9
"""With more of the pure material than this among the mixed, the two hardly differ in colour."""


def color_evidence(
    colors: ByteArray,
    pure: NDArray[np.bool_],
    mixed: NDArray[np.bool_],
    bins: int = BINS,
    light: float | None = None,
    most_mixed: float = MOST_MIXED,
) -> FloatArray:
    """Return log p(colour | the pure material) - log p(colour | the other) per vertex, shape (V,).

    From smoothed CIELAB histograms. Places of the other material may hold some of the pure one, as close-lying cloth
    passes for mannequin: the share of the pure histogram that the mixed one can hold is taken out of it. Materials of
    much the same colours look so, too, without any mixing. Then too much is taken out, and what is left tells wrongly.

    Args:
        colors: sRGB, shape (V, 3).
        pure: Vertices sure to be of the one material, shape (V,); at least one.
        mixed: Vertices most of which are of the other; at least one.
        bins: Of the histogram, along each axis; more part colours that differ less, and need more vertices.
        light: Standard deviation of the smoothing along lightness [bins], where the two lie in other light; by default
            they lie in the same, which is uneven.
        most_mixed: The mixed hold no larger share of the pure material.
    """
    if light is not None:
        return evidence_of_cells(_cells(colors, bins), pure, mixed, bins, most_mixed, light)
    uneven = UNEVEN / 100.0 * bins
    return evidence_of_cells(_cells(colors, bins), pure, mixed, bins, most_mixed, HISTOGRAM_SIGMA, uneven)


def evidence_of_cells(
    cell: tuple[IntArray, ...],
    pure: NDArray[np.bool_],
    mixed: NDArray[np.bool_],
    bins: int,
    most_mixed: float,
    light: float = HISTOGRAM_SIGMA,
    uneven: float | None = None,
) -> FloatArray:
    """Return the evidence of `color_evidence` by the cells of a histogram, an array (V,) for each of its axes."""
    one, both = (_density(cell, members, bins, light, uneven)[cell] for members in (pure, mixed))
    share = min(float(np.median(both[pure] / one[pure])), most_mixed, MOST_MIXED)
    other = np.maximum(both - share * one, 0.0) / (1.0 - share)
    anything = SURPRISE / bins ** len(cell)
    return np.log((1.0 - SURPRISE) * one + anything) - np.log((1.0 - SURPRISE) * other + anything)


def usual_colors(
    colors: ByteArray, one: NDArray[np.bool_], other: NDArray[np.bool_], bins: int, light: float, least: float
) -> NDArray[np.bool_]:
    """Return which colours are as usual among one set of vertices, and rarer among the other, shape (V,).

    A colour that neither set has is of neither: cloth in a fold's shadow is not background because no cloth was seen
    so dark.

    Args:
        colors: sRGB, shape (V, 3).
        one, other: Of the two sets, shape (V,); at least one of each.
        bins: Of the histograms of `color_evidence`, along each axis.
        light: Standard deviation of the smoothing of the other set's along lightness [bins].
        least: How much likelier among the one, as a logarithm.
    """
    cell = _cells(colors, bins)
    ours = _density(cell, one, bins, HISTOGRAM_SIGMA)[cell]
    theirs = _density(cell, other, bins, light)[cell]
    anything = SURPRISE / bins**3
    likelier = np.log(ours + anything) - np.log(theirs + anything) > least
    return np.asarray(likelier & (ours >= np.quantile(ours[one], RARE)))


def color_overlap(
    colors: ByteArray, one: NDArray[np.bool_], other: NDArray[np.bool_], bins: int, light: float
) -> float:
    """Return how alike the colours of two sets of vertices are: 0 where they share none, 1 where they are the same.

    Bhattacharyya's coefficient of the histograms of `color_evidence`, with its arguments; 1 where a set is empty.
    """
    if not one.any() or not other.any():
        return 1.0
    cell = _cells(colors, bins)
    return float(np.sqrt(_density(cell, one, bins, light) * _density(cell, other, bins, light)).sum())


def _cells(colors: ByteArray, bins: int) -> tuple[IntArray, ...]:
    scaled = (cielab(colors) - [0.0, -90.0, -110.0]) / [100.0, 190.0, 210.0]
    return tuple(np.clip((scaled * bins).astype(int), 0, bins - 1).T)


def _density(
    cell: tuple[IntArray, ...], members: NDArray[np.bool_], bins: int, light: float, uneven: float | None = None
) -> FloatArray:
    """Return a smoothed histogram, by such a deviation along its first axis, and by the other `ELSEWHERE` [bins]."""
    histogram = np.zeros((bins,) * len(cell))
    np.add.at(histogram, tuple(axis[members] for axis in cell), 1.0 / members.sum())

    def smoothed(along: float) -> FloatArray:
        sigmas = (along, *(HISTOGRAM_SIGMA,) * (len(cell) - 1))
        return np.asarray(gaussian_filter(histogram, sigmas, mode="nearest"))

    here = smoothed(light)
    return here if uneven is None else (1.0 - ELSEWHERE) * here + ELSEWHERE * smoothed(uneven)


def cielab(colors: ByteArray) -> FloatArray:
    """Return CIELAB (D65) of sRGB bytes, shape (N, 3). IEC 61966-2-1 and CIE 15."""
    xyz = decode_srgb(colors) @ np.array([[0.4124, 0.2126, 0.0193], [0.3576, 0.7152, 0.1192], [0.1805, 0.0722, 0.9505]])
    ratio = xyz / np.array([0.9505, 1.0, 1.089])
    f = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.column_stack([116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])])
