"""Growth of a body from thin to full inside the garment, so that cloth is pushed outwards.

Mean curvature flow shrinks limbs towards their axes and leaves them where they are along their length. Run backwards
it is a motion like any other, and the drape needs no further means. Kazhdan, Solomon & Ben-Chen 2012: with the
Laplacian of the first shape kept, the flow does not pinch off necks.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import diags
from scipy.sparse.linalg import splu

from vto_pipeline.cloth.model.coarsening import CoarseGarment, coarsen
from vto_pipeline.cloth.placement.flexible_escape import escape_flexibly
from vto_pipeline.cloth.placement.limbs.lead import lead_onto_limbs
from vto_pipeline.cloth.placement.limbs.limbs import Limb, Limbs
from vto_pipeline.cloth.placement.limbs.openings import Piece, pieces_with_limbs
from vto_pipeline.cloth.placement.rigid_escape import escape_rigidly
from vto_pipeline.cloth.placement.voxel_fit import close_openings
from vto_pipeline.errors import GarmentError, InputError, IntersectingError
from vto_pipeline.geometry.intersections import intersecting_faces, self_intersections
from vto_pipeline.geometry.laplace import laplacian
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.garment import Garment, RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

_STEP = 1e-3  # m²: a limb of radius r shrinks by exp(-1e-3 / r²) a step, a wrist of 30 mm to a third
_MOST = 12  # steps: an arm is a line long before, and a torso still two thirds
_LINES = 6  # steps after which limbs are lines
_FEW = 1500  # vertices of a garment that is led
_LED_BY = (0, 3, 6)  # steps of thinning after which the garment is led about the body: the thin one leaves room
_STILL_WORN = 0.5  # of the body's surface that was in the garment: with less, it is led to another part of the body
_LARGER = (1.1, 1.2, 1.35, 1.5)  # times: so much it may start larger than it is
_OVER, _UNDER = 0.05, 0.1  # of the stature: no opening is so far above where its limb joins, no neckline so far below
_UNDER_ARMS = 0.02  # of the stature: so far above where arms join the body may hang what is held by a chest
_SHOULDER = 0.06  # of the stature, from neck to shoulder
_STEEP = 0.8  # sine of the slope of what hangs, beside its opening: waists have 0.9, necks and ponchos 0.5 to 0.7
_LED_LARGER = 1.2  # times, to be led: small enough for sleeves to stay near their arms


class BodyGrowth(NamedTuple):
    """The growth of a body, and its garment.

    Args:
        garment: Where it is when the body begins to grow.
        body: From thin to full.
        crossing: Pairs of triangles of both that meet at the begin.
        tangled: Pairs of its own triangles that meet there.
        pieces: Of the garment, with what the limbs do there.
        names: Of the limbs.
    """

    garment: TriangleMesh
    body: MovingBody
    crossing: int
    tangled: int
    pieces: list[Piece]
    names: list[str]

    @property
    def fault(self) -> tuple[int, int]:
        """What is wrong with the begin: pairs that cross, and limbs that go where they are not meant to."""
        return self.crossing + self.tangled, sum(len(piece.astray()) for piece in self.pieces)

    @property
    def thinned(self) -> int:
        """After how many steps of thinning the body begins."""
        return len(self.body.keyframes) - 1

    @property
    def pierced(self) -> int:
        """How many limbs go through cloth."""
        return sum(len(places) > 0 for piece in self.pieces for places in piece.pierced)

    def from_smaller(self, times: float) -> BodyGrowth:
        """Return it with garment and body so many times smaller at the begin: the body grows in size, too.

        All lies as before, but a garment that was enlarged is not stretched. It would snap together about a thin body,
        and jam there.

        Args:
            times: How much larger than it is the garment starts, at least 1.
        """
        frames = self.body.keyframes if self.thinned > 0 else np.repeat(self.body.keyframes, 2, axis=0)
        middle = self.garment.vertices.mean(axis=0)
        size = np.linspace(1.0 / times, 1.0, len(frames))[:, None, None]
        garment = TriangleMesh(middle + (self.garment.vertices - middle) / times, self.garment.faces)
        return self._replace(garment=garment, body=MovingBody(middle + size * (frames - middle), self.body.faces))

    def refuse_pierced(self) -> None:
        """Raise an error if a limb goes through cloth: nothing that moves cloth a little can free it.

        Raises:
            IntersectingError: with the limbs and places; `partial` holds the garment there as "draped".
        """
        found = []
        for piece in self.pieces:
            for limb, places in enumerate(piece.pierced):
                if len(places):
                    at = ", ".join(f"{x:.2f}" for x in places[0])
                    found.append(f"the {self.names[limb]} goes through the cloth at ({at}){piece.missed(limb)}")
        if found:
            raise IntersectingError(
                f"the garment cannot be put on: {'; '.join(found)}",
                hint="are its openings open, and is it meant for this body? drape.place=as_it_stands keeps a place "
                "that was chosen by hand",
                partial={"draped": self.garment},
            )


def plan_body_growth(body: TriangleMesh, garment: TriangleMesh, job: Job) -> BodyGrowth:
    """Return the body's growth, from the least thinning at which it no longer crosses the garment.

    Where it crosses however thin, or a limb goes through another opening than is there for it, the garment is not about
    the body, and is led there: sleeve by sleeve onto the limbs, as a whole, part by part about the body, and about
    thinner ones. Of all that was tried and is still worn there, the one with the fewest limbs through cloth is taken,
    which no move of a little frees; among these that with the least crossing and the fewest limbs astray. Where a way
    is free of faults only about limbs thinned to lines, further ones are tried: that body has far to grow, through
    cloth that lies anyhow about it.

    A garment that is too small for where it is worn starts larger: tight is no reason to be worn elsewhere, a skirt
    about the neck. So it does where limbs go through cloth however it is led: they may find their openings then.

    Args:
        body: Closed or with holes [m].
        garment: In its place about the body [m].
        job: Warned when the garment is led, or no thinning gets the body clear of it.
    """
    thinning = Thinning(body)
    best = _least_faulty(thinning, garment)
    if best.pierced > 0:
        larger = _least_faulty(thinning, _times_larger(garment, _LED_LARGER))
        if larger.fault == (0, 0):
            job.warn(f"too small: it starts {_LED_LARGER - 1:.0%} larger, for limbs to find their openings")
            best = larger
    if best.garment is not garment:
        way = 1e3 * np.linalg.norm(best.garment.vertices - garment.vertices, axis=1)
        job.warn(
            f"the garment does not surround the body as it stands; it was moved by {np.median(way):.0f} mm (median), "
            f"{way.max():.0f} mm at most, before the body grows"
        )
    if best.crossing > 0:
        best = _larger(best, thinning, job)
    if best.crossing > 0:
        job.warn(
            f"the garment does not surround the body: {best.crossing} pairs of triangles cross it even at its thinnest"
        )
    return best


def _least_faulty(thinning: Thinning, garment: TriangleMesh) -> BodyGrowth:
    """Return the growth with the fewest faults, of the garment where it is and wherever it is led."""
    body = thinning.after(0)
    first = best = thinning.growth(garment)
    if first.fault == (0, 0):
        return first
    area, worn = laplacian(body)[1], _enclosed(garment, body)
    enough = _STILL_WORN * area[worn].sum()

    def best_of(ways: Iterable[TriangleMesh], best: BodyGrowth) -> BodyGrowth:
        for led in ways:
            if area[worn & _enclosed(led, body)].sum() >= enough:
                best = min(best, thinning.growth(led), key=lambda one: (one.pierced, *one.fault, one.thinned))
            if best.fault == (0, 0) and best.thinned < _LINES:
                break
        return best

    astray, few = first.fault[1] > 0, _few_vertices(garment)
    if few is not None:
        pieces = pieces_with_limbs(few.garment.mesh, thinning.limbs, thinning.after(_LINES))
        ways = _led(few.garment.mesh, pieces, thinning, astray=astray)
        best = best_of((TriangleMesh(few.prolong(led.vertices), garment.faces) for led in ways), best)
    if few is None or (best.pierced == 0 and best.fault != (0, 0)):  # limbs that few do not free, all do not, either
        best = best_of(_led(garment, first.pieces, thinning, astray=astray), best)
    return best


def _led(garment: TriangleMesh, pieces: list[Piece], thinning: Thinning, *, astray: bool) -> Iterator[TriangleMesh]:
    """Yield the garment led onto the limbs, as a whole, and each of these and itself part by part."""
    body = thinning.after(0)
    onto = lead_onto_limbs(garment, body, thinning.limbs, thinning.after(_LINES), pieces)
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


def _larger(tight: BodyGrowth, thinning: Thinning, job: Job) -> BodyGrowth:
    """Return the growth with the garment so much larger about its middle that nothing crosses; as it was if none is."""
    for times in _LARGER:
        larger = thinning.growth(_times_larger(tight.garment, times))
        if larger.fault == (0, 0):
            job.warn(f"too small: it starts {times - 1:.0%} larger, where it is worn")
            return larger
    return tight


def _times_larger(garment: TriangleMesh, times: float) -> TriangleMesh:
    """Return the garment so many times as large, about its middle."""
    middle = garment.vertices.mean(axis=0)
    return TriangleMesh(middle + times * (garment.vertices - middle), garment.faces)


def _enclosed(garment: TriangleMesh, body: TriangleMesh) -> NDArray[np.bool_]:
    """Return which of the body's vertices lie inside the garment, its openings closed, shape (V,)."""
    return SurfaceDistance(close_openings(garment)).inside(body.vertices)


