"""Which boundary loops are openings of the garment, and which are holes of the scan, by all the evidence there is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.bare_parts import BareParts
from vto_pipeline.garment.loop_evidence import LoopShape, disc_of, encloses, goes_round, is_filled, measure_loops
from vto_pipeline.garment.photographed.covered import BARE, COVERED, cloth_shares
from vto_pipeline.garment.photographed.sightings import Sightings
from vto_pipeline.garment.photographed.unsure import SEEN_BARE, unsure_loops
from vto_pipeline.garment.subtraction.pieces import LEAST
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import component_areas
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

SCANNED_BARE, SHOWN_BARE = 0.2, 0.1
"""A place is bare if a larger share of it was scanned so, or photos show so: they show less, but not by chance."""


class Evidence(NamedTuple):
    """What tells openings from scan holes.

    Args:
        distance: Signed distances to the mannequin, if there is one [m].
        bare: What was scanned of the bare mannequin, if it is known.
        sightings: What photos show of it where the garment, with all its loops open, leaves it bare; None if nothing.
        least_perimeter: Shorter loops are never openings [m].
        reach: How far inside an opening the mannequin may end [m].
        tubular: Without a mannequin, how tube-like an opening must be.
        keep: How many openings there are, if that was given.
    """

    distance: SurfaceDistance | None
    bare: BareParts | None
    sightings: Sightings | None
    least_perimeter: float
    reach: float
    tubular: float
    keep: int | None

    def over_bare(self, points: FloatArray) -> bool:
        """Return whether points (N, 3), spread over a place, lie over mannequin that was scanned bare, or that photos
        show so and not clothed. What neither saw, as under the cloth beside it, says nothing."""
        if self.bare is not None and float(np.mean(self.bare.under(points))) > SCANNED_BARE:
            return True
        if self.sightings is None or self.distance is None:
            return False
        bare, cloth = (float(np.mean(shown)) for shown in self.sightings.under(points, self.distance))
        return bare > max(SHOWN_BARE, cloth)


class Judged(NamedTuple):
    """The boundary loops of a garment.

    Args:
        shapes: All of them.
        is_opening: Which are openings.
        unsure: What is unsure about them, in words.
    """

    shapes: list[LoopShape]
    is_opening: list[bool]
    unsure: list[str]


def tell_apart(mesh: TriangleMesh, evidence: Evidence, job: Job) -> Judged:
    """Return the boundary loops of a garment, and which are openings.

    Args:
        mesh: The garment.
        evidence: What tells.
        job: Receives what was decided by little or against the evidence.

    Raises:
        GarmentError: there are fewer loops than openings are to be kept.
    """
    shapes = measure_loops(mesh)
    is_opening = _by_geometry(mesh, shapes, evidence, job)
    shares: list[float | None] = [None] * len(shapes)
    unsure: list[str] = []
    if evidence.distance is not None:
        rims = [mesh.vertices[shape.loop] for shape in shapes]
        if evidence.sightings is not None:
            shares = cloth_shares(evidence.sightings, rims)
            is_opening = _by_photos(rims, shapes, is_opening, shares, evidence, job)
        unsure = unsure_loops(shapes, rims, is_opening, shares, evidence.distance, evidence.bare, evidence.reach)
    if evidence.keep is not None:
        is_opening = _kept(shapes, is_opening, evidence.keep, job)
    return Judged(shapes, is_opening, unsure)


def worn_faces(mesh: TriangleMesh, evidence: Evidence, job: Job) -> NDArray[np.bool_]:
    """Return which faces belong to the largest piece or to one that is worn by itself, shape (F,).

    The mannequin passes through two openings of that, or through one that goes round it, as into a sock. Without a
    mannequin, shape alone tells.
    """
    piece, area = component_areas(mesh)
    passed = np.where(area == area.max(), 2, 0)
    if len(area) == 1:
        return np.ones(len(piece), dtype=bool)
    distance = evidence.distance
    shapes, is_opening, _ = tell_apart(mesh, evidence._replace(keep=None), Job(seed=job.seed))
    for shape, real in zip(shapes, is_opening, strict=True):
        rim = mesh.vertices[shape.loop]
        if real:
            passed[piece[shape.walk[0] // 3]] += 2 if distance is None or goes_round(rim, distance) else 1
    return np.asarray(((passed >= 2) & (area >= LEAST * area.max()))[piece])


def listing(judged: Judged) -> str:
    """Return each loop with its verdict, length and place, for messages."""
    return _listing(judged.shapes, judged.is_opening)


def _by_geometry(mesh: TriangleMesh, shapes: list[LoopShape], evidence: Evidence, job: Job) -> list[bool]:
    """Return which loops are openings by their shape, and by the mannequin and what was scanned of it."""
    long_enough = [shape.perimeter >= evidence.least_perimeter for shape in shapes]
    distance, reach = evidence.distance, evidence.reach
    if distance is None:
        real = [ok and shape.tubular >= evidence.tubular for ok, shape in zip(long_enough, shapes, strict=True)]
        if not all(real):
            job.warn(f"no mannequin to tell openings from scan holes: {_listing(shapes, real)}")
        return real
    real = []
    for ok, shape in zip(long_enough, shapes, strict=True):
        rim = mesh.vertices[shape.loop]
        around = ok and (encloses(rim, distance, reach) or _shows_bare(rim, distance, evidence.bare))
        hangs = ok and not around and shape.tubular >= evidence.tubular and distance.signed(rim).distance.min() > reach
        if hangs:
            job.note(f"beyond the mannequin, by its shape alone: {_listing([shape], [True])}")
        real.append(around or hangs)
    return real


def _shows_bare(rim: FloatArray, distance: SurfaceDistance, bare: BareParts | None) -> bool:
    """Return whether the mannequin fills a loop (L, 3), and was seen bare through it, or where cloth ends there."""
    if bare is None or not is_filled(rim, distance):
        return False
    return float(np.mean(bare.under(disc_of(rim)))) > SEEN_BARE or bare.ends_cloth(rim) > 0.0


def _by_photos(
    rims: list[FloatArray],
    shapes: list[LoopShape],
    likely: list[bool],
    shares: list[float | None],
    evidence: Evidence,
    job: Job,
) -> list[bool]:
    """Return which loops are openings once the photos were asked: not those through which most of what they show is
    cloth, but those that the mannequin fills, and through which they show it bare."""
    real = []
    for shape, rim, before, share in zip(shapes, rims, likely, shares, strict=True):
        shut, shown = (False, False) if share is None else (share > COVERED, share < BARE)
        shown = shown and shape.perimeter >= evidence.least_perimeter
        filled = evidence.distance is not None and shown and is_filled(rim, evidence.distance)
        real.append((before and not shut) or filled)
        if real[-1] != before:
            what = "the photos show the mannequin bare there" if real[-1] else "the photos show cloth there"
            job.note(f"{what}: {_listing([shape], real[-1:])}")
    return real


def _kept(shapes: list[LoopShape], likely: list[bool], count: int, job: Job) -> list[bool]:
    """Return which loops stay open when their number is given: those with evidence first, then the longest."""
    if len(shapes) < count:
        raise GarmentError(f"only {len(shapes)} boundary loops, but {count} openings are to be kept")
    order = sorted(range(len(shapes)), key=lambda i: (not likely[i], -shapes[i].perimeter))
    kept = [i in order[:count] for i in range(len(shapes))]
    turned = [i for i in range(len(shapes)) if kept[i] != likely[i]]
    if turned:
        changed = _listing([shapes[i] for i in turned], [kept[i] for i in turned])
        job.note(f"against the evidence, because {count} openings are to be kept: {changed}")
    return kept


def _listing(shapes: list[LoopShape], real: list[bool]) -> str:
    return "; ".join(
        f"{'opening' if is_opening else 'scan hole'} of {shape.perimeter * 1e3:.0f} mm at "
        f"({shape.center[0]:.2f}, {shape.center[1]:.2f}, {shape.center[2]:.2f}) m"
        for shape, is_opening in zip(shapes, real, strict=True)
    )
