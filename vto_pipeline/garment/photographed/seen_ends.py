"""Rims beyond which nothing was seen: there the cloth may go on, and only what was scanned of it ends.

Beyond a hem, cameras see what cloth would hide: the bare mannequin, or something farther off. Beyond cloth that is too
dark to measure, or out of their sight, they see nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.bare_parts import BareParts
from vto_pipeline.garment.photographed.parted import BESIDE, STRAP
from vto_pipeline.garment.photographed.sightings import SPACING, Sightings
from vto_pipeline.geometry.seen.looked_through import cameras_through
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.camera import CameraSet
from vto_pipeline.model.garment import Opening
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

BEYOND = 0.015
"""So far beyond a rim it is asked what was seen: farther than rims are moved when they are cleaned [m]."""
ALONG = 3
"""A rim's direction is taken over so many edges to both sides: it may zigzag."""
BEHIND, LEAST_CAMERAS = 0.01, 2
"""So many cameras must see through a place to what is farther off by so much [m]."""
LEAST_STRETCH = 0.05
"""Shorter unseen stretches of a rim come from its zigzag: 23 mm at most on ten rims that were right [m]."""
UNCERTAIN, UNKNOWN = (1.0 / 3.0, 0.2), (1.0 / 2.0, 0.4)
"""Beyond such a share of its rim, or such a length [m], nothing was seen. On ten rims that were right it was no length
but once, behind a neck where no frame looked: 12 of 61 cm."""


class Scanned(NamedTuple):
    """What was scanned.

    Args:
        surface: All of it, in the garment's frame [m].
        cameras: That saw it.
    """

    surface: TriangleMesh
    cameras: CameraSet


class Seen(NamedTuple):
    """What tells that cloth ends.

    Args:
        scanned: The surface, and from where it was seen.
        distance: To the mannequin; None without one.
        bare: What was scanned of the bare mannequin; None where that is not known.
        sightings: What photos show of it, too; None where there are none that tell.
    """

    scanned: Scanned
    distance: SurfaceDistance | None
    bare: BareParts | None
    sightings: Sightings | None

    def empty(self, points: FloatArray) -> NDArray[np.bool_]:
        """Return at which points (N, 3) no cloth is, for what it would hide was seen, shape (N,)."""
        found = cameras_through(points, *self.scanned, BEHIND) >= LEAST_CAMERAS
        if self.bare is not None:
            found |= self.bare.under(points)
        if self.sightings is not None and self.distance is not None and not self.sightings.cloth.all():
            foot, shown = self.distance.nearest(points).point, cKDTree(self.sightings.points[~self.sightings.cloth])
            found |= np.isfinite(shown.query(foot, distance_upper_bound=BESIDE * SPACING)[0])
        return np.asarray(found)


def refuse_unseen_ends(
    garment: TriangleMesh, openings: Sequence[Opening], seen: Seen, answered: bool, job: Job
) -> None:
    """Refuse a garment with an opening beyond most of whose rim nothing was seen, though the mannequin lies there.

    Where a rim hangs away from the mannequin nothing may be behind it, and it is a warning.

    Args:
        garment: The finished garment, oriented outward.
        openings: Of it.
        seen: What tells that cloth ends.
        answered: Then it is a warning: who gave the number of openings looked at them, or evidence is hard to get.
        job: Receives the warnings.

    Raises:
        GarmentError: it is not known where an opening is.
    """
    for opening in openings:
        places, length = places_beyond(garment, opening)
        unseen = _stretches(~seen.empty(places), length)
        whole, blank = float(length.sum()), float(length[unseen].sum())
        if not _at_least(UNCERTAIN, blank, whole):
            continue
        x, y, z = np.average(places[unseen], axis=0, weights=length[unseen])
        problem = (
            f"beyond {1e3 * blank:.0f} of {1e3 * opening.perimeter:.0f} mm of an opening's rim nothing was seen, about "
            f"({x:.2f}, {y:.2f}, {z:.2f}) m; the cloth may continue there"
        )
        hangs = seen.distance is None or float(np.median(seen.distance.nearest(places[unseen]).distance)) > STRAP
        if answered or hangs or not _at_least(UNKNOWN, blank, whole):
            job.warn(f"{problem}: look at it, or take more photos or frames of that place")
            continue
        raise GarmentError(
            problem,
            hint="take more photos or frames of that place; dark, glossy or plain cloth needs more light or a print. "
            "Or look at it, and set openings.keep to the number of openings",
            partial={"garment": garment},
        )


def _at_least(bound: tuple[float, float], blank: float, whole: float) -> bool:
    """Return whether an unseen part of a rim is the share of it, or the length [m], that a bound gives."""
    return blank >= bound[0] * whole or blank >= bound[1]


def _stretches(unseen: NDArray[np.bool_], length: FloatArray) -> NDArray[np.bool_]:
    """Return which vertices of a rim are in unseen stretches that are long enough to count, shape (L,).

    Args:
        unseen: Which vertices are unseen, in order round the rim, shape (L,).
        length: Of the rim at each [m], shape (L,).
    """
    if unseen.all():
        return unseen
    first = int(np.argmin(unseen))  # a rim has no beginning: begin where it was seen
    after = np.roll(unseen, -first)
    stretch = np.cumsum(~after)
    total = np.bincount(stretch, np.roll(length, -first) * after)
    return np.asarray(np.roll(after & (total[stretch] >= LEAST_STRETCH), first))


def places_beyond(garment: TriangleMesh, opening: Opening) -> tuple[FloatArray, FloatArray]:
    """Return places in the cloth's continuation beyond each vertex of a rim [m], (L, 3), and the length of each, (L,).

    Args:
        garment: Oriented outward.
        opening: Of it.
    """
    rim = garment.vertices[opening.loop]
    outward = np.cross(
        np.roll(rim, -ALONG, axis=0) - np.roll(rim, ALONG, axis=0), vertex_normals(garment)[opening.loop]
    )
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-12)
    edge = np.linalg.norm(np.roll(rim, -1, axis=0) - rim, axis=1)
    return rim + BEYOND * outward, 0.5 * (edge + np.roll(edge, 1))
