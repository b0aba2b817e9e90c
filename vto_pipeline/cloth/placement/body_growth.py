"""Growth of a body from thin to full inside the garment, so that cloth is pushed outwards.

Mean curvature flow shrinks limbs towards their axes and leaves them where they are along their length. Run backwards
it is a motion like any other, and the drape needs no further means. Kazhdan, Solomon & Ben-Chen 2012: with the
Laplacian of the first shape kept, the flow does not pinch off necks.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vto_pipeline.cloth.placement.flexible_escape import escape_flexibly
from vto_pipeline.cloth.placement.rigid_escape import escape_rigidly
from vto_pipeline.cloth.placement.voxel_fit import close_openings
from vto_pipeline.geometry.intersections import intersecting_faces
from vto_pipeline.geometry.laplace import laplacian
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

_STEP = 1e-3  # m²: a limb of radius r shrinks by exp(-1e-3 / r²) a step, a wrist of 30 mm to a third
_MOST = 12  # steps: an arm is a line long before, and a torso still two thirds
_LED_BY = (0, 3, 6)  # steps of thinning after which the garment is led about the body: the thin one leaves room
_STILL_WORN = 0.8  # of the body's surface in the garment: with less, it has been led off the body


class BodyGrowth(NamedTuple):
    """The growth of a body, and its garment.

    Args:
        garment: Where it is when the body begins to grow.
        body: From thin to full.
        crossing: Pairs of triangles of both that meet at the begin.
    """

    garment: TriangleMesh
    body: MovingBody
    crossing: int


def plan_body_growth(body: TriangleMesh, garment: TriangleMesh, job: Job) -> BodyGrowth:
    """Return the body's growth, from the least thinning at which it no longer crosses the garment.

    Where it crosses however thin, the garment is not about the body, and is led there if that helps: as a whole, then
    part by part about the body, and about thinner ones. Of all that was tried and is still worn, the least crossing is
    taken.

    Args:
        body: Closed or with holes [m].
        garment: In its place about the body [m].
        job: Warned when the garment is led, or no thinning gets the body clear of it.
    """
    thinning = _Thinning(body)
    first = thinning.growth(garment)
    if first.crossing == 0:
        return first
    enough, best = _STILL_WORN * _enclosed(garment, body), first
    for led in _led(garment, thinning):
        if _enclosed(led, body) >= enough:
            best = min(best, thinning.growth(led), key=lambda one: one.crossing)
        if best.crossing == 0:
            break
    if best is not first:
        way = 1e3 * np.linalg.norm(best.garment.vertices - garment.vertices, axis=1)
        job.warn(
            f"the garment does not surround the body as it stands; it was moved by {np.median(way):.0f} mm (median), "
            f"{way.max():.0f} mm at most, before the body grows"
        )
    if best.crossing > 0:
        job.warn(
            f"the garment does not surround the body: {best.crossing} pairs of triangles cross it even at its thinnest"
        )
    return best


def _led(garment: TriangleMesh, thinning: _Thinning) -> Iterator[TriangleMesh]:
    """Yield the garment led as a whole, then part by part, from where it is and from there."""
    whole = TriangleMesh(escape_rigidly(thinning.after(0), garment), garment.faces)
    yield whole
    for led in (garment, whole):
        for steps in _LED_BY:
            led = TriangleMesh(escape_flexibly(thinning.after(steps), led), garment.faces)
            yield led


def _enclosed(garment: TriangleMesh, body: TriangleMesh) -> float:
    """Return how much of the body's surface lies inside the garment, its openings closed [m²]."""
    inside = SurfaceDistance(close_openings(garment)).inside(body.vertices)
    return float(laplacian(body)[1][inside].sum())


class _Thinning:
    """A body and its thinner ones, made as they are asked for."""

    def __init__(self, body: TriangleMesh) -> None:
        import igl
        from scipy.sparse.linalg import splu

        faces = body.faces.astype("i8")
        self._mass = igl.massmatrix(body.vertices, faces, igl.MASSMATRIX_TYPE_BARYCENTRIC)
        self._flow = splu((self._mass - _STEP * igl.cotmatrix(body.vertices, faces)).tocsc())
        self._faces = body.faces
        self._frames = [body.vertices]

    def after(self, steps: int) -> TriangleMesh:
        """Return the body after so many steps of the flow."""
        while len(self._frames) <= steps:
            self._frames.append(self._flow.solve(self._mass @ self._frames[-1]))
        return TriangleMesh(self._frames[steps], self._faces)

    def growth(self, garment: TriangleMesh) -> BodyGrowth:
        """Return the growth from the least sufficient thinning, or from that which crosses least."""
        crossing = [len(intersecting_faces(garment, self.after(0)))]
        while crossing[-1] and len(crossing) <= _MOST:
            crossing.append(len(intersecting_faces(garment, self.after(len(crossing)))))
        least = int(np.argmin(crossing))
        return BodyGrowth(garment, MovingBody(np.stack(self._frames[least::-1]), self._faces), crossing[least])