class Thinning:
    """A body and its thinner ones, made as they are asked for.

    The flow lets the webs of armpits and crotch sag out of the body, onto cloth that lies close there: what would leave
    it is put back onto its skin.
    """

    def __init__(self, body: TriangleMesh) -> None:
        matrix, self._area = laplacian(body)
        self._flow = splu((diags(self._area) + _STEP * matrix).tocsc())
        self._faces = body.faces
        self._frames = [body.vertices]
        self._skin = SurfaceDistance(body)
        self.limbs = Limbs(body)

    def after(self, steps: int) -> TriangleMesh:
        """Return the body after so many steps of the flow."""
        while len(self._frames) <= steps:
            thinner = self._flow.solve(self._area[:, None] * self._frames[-1])
            out = self._skin.signed(thinner)
            self._frames.append(np.where((out.distance > 0.0)[:, None], out.point, thinner))
        return TriangleMesh(self._frames[steps], self._faces)

    def growth(self, garment: TriangleMesh) -> BodyGrowth:
        """Return the growth from the least sufficient thinning, or from that which crosses least."""
        crossing = [len(intersecting_faces(garment, self.after(0)))]
        while crossing[-1] and len(crossing) <= _MOST:
            crossing.append(len(intersecting_faces(garment, self.after(len(crossing)))))
        least = int(np.argmin(crossing))
        grown = MovingBody(np.stack(self._frames[least::-1]), self._faces)
        pieces = pieces_with_limbs(garment, self.limbs, self.after(least))
        tangled = len(self_intersections(garment))
        return BodyGrowth(garment, grown, crossing[least], tangled, pieces, [limb.name for limb in self.limbs.limbs])

    def limbs_astray(self, garment: TriangleMesh) -> int:
        """Return how many limbs go through cloth or another opening than their own, here and with sleeves on arms.

        That puts some limbs right and others wrong: what is well in one of both can be led there.
        """
        thin = self.after(_LINES)
        pieces = pieces_with_limbs(garment, self.limbs, thin)
        here = [piece.misplaced() for piece in pieces]
        if not any(here):
            return 0
        led = lead_onto_limbs(garment, self.after(0), self.limbs, thin, pieces)
        there = [piece.misplaced() for piece in pieces_with_limbs(led, self.limbs, thin)]
        return sum(len(one & other) for one, other in zip(here, there, strict=True))

    def limbs_out_of_place(self, garment: TriangleMesh) -> int:
        """Return how many limbs tell that a garment is not worn at this height.

        These are arms in the way of what hangs: they go through its cloth, or join the body below its upper opening.
        And a head whose own opening is far from the neck.
        """
        count = 0
        for piece in pieces_with_limbs(garment, self.limbs, self.after(_LINES)):
            above = self._hangs_from(piece)
            for number, limb in enumerate(self.limbs.limbs):
                if above is not None and limb.name.endswith("arm"):
                    count += len(piece.pierced[number]) > 0 or self._over(piece, above, limb).max() > _UNDER_ARMS
                elif limb.name == "head" and number in piece.alone():
                    over = self._over(piece, piece.meant[number], limb)
                    count += over.min() > _OVER or over.max() < -_UNDER
        return count

    def hangs(self, garment: TriangleMesh) -> bool:
        """Return whether a garment hangs about the trunk as a tube, and may slide: trousers and sleeves hold others."""
        pieces = pieces_with_limbs(garment, self.limbs, self.after(_LINES))
        return all(self._hangs_from(piece) is not None and len(set(piece.meant)) == 2 for piece in pieces)

    def neck_lean(self, garment: TriangleMesh) -> float | None:
        """Return how far forward the plane of an opening for the head alone leans [rad]; None where there is none."""
        head = next((number for number, limb in enumerate(self.limbs.limbs) if limb.name == "head"), -1)
        for piece in pieces_with_limbs(garment, self.limbs, self.after(_LINES)):
            if head in piece.alone():
                area = piece.area_vector(piece.meant[head])
                return float(np.arctan2(area @ self.limbs.ahead, area[1]))
        return None

    def tells_too_small(self, garment: TriangleMesh) -> bool:
        """Return whether a garment that a person fills better when larger may be too small to be worn where it is."""
        if all(limb.name != "head" for limb in self.limbs.limbs):
            return False
        return self.hangs(garment) or self.limbs_out_of_place(garment) > 0 or self.limbs_astray(garment) > 0

    def is_below_arms(self, garment: TriangleMesh) -> bool:
        """Return whether all of a garment is below where the arms join the body."""
        roots = [limb.root[1] for limb in self.limbs.limbs if limb.name.endswith("arm")]
        return bool(garment.vertices[:, 1].max() - min(roots) <= _UNDER_ARMS * self._stature)

    @property
    def _stature(self) -> float:
        return float(np.ptp(self.after(0).vertices[:, 1]))

    def _over(self, piece: Piece, opening: int, limb: Limb) -> FloatArray:
        """Return how far above where a limb joins the body an opening is, as shares of the stature, shape (N,)."""
        return np.asarray((piece.mesh.vertices[piece.openings[opening], 1] - limb.root[1]) / self._stature)

    def _hangs_from(self, piece: Piece) -> int | None:
        """Return the upper opening of what has none for one arm and is steep there, as no poncho is."""
        names = [limb.name for limb in self.limbs.limbs]
        ways = {way for name, way in zip(names, piece.meant, strict=True) if name.endswith("arm")}
        if len(ways) != 1 or -1 in ways or "head" not in names:
            return None
        above = piece.meant[names.index("head")]
        return above if piece.steepness(above, _SHOULDER * self._stature) > _STEEP else None
