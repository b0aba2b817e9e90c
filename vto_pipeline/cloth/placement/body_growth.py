"""How a garment begins about a thin body that grows inside it: where it is led, and from how thin a body.

Cloth is pushed outwards as the body grows. The thinner that begins, the less room it takes from a garment that lies
anyhow; but limbs that are lines hold nothing off: a sleeve that straightens springs through them. So what still crosses
is untangled, about the thickest body from which that goes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.cloth.model.coarsening import CoarseGarment, coarsen
from vto_pipeline.cloth.placement.clear_body import OVERSTRETCHED, edge_stretches
from vto_pipeline.cloth.placement.collision_free_start import find_collision_free_start
from vto_pipeline.cloth.placement.flexible_escape import escape_flexibly
from vto_pipeline.cloth.placement.limbs.lead import lead_onto_limbs
from vto_pipeline.cloth.placement.limbs.openings import Piece, pieces_with_limbs
from vto_pipeline.cloth.placement.rigid_escape import escape_rigidly
from vto_pipeline.cloth.placement.thinning import LINES, BodyGrowth, Thinning
from vto_pipeline.errors import GarmentError, InputError
from vto_pipeline.geometry.laplace import laplacian
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import close_openings
from vto_pipeline.model.garment import Garment, RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

_FEW = 1500  # vertices of a garment that is led
_LED_BY = (0, 3, 6)  # steps of thinning after which the garment is led about the body: the thin one leaves room
_FREED_AFTER = (0, 1, 2, 4, 8)  # steps of thinning after which it is untangled: each try may take as long as all else
_STILL_WORN = 0.5  # of the body's surface that was in the garment: with less, it is led to another part of the body
_SOON = 0.01  # pairs for each triangle of the garment: so few are soon parted
_LARGER = (1.1, 1.2, 1.35, 1.5)  # times: so much it may start larger than it is
_LED_LARGER = 1.2  # times, to be led: small enough for sleeves to stay near their arms


def plan_body_growth(body: TriangleMesh, garment: TriangleMesh, job: Job, thickness: float = 0.0) -> BodyGrowth:
    """Return the body's growth, from the thickest at which it does not cross the garment, or that was freed from it.

    Where it crosses however thin, or a limb goes through another opening than is there for it, the garment is not about
    the body, and is led there first (`lead_to_body`). Where a body thinned by fewer steps crosses it, it is untangled
    from that one, if it goes. A garment that is too small for where it is worn, and comes free of none, starts larger:
    tight is no reason to be worn elsewhere, a skirt about the neck.

    Args:
        body: Closed or with holes [m].
        garment: In its place about the body [m].
        job: Warned when the garment is led, or no thinning gets the body clear of it.
        thickness: Gap to leave where something is untangled [m].
    """
    best = lead_to_body(body, garment, job)
    if best.garment is not garment:
        way = 1e3 * np.linalg.norm(best.garment.vertices - garment.vertices, axis=1)
        job.warn(
            f"the garment does not surround the body as it stands; it was moved by {np.median(way):.0f} mm (median), "
            f"{way.max():.0f} mm at most, before the body grows"
        )
    best = _freed(best, thickness)
    if best.crossing > 0:
        best = _larger(best, job)
    if best.crossing > 0:
        job.warn(
            f"the garment does not surround the body: {best.crossing} pairs of triangles cross it even at its thinnest"
        )
    return best


def lead_to_body(body: TriangleMesh, garment: TriangleMesh, job: Job) -> BodyGrowth:
    """Return the body's growth inside the garment, led sleeve by sleeve, as a whole or part by part, where need be.

    Of all that is tried and is still worn there, the one with the fewest limbs through cloth is taken, which no move
    of a little frees; among these that with the fewest limbs astray, and the least to part about a body thinned once.
    Where limbs go through cloth however it is led, it starts larger: they may find their openings then.

    Args:
        body, garment, job: As for `plan_body_growth`.
    """
    thinning = Thinning(body)
    best = _least_faulty(thinning, garment)
    if best.pierced > 0:
        larger = _least_faulty(thinning, _times_larger(garment, _LED_LARGER))
        if larger.astray == 0:
            job.warn(f"too small: it starts {_LED_LARGER - 1:.0%} larger, for limbs to find their openings")
            best = larger
    return best


def _least_faulty(thinning: Thinning, garment: TriangleMesh) -> BodyGrowth:
    """Return the growth with the fewest faults, of the garment where it is and wherever it is led."""
    body = thinning.after(0)
    first = best = thinning.growth(garment)
    if first.fault == (0, 0):
        return first
    soon = _SOON * len(garment.faces)
    is_worn = _still_worn(garment, body)

    def is_good(growth: BodyGrowth) -> bool:
        return growth.astray == 0 and growth.to_part <= soon

    def best_of(ways: Iterable[TriangleMesh], best: BodyGrowth) -> BodyGrowth:
        for led in ways:
            if is_worn(led):
                best = min(best, thinning.growth(led), key=lambda one: (one.pierced, one.astray, one.to_part))
            if is_good(best):
                break
        return best

    astray, few = first.astray > 0, _few_vertices(garment)
    if few is not None:
        pieces = pieces_with_limbs(few.garment.mesh, thinning.limbs, thinning.after(LINES))
        ways = _led(few.garment.mesh, pieces, thinning, astray=astray)
        best = best_of((TriangleMesh(few.prolong(led.vertices), garment.faces) for led in ways), best)
    if few is None:
        best = best_of(_led(garment, first.pieces, thinning, astray=astray), best)
    return best


def _led(garment: TriangleMesh, pieces: list[Piece], thinning: Thinning, *, astray: bool) -> Iterator[TriangleMesh]:
    """Yield the garment led onto the limbs, as a whole, and each of these and itself part by part."""
    body = thinning.after(0)
    onto = lead_onto_limbs(garment, body, thinning.limbs, thinning.after(LINES), pieces)
    whole = TriangleMesh(escape_rigidly(body, garment), garment.faces)
    yield onto
    yield whole
    for led in (onto, garment, whole) if astray else (garment, whole, onto):
        for steps in _LED_BY:
            led = TriangleMesh(escape_flexibly(thinning.after(steps), led), garment.faces)
            yield led


def _few_vertices(garment: TriangleMesh) -> CoarseGarment | None:
    """Return the garment in fewer triangles, which the others follow; None where it has few, or must keep them.

    Cloth that keeps its shape goes a few edges a round: a fine garment takes long to be led, and may not get there.
    """
    if len(garment.vertices) <= _FEW:
        return None
    try:
        return coarsen(Garment(garment, RestShape(garment.vertices)), _FEW)
    except (InputError, GarmentError):
        return None


def _freed(growth: BodyGrowth, thickness: float) -> BodyGrowth:
    """Return the growth with the garment untangled from the thickest body that lets go of it; as it was if none does.

    No limb may go through it then, nor cloth be drawn out as by what it is caught in; and it is still about the body.
    """
    x, faces, full = growth.garment.vertices, growth.garment.faces, growth.thinning.after(0)
    if not _enclosed(growth.garment, full).any():  # it would be put beside the body
        return growth
    is_worn = _still_worn(growth.garment, full)
    for steps in (steps for steps in _FREED_AFTER if steps < growth.thinned):
        body = growth.thinning.after(steps)
        start = find_collision_free_start(x, faces, x, thickness, Job(), body)
        if start.crossings_left > 0 or edge_stretches(start.positions, x, faces).max() > OVERSTRETCHED:
            continue
        freed = growth.thinning.growth_from(TriangleMesh(start.positions, faces, growth.garment.colors), steps)
        outside = not SurfaceDistance(body).inside(start.positions).any()
        if outside and freed.astray <= growth.astray and is_worn(freed.garment):
            return freed._replace(otherwise=growth)
    return growth


def _larger(tight: BodyGrowth, job: Job) -> BodyGrowth:
    """Return the growth with the garment so much larger about its middle that nothing crosses; as it was if none is."""
    for times in _LARGER:
        larger = tight.thinning.growth(_times_larger(tight.garment, times))
        if larger.fault == (0, 0):
            job.warn(f"too small: it starts {times - 1:.0%} larger, where it is worn")
            return larger
    return tight


def _times_larger(garment: TriangleMesh, times: float) -> TriangleMesh:
    """Return the garment so many times as large, about its middle."""
    middle = garment.vertices.mean(axis=0)
    return TriangleMesh(middle + times * (garment.vertices - middle), garment.faces)


def _still_worn(garment: TriangleMesh, body: TriangleMesh) -> Callable[[TriangleMesh], bool]:
    """Return what tells of a garment that was moved whether it is worn where it was: around the same of the body."""
    area, worn = laplacian(body)[1], _enclosed(garment, body)
    enough = _STILL_WORN * area[worn].sum()
    return lambda moved: bool(area[worn & _enclosed(moved, body)].sum() >= enough)


def _enclosed(garment: TriangleMesh, body: TriangleMesh) -> NDArray[np.bool_]:
    """Return which of the body's vertices lie inside the garment, its openings closed, shape (V,)."""
    return SurfaceDistance(close_openings(garment)).inside(body.vertices)
