"""Whether a surface can be a garment at all: somewhere a body must get in."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vto_pipeline.errors import InputError
from vto_pipeline.geometry.topology import face_components
from vto_pipeline.model.garment import Opening
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.volume import axis_volumes

LEAST_PERIMETER_MM = 120.0
"""No part of a body passes through less: a tight cuff is longer."""
THICKEST_CLOTH_M = 0.02
"""A closed surface of less mean thickness is cloth modelled with both its sides."""
_MOST_CLOSED = 0.5
"""Share of the surface that may be solid things, such as buttons and buckles."""
SINGLE = 2
"""Openings of a garment that have no counterpart beside them: a neck or a waist, and a hem."""
ALIKE = 1.4
"""Counterparts, as armholes, differ by less than this factor in length: one sleeve may be rolled up."""


def check_wearable(surface: TriangleMesh, openings: Sequence[Opening]) -> None:
    """Refuse a surface that mostly encloses space without an opening to it: a body or a solid, not a garment.

    Args:
        surface: Manifold and oriented outward [m].
        openings: Its boundary loops.

    Raises:
        InputError: it does.
    """
    count, piece = face_components(surface)
    volumes, area = axis_volumes(surface.vertices, surface.faces, piece, count)
    piece_of_vertex = np.empty(len(surface.vertices), dtype=np.int32)
    piece_of_vertex[surface.faces] = piece[:, None]
    entered = np.zeros(count, dtype=bool)
    longest = 0.0
    for opening in openings:
        longest = max(longest, 1e3 * opening.perimeter)
        if 1e3 * opening.perimeter >= LEAST_PERIMETER_MM:
            entered[piece_of_vertex[opening.loop[0]]] = True
    thickness = 2.0 * volumes.mean(axis=1) / np.maximum(area, np.finfo(float).tiny)
    closed = float(area[~entered & (thickness > THICKEST_CLOTH_M)].sum() / area.sum())
    if closed > _MOST_CLOSED:
        least = f"an opening of at least {LEAST_PERIMETER_MM:.0f} mm"
        seen = f"the longest loop is {longest:.0f} mm" if openings else "the surface is closed"
        raise InputError(
            f"no body can get into this: {closed:.0%} of it encloses space without {least} ({seen})",
            hint="a garment is an open surface with a neck, a hem or cuffs; is this a body, or a solid?",
        )


def warn_one_sided(openings: Sequence[Opening], job: Job) -> None:
    """Warn of a garment with an armhole or a leg at one side only: where a strap was lost, neck and armhole are one.

    Args:
        openings: Of one piece.
        job: Receives the warning.
    """
    left = sorted(openings, key=lambda one: one.perimeter)
    single = []
    while left:
        one = left.pop(0)
        beside = next((k for k, other in enumerate(left) if _beside(one, other)), None)
        if beside is None:
            single.append(one)
        else:
            del left[beside]
    if len(single) > SINGLE:
        x, y, z = single[0].center
        job.warn(
            f"the opening of {single[0].perimeter * 1e3:.0f} mm at ({x:.2f}, {y:.2f}, {z:.2f}) m has no counterpart at "
            "the other side. A strap or seam may have been lost there: look at it"
        )


def _beside(one: Opening, other: Opening) -> bool:
    """Return whether two openings are about as long, and rather beside than above each other."""
    x, y, z = np.abs(one.center - other.center)
    return other.perimeter < ALIKE * one.perimeter and bool(np.hypot(x, z) > y)
