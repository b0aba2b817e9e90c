"""What photos show through loops: cloth through holes of the scan, the bare mannequin through openings.

A shoulder comes through a hole over it as a neck comes through a collar. But the photos show cloth on the one, and the
bare mannequin on the other. So they do where a form's neck ends in the collar, of which nothing comes through.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from vto_pipeline.garment.photographed.sightings import Sightings
from vto_pipeline.model.arrays import FloatArray

COVERED, BARE = 0.7, 0.1
"""A loop is covered where a larger share of what shows through it is cloth, and bare where a smaller one is: beside a
rim some may have been lost."""
WITHIN = 1.2
"""What is so many radii from a loop's middle, and nearest to it, shows through it."""
LEAST_SHOWN = 0.001
"""Less of the mannequin tells nothing: 3 by 3 cm [m²]."""


def cloth_shares(sightings: Sightings, loops: Sequence[FloatArray]) -> list[float | None]:
    """Return which share of what shows through each loop is cloth; None where too little shows.

    Args:
        sightings: What the photos show where the garment, with all its loops open, leaves the mannequin bare.
        loops: All of them, each in order [m], shape (L, 3).
    """
    if not loops or len(sightings.points) == 0:
        return [None] * len(loops)
    owner = np.repeat(np.arange(len(loops)), [len(loop) for loop in loops])
    nearest = owner[cKDTree(np.concatenate(loops)).query(sightings.points)[1]]
    found: list[float | None] = []
    for index, loop in enumerate(loops):
        length = np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1)
        middle = np.average(0.5 * (loop + np.roll(loop, -1, axis=0)), axis=0, weights=length)
        radius = float(length.sum()) / (2.0 * np.pi)
        shows = (nearest == index) & (np.linalg.norm(sightings.points - middle, axis=1) < WITHIN * radius)
        enough = np.count_nonzero(shows) * sightings.area >= LEAST_SHOWN
        found.append(float(np.mean(sightings.cloth[shows])) if enough else None)
    return found
