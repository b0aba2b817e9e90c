"""Openings that are several: cloth that the garment lacks parts them. Photos show it, or nothing was seen there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.bare_parts import BareParts
from vto_pipeline.garment.photographed.sightings import SPACING, Sightings
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_loops, close_openings, surface_area
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
LEAST_LOST = 0.005
"""Less cloth that parts nothing is a rim that ends some millimetres early [m²]."""
AT_RIM = 0.05
"""Cloth that stands off from the mannequin ends within this of what was lost [m]."""
STRAP = 0.08
"""A strap that was not seen leaves no place of the mannequin farther than this from its ends [m]."""
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
    """Refuse a garment of which an opening is several, as neck and armholes without the straps between them; warn of
    other cloth that it lacks.

    Args:
        sightings: What the photos show where the garment leaves the mannequin bare.
        garment: The finished garment.
        openings: Of it; at least one.
        answered: Who gave the number of openings answers for it: then it is a warning.
        job: Receives the warnings.

    Raises:
        GarmentError: it lacks cloth that parts an opening.
    """
    several = parted_openings(sightings, garment.vertices)
    for parted in several:
        lacks = f"the photos show {parted.area * 1e4:.0f} cm² of cloth there that the garment lacks"
        _refuse(parted, f"should be at least {parted.parts}: {lacks}", garment, openings, answered, job)
    if not several:
        warn_of_lost(sightings, garment, openings, job)


def warn_of_lost(sightings: Sightings, garment: TriangleMesh, openings: Sequence[Opening], job: Job) -> None:
    """Warn of cloth beside an opening that photos show and the garment lacks, though it parts nothing: a torn chest.

    Args:
        sightings: What the photos show where the garment leaves the mannequin bare.
        garment: The finished garment.
        openings: Of it; at least one.
        job: Receives the warnings.
    """
    patch = _pieces(sightings.points, _hanging_on(sightings, garment.vertices), sightings.area)
    for number in range(patch.max(initial=-1) + 1):
        cloth = sightings.points[patch == number]
        area = len(cloth) * sightings.area
        if area >= LEAST_LOST:
            lacks = f"photos show {area * 1e4:.0f} cm² of cloth that the garment lacks"
            _refuse(Parted(1, cloth, area), f"is uncertain: {lacks}", garment, openings, True, job)


def refuse_unseen(
    garment: TriangleMesh,
    openings: Sequence[Opening],
    mannequin: TriangleMesh,
    bare: BareParts,
    sightings: Sightings | None,
    answered: bool,
    job: Job,
) -> None:
    """Refuse a garment of which an opening may be several: what would part it was seen neither bare nor clothed.

    So it is where a camera looked over no shoulder: neck and armholes are then one opening, whether a strap lies there
    or not. Farther from the rims, as between the legs under a hem, cloth is less likely: that is a warning.

    Args:
        garment: The finished garment.
        openings: Of it; at least one.
        mannequin: In the same frame.
        bare: What was scanned of the bare mannequin.
        sightings: What photos show of it, too; None where there are none that tell.
        answered: Who gave the number of openings answers for it: then it is a warning.
        job: Receives the warnings.

    Raises:
        GarmentError: too little was seen to tell.
    """
    for reach in (STRAP, np.inf):
        found = unseen_openings(garment, mannequin, bare, sightings, job.seed, reach)
        for parted in found:
            lacks = f"{parted.area * 1e4:.0f} cm² of the mannequin there were seen neither bare nor clothed"
            warns = answered or reach > STRAP
            _refuse(parted, f"may be {parted.parts} or more: {lacks}", garment, openings, warns, job)
        if found:
            return


def _refuse(
    parted: Parted, why: str, garment: TriangleMesh, openings: Sequence[Opening], answered: bool, job: Job
) -> None:
    """Raise for an opening that is several, or warn where that is answered for."""
    tree = cKDTree(parted.cloth)
    opening = min(openings, key=lambda one: float(np.median(tree.query(garment.vertices[one.loop])[0])))
    over = parted.cloth[int(tree.query(parted.cloth.mean(axis=0))[1])]
    what = f"the opening of {opening.perimeter * 1e3:.0f} mm at {_place(opening.center)}"
    problem = f"{what} {why}, as over {_place(over)}"
    if answered:
        job.warn(problem)
        return
    raise GarmentError(
        problem,
        hint="take more photos or frames of that place, often the shoulders, from above and 10 to 15 degrees apart. "
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
    return _parts_of(sightings, _hanging_on(sightings, cloth_points))


def lost_patches(sightings: Sightings, cloth_points: FloatArray) -> list[Parted]:
    """Return each connected piece of cloth that the garment lacks, and between how many parts of the mannequin it lies:
    a strap between two, a bite in a rim beside one.

    Args:
        sightings: What the photos show.
        cloth_points: Of the garment as found [m], shape (V, 3).
    """
    lost = _hanging_on(sightings, cloth_points)
    patch, bare = _pieces(sightings.points, lost, sightings.area), _pieces(sightings.points, ~lost, sightings.area)
    large = np.bincount(bare[~lost], minlength=1) * sightings.area >= LEAST_PART
    tree, found = cKDTree(sightings.points[~lost]), []
    for number in range(patch.max(initial=-1) + 1):
        cloth = sightings.points[patch == number]
        beside = np.concatenate(tree.query_ball_point(cloth, BESIDE * np.sqrt(sightings.area))).astype(int)
        parts = int(np.count_nonzero(large[np.unique(bare[~lost][beside])]))
        found.append(Parted(parts, cloth, len(cloth) * sightings.area))
    return found


def unseen_openings(
    garment: TriangleMesh,
    mannequin: TriangleMesh,
    bare: BareParts,
    sightings: Sightings | None,
    seed: int,
    reach: float = STRAP,
) -> list[Parted]:
    """Return where unseen places divide what the garment leaves bare of the mannequin, as `parted_openings` does.

    Only parts that come near a rim leave through an opening of their own. The foot of a stand does not, though the
    underside of the form between it and the hem is hidden.

    Args:
        garment, mannequin, bare, sightings: As in `refuse_unseen`.
        seed: Of the points of the mannequin that are asked for.
        reach: Places farther than this from the garment are taken for bare [m].
    """
    area = surface_area(mannequin)
    count = max(int(area / SPACING**2), 1)
    points = sample_surface(mannequin, count, seed)[0]
    points = points[~SurfaceDistance(close_openings(garment)).inside(points)]
    shown = bare.under(points)
    if sightings is not None and not sightings.cloth.all():
        shown_bare = cKDTree(sightings.points[~sightings.cloth])
        shown |= np.isfinite(shown_bare.query(points, distance_upper_bound=BESIDE * SPACING)[0])
    shown |= cKDTree(garment.vertices).query(points)[0] > reach
    what = Sightings(points, ~shown, area / count)
    rim = garment.vertices[np.concatenate(boundary_loops(garment))]
    near = np.isfinite(cKDTree(rim).query(points, distance_upper_bound=AT_RIM)[0])
    return _parts_of(what, _hanging_on(what, garment.vertices), near)


def _parts_of(sightings: Sightings, lost: NDArray[np.bool_], near: NDArray[np.bool_] | None = None) -> list[Parted]:
    """Return where lost points (N,) divide a piece of the others; with `near` (N,), only parts that have such count."""
    whole = _pieces(sightings.points, np.ones_like(lost), sightings.area)
    bare = _pieces(sightings.points, ~lost, sightings.area)
    found = []
    for piece in range(whole.max(initial=-1) + 1):
        mine = whole == piece
        part, size = np.unique(bare[mine & ~lost], return_counts=True)
        large = size * sightings.area >= LEAST_PART
        if near is not None:
            large &= np.isin(part, bare[mine & near & ~lost])
        parts = int(np.count_nonzero(large))
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
