"""Openings that are several: cloth in the photos parts them, and the garment lacks that cloth."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.photographed.sightings import Sightings
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.garment import Opening
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

BESIDE = 2.5
"""Points are connected within so many times their spacing."""
LEAST_PART = 0.006
"""A part of the mannequin that leaves an opening shows at least so much: a bare upper arm, not a gap between folds
[m²]."""
LEAST_CLOTH = 0.001
"""Less cloth is within the error of a rim: a strap of 2 cm by 5 [m²]."""
AT_RIM = 0.05
"""Cloth that stands off from the mannequin ends within this of what was lost [m]."""
BRIDGING = 0.7
"""Lost cloth hangs on the garment at its ends: these are so far apart, as a share of its own size. A shadow on an arm
begins at the cuff and runs away from it."""


class Parted(NamedTuple):
    """An opening that should be several.

    Args:
        parts: Parts of the mannequin that leave it, each through an opening of its own.
        cloth: Points of the mannequin under the cloth between them [m], shape (N, 3).
        area: Of that cloth [m²].
    """

    parts: int
    cloth: FloatArray
    area: float


def refuse_parted(
    sightings: Sightings, garment: TriangleMesh, openings: Sequence[Opening], answered: bool, job: Job
) -> None:
    """Refuse a garment of which an opening is several, as neck and armholes without the straps between them.

    Args:
        sightings: What the photos show where the garment leaves the mannequin bare.
        garment: The finished garment.
        openings: Of it; at least one.
        answered: Who gave the number of openings answers for it: then it is a warning.
        job: Receives the warnings.

    Raises:
        GarmentError: it lacks cloth that parts an opening.
    """
    for parted in parted_openings(sightings, garment.vertices):
        tree = cKDTree(parted.cloth)
        opening = min(openings, key=lambda one: float(np.median(tree.query(garment.vertices[one.loop])[0])))
        over = parted.cloth[int(tree.query(parted.cloth.mean(axis=0))[1])]
        what = f"the opening of {opening.perimeter * 1e3:.0f} mm at {_place(opening.center)}"
        lacks = f"the photos show {parted.area * 1e4:.0f} cm² of cloth there that the garment lacks"
        problem = f"{what} should be at least {parted.parts}: {lacks}, as over {_place(over)}"
        if answered:
            job.warn(problem)
            continue
        raise GarmentError(
            problem,
            hint="take more photos of that place, often the shoulders, from above and 10 to 15 degrees apart. "
            "Or look at it, and set openings.keep to the number of openings",
            partial={"garment": garment},
        )


def parted_openings(sightings: Sightings, cloth_points: FloatArray) -> list[Parted]:
    """Return where cloth that the garment lacks divides what it leaves bare of the mannequin.

    What leaves a garment through one opening is connected on the mannequin: head and arms above a strapless dress, a
    leg below each hem. Where that falls into parts once the points that show cloth are taken out, the cloth between
    them is a strap or a shoulder that was lost. Cloth lost elsewhere, as a cuff, divides nothing.

    Args:
        sightings: What the photos show.
        cloth_points: Of the garment as found [m], shape (V, 3).
    """
    lost = _hanging_on(sightings, cloth_points)
    whole = _pieces(sightings.points, np.ones_like(lost), sightings.area)
    bare = _pieces(sightings.points, ~lost, sightings.area)
    found = []
    for piece in range(whole.max(initial=-1) + 1):
        mine = whole == piece
        _, size = np.unique(bare[mine & ~lost], return_counts=True)
        parts = int(np.count_nonzero(size * sightings.area >= LEAST_PART))
        if parts > 1:
            between = sightings.points[mine & lost]
            found.append(Parted(parts, between, len(between) * sightings.area))
    return found


def _hanging_on(sightings: Sightings, cloth_points: FloatArray) -> NDArray[np.bool_]:
    """Return which points show cloth that hangs on the garment at its ends, shape (N,)."""
    patch = _pieces(sightings.points, sightings.cloth, sightings.area)
    at_rim = np.isfinite(cKDTree(cloth_points).query(sightings.points, distance_upper_bound=AT_RIM)[0])
    lost = np.zeros(len(patch), dtype=bool)
    for number in range(patch.max(initial=-1) + 1):
        mine = patch == number
        if mine.sum() * sightings.area < LEAST_CLOTH or not (mine & at_rim).any():
            continue
        size, ends = (float(np.linalg.norm(np.ptp(sightings.points[which], axis=0))) for which in (mine, mine & at_rim))
        lost |= mine & (ends >= BRIDGING * size)
    return lost


def _pieces(points: FloatArray, among: NDArray[np.bool_], area: float) -> IntArray:
    """Return to which connected piece each point belongs, -1 for those that are not among them, shape (N,)."""
    piece = np.full(len(points), -1, dtype=np.int32)
    count = int(among.sum())
    if count == 0:
        return piece
    pairs = cKDTree(points[among]).query_pairs(BESIDE * np.sqrt(area), output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs), np.int8), pairs.T), (count, count))
    piece[among] = connected_components(graph, directed=False)[1]
    return piece


def _place(point: FloatArray) -> str:
    return f"({point[0]:.2f}, {point[1]:.2f}, {point[2]:.2f}) m"
