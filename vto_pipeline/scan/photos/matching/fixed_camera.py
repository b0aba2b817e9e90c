"""Matches of a background that stays where it is in every photo, because the camera does: left out.

On a turntable the background would win: it is larger than the object and it holds still, so that all photos seem to be
taken from one place.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.model.arrays import FloatArray

Pair = tuple[str, str]

STILL_SHARE = 0.002
"""A match that moves by less than this share of the picture's longer side stays where it is."""
LEAST_PHOTOS = 4
"""A feature of the background stays in its place in so many other photos at least ..."""
LEAST_SHARE = 0.5
"""... and in this share of those that it is matched in. What turns goes elsewhere in most."""
MOVING_SHARE = 0.006
"""What turns moves by more than this share of the longer side, from one photo to the next."""
FIXED_SHARE = 0.1
"""The camera is fixed when more than this share of the matched features, over all photos, stay."""


class StillFeatures(NamedTuple):
    """Features of the background.

    Args:
        still: Photo -> which of its features stay, shape (K,).
        share: Of the matched features of all photos.
    """

    still: Mapping[str, NDArray[np.bool_]]
    share: float

    @property
    def fixed_camera(self) -> bool:
        """Whether the camera did not move."""
        return self.share > FIXED_SHARE


def still_features(
    places: Mapping[str, FloatArray], matches: Mapping[Pair, NDArray[np.integer]], longer_side: float
) -> StillFeatures:
    """Find the features that stay in their place while others move.

    Args:
        places: Photo -> its features [px], shape (K, 2).
        matches: Pair of photos -> indices of their matched features, shape (M, 2).
        longer_side: Of the photos [px].
    """
    still = {name: np.zeros(len(place), dtype=np.int64) for name, place in places.items()}
    matched = {name: np.zeros(len(place), dtype=np.int64) for name, place in places.items()}
    for (one, other), rows in matches.items():
        moved = np.linalg.norm(places[one][rows[:, 0]] - places[other][rows[:, 1]], axis=1)
        stays = moved < STILL_SHARE * longer_side
        for name, column in ((one, 0), (other, 1)):
            np.add.at(matched[name], rows[:, column], 1)
            np.add.at(still[name], rows[stays, column], 1)
    found = {name: (still[name] >= LEAST_PHOTOS) & (still[name] >= LEAST_SHARE * matched[name]) for name in places}
    total = sum(int((count > 0).sum()) for count in matched.values())
    return StillFeatures(found, sum(int(flags.sum()) for flags in found.values()) / max(total, 1))


def moving_matches(
    places: Mapping[str, FloatArray],
    matches: Mapping[Pair, NDArray[np.integer]],
    still: Mapping[str, NDArray[np.bool_]],
    longer_side: float,
) -> dict[Pair, NDArray[np.integer]]:
    """Return the matches that move and none of whose features belongs to the background, shape (M, 2) each.

    Faint features of the background are found in too few photos to be told by their number: whatever all but stays in
    its place is left out, and with it a few of the object's near its outline.

    Args:
        places, matches, longer_side: As `still_features` takes them.
        still: What it found.
    """
    moving = {}
    for (one, other), rows in matches.items():
        moved = np.linalg.norm(places[one][rows[:, 0]] - places[other][rows[:, 1]], axis=1)
        kept = ~still[one][rows[:, 0]] & ~still[other][rows[:, 1]] & (moved > MOVING_SHARE * longer_side)
        moving[one, other] = rows[kept]
    return moving
