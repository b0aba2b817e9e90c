"""Matches between photos whose places are known: along each other's epipolar lines, and confirmed.

On stripes and plain cloth a feature has many of its like in another photo, but few on the line that shows it. Beside
one of these alone, chance looks like a match. So it must be the nearest in the whole photo, too; or a third photo must
show a feature that matches both.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.numerics.cpu_threads import in_order
from vto_pipeline.scan.photos.matching.board_poses import Placed, epipolar_lines
from vto_pipeline.scan.photos.matching.fixed_camera import Pair
from vto_pipeline.scan.photos.matching.nearest import nearest_matches

WIDEST_DEG = 50.0
"""Photos whose directions of sight differ by more show hardly a feature alike: on a line, most matches are chance."""

Matches = dict[Pair, NDArray[np.uint32]]


def match_placed(
    pairs: Sequence[Pair],
    cameras: Mapping[str, Any],
    described: Mapping[str, NDArray[np.uint8]],
    places: Mapping[str, FloatArray],
    chosen: Mapping[str, IntArray],
    placed: Mapping[str, Placed],
    most_px: float,
) -> Matches:
    """Match the features of photos that look in about the same direction.

    Args:
        pairs: Of photos; those that were not both placed, or look elsewhere, are left out.
        cameras: Photo -> pycolmap Camera.
        described: Photo -> its features' descriptors, shape (K, 128).
        places: Photo -> their pixels, COLMAP's way, shape (K, 2).
        chosen: Photo -> those to match, shape (N,).
        placed: Photo -> where it was taken.
        most_px: Sampson's distance (1982) that a match may have [px].

    Returns:
        Pair of photos -> rows of their features, shape (M, 2).
    """
    least = np.cos(np.radians(WIDEST_DEG))
    ahead = {name: one.rotation[2] for name, one in placed.items()}
    both = [(one, other) for one, other in pairs if one in placed and other in placed]

    def look(index: int) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
        one, other = both[index]
        here, there = (described[name][chosen[name]].astype(np.float32) for name in (one, other))
        pixels = places[one][chosen[one]], places[other][chosen[other]]
        lines = epipolar_lines(cameras[one], cameras[other], placed[one], placed[other], *pixels, most_px)
        nearest = nearest_matches(here, there)
        alike = ahead[one] @ ahead[other] > least
        along = nearest_matches(here, there, lines) if alike else np.empty((0, 2), np.uint32)
        return nearest[lines.hold(nearest)], along

    sure: Matches = {}
    along: Matches = {}
    for pair, (nearest, on_line) in zip(both, in_order(look, len(both)), strict=True):
        sure[pair], along[pair] = nearest, on_line
    seconds = confirmed(along, {name: len(chosen[name]) for name in placed})
    found = {pair: np.unique(np.vstack([sure[pair], along[pair][seconds[pair]]]), axis=0) for pair in both}
    return {
        (one, other): np.column_stack([chosen[one][rows[:, 0]], chosen[other][rows[:, 1]]]).astype(np.uint32)
        for (one, other), rows in found.items()
    }


def confirmed(matches: Mapping[Pair, NDArray[np.uint32]], count: Mapping[str, int]) -> dict[Pair, NDArray[np.bool_]]:
    """Return which matches (M, 2) of each pair have a feature of a third photo that matches both.

    Args:
        matches: Pair of photos -> rows of their features, none of them twice.
        count: Photo -> how many features it has.
    """
    partner: dict[str, dict[str, NDArray[np.int64]]] = {name: {} for name in count}
    for (one, other), rows in matches.items():
        for name, with_name, column in ((one, other, 0), (other, one, 1)):
            of = np.full(count[name], -1, np.int64)
            of[rows[:, column]] = rows[:, 1 - column]
            partner[name][with_name] = of
    sure = {}
    for (one, other), rows in matches.items():
        found = np.zeros(len(rows), dtype=bool)
        for third in partner[one].keys() & partner[other].keys():
            there = partner[one][third][rows[:, 0]]
            found |= (there >= 0) & (there == partner[other][third][rows[:, 1]])
        sure[one, other] = found
    return sure
