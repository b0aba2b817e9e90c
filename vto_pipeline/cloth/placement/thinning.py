"""A body and its thinner ones, and its growth back from thin to full inside a garment.

Mean curvature flow shrinks limbs towards their axes and leaves them where they are along their length. Run backwards
it is a motion like any other, and the drape needs no further means. Kazhdan, Solomon & Ben-Chen 2012: with the
Laplacian of the first shape kept, the flow does not pinch off necks.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import diags
from scipy.sparse.linalg import splu

from vto_pipeline.cloth.placement.limbs.lead import lead_onto_limbs
from vto_pipeline.cloth.placement.limbs.limbs import Limb, Limbs
from vto_pipeline.cloth.placement.limbs.openings import Piece, pieces_with_limbs
from vto_pipeline.errors import IntersectingError
from vto_pipeline.geometry.intersections import intersecting_faces, self_intersections
from vto_pipeline.geometry.laplace import laplacian
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.mesh import TriangleMesh

LINES = 6
"""Steps of thinning after which limbs are lines."""

_STEP = 1e-3  # m²: a limb of radius r shrinks by exp(-1e-3 / r²) a step, a wrist of 30 mm to a third
_MOST = 12  # steps: an arm is a line long before, and a torso still two thirds
_OVER, _UNDER = 0.05, 0.1  # of the stature: no opening is so far above where its limb joins, no neckline so far below
_UNDER_ARMS = 0.02  # of the stature: so far above where arms join the body may hang what is held by a chest
_SHOULDER = 0.06  # of the stature, from neck to shoulder
_STEEP = 0.8  # sine of the slope of what hangs, beside its opening: waists have 0.9, necks and ponchos 0.5 to 0.7


class BodyGrowth(NamedTuple):
    """The growth of a body, and its garment.

    Args:
        garment: Where it is when the body begins to grow.
        body: From thin to full.
        crossing: Pairs of triangles of both that meet at the begin.
        tangled: Pairs of its own triangles that meet there.
        to_part: Pairs of both that meet about a body thinned once, and its own.
        pieces: Of the garment, with what the limbs do there.
        thinning: Of the body.
        otherwise: From a thinner body, for cloth that jams on this way; none where this is the thinnest.
    """

    garment: TriangleMesh
    body: MovingBody
    crossing: int
    tangled: int
    to_part: int
    pieces: list[Piece]
    thinning: Thinning
    otherwise: BodyGrowth | None = None

    @property
    def astray(self) -> int:
        """How many limbs go through cloth, or another opening than is there for them."""
        return sum(len(piece.astray()) for piece in self.pieces)

    @property
    def fault(self) -> tuple[int, int]:
        """What is wrong with the begin: pairs that cross, and limbs that go where they are not meant to."""
        return self.crossing + self.tangled, self.astray

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
                    name = self.thinning.limbs.limbs[limb].name
                    found.append(f"the {name} goes through the cloth at ({at}){piece.missed(limb)}")
        if found:
            raise IntersectingError(
                f"the garment cannot be put on: {'; '.join(found)}",
                hint="are its openings open, and is it meant for this body? drape.place=as_it_stands keeps a place "
                "that was chosen by hand",
                partial={"draped": self.garment},
            )


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
        return self._growth_from(garment, least, pieces_with_limbs(garment, self.limbs, self.after(least)))

    def growth_from(self, garment: TriangleMesh, steps: int) -> BodyGrowth:
        """Return the growth from so many steps of thinning, whatever crosses there.

        Lines stray out of the body, past an armpit: no limb is where one meets cloth there.
        """
        body = SurfaceDistance(self.after(steps))
        pieces = [
            piece._replace(pierced=[places[body.signed(places).distance < 0.0] for places in piece.pierced])
            for piece in pieces_with_limbs(garment, self.limbs, self.after(LINES))
        ]
        return self._growth_from(garment, steps, pieces)

    def _growth_from(self, garment: TriangleMesh, steps: int, pieces: list[Piece]) -> BodyGrowth:
        tangled = len(self_intersections(garment))
        crossing, once = (len(intersecting_faces(garment, self.after(k))) for k in (steps, 1))
        grown = MovingBody(np.stack(self._frames[steps::-1]), self._faces)
        return BodyGrowth(garment, grown, crossing, tangled, once + tangled, pieces, self)

    def limbs_astray(self, garment: TriangleMesh) -> int:
        """Return how many limbs go through cloth or another opening than their own, here and with sleeves on arms.

        That puts some limbs right and others wrong: what is well in one of both can be led there.
        """
        thin = self.after(LINES)
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
        And a head whose own opening is far from the neck, or all under it where arms have theirs: an open front is a
        part of the opening for the head.
        """
        count = 0
        for piece in pieces_with_limbs(garment, self.limbs, self.after(LINES)):
            above, alone = self._hangs_from(piece), piece.alone()
            armed = any(self.limbs.limbs[number].name.endswith("arm") for number in alone)
            for number, limb in enumerate(self.limbs.limbs):
                if above is not None and limb.name.endswith("arm"):
                    count += len(piece.pierced[number]) > 0 or self._over_nearest(piece, above, limb) > _UNDER_ARMS
                elif limb.name == "head" and (number in alone or armed):
                    over = self._over(piece, piece.meant[number], limb)
                    count += over.max() < -_UNDER or (number in alone and over.min() > _OVER)
        return count

    def hangs(self, garment: TriangleMesh) -> bool:
        """Return whether a garment hangs about the trunk as a tube, and may slide: trousers and sleeves hold others."""
        pieces = pieces_with_limbs(garment, self.limbs, self.after(LINES))
        return all(self._hangs_from(piece) is not None and len(set(piece.meant)) == 2 for piece in pieces)

    def neck_lean(self, garment: TriangleMesh) -> float | None:
        """Return how far forward the plane of an opening for the head alone leans [rad]; None where there is none."""
        head = next((number for number, limb in enumerate(self.limbs.limbs) if limb.name == "head"), -1)
        for piece in pieces_with_limbs(garment, self.limbs, self.after(LINES)):
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

    def _over_nearest(self, piece: Piece, opening: int, limb: Limb) -> float:
        """Return the same where the opening is nearest to that place: straps go over shoulders, between the arms."""
        nearest = np.linalg.norm(piece.mesh.vertices[piece.openings[opening]] - limb.root, axis=1).argmin()
        return float(self._over(piece, opening, limb)[nearest])

    def _hangs_from(self, piece: Piece) -> int | None:
        """Return the upper opening of what has none for one arm and is steep there, as no poncho is."""
        names = [limb.name for limb in self.limbs.limbs]
        ways = {way for name, way in zip(names, piece.meant, strict=True) if name.endswith("arm")}
        if len(ways) != 1 or -1 in ways or "head" not in names:
            return None
        above = piece.meant[names.index("head")]
        return above if piece.steepness(above, _SHOULDER * self._stature) > _STEEP else None
