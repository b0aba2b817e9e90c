"""Growth of a body from thin to full inside the garment, so that cloth is pushed outwards.

Mean curvature flow shrinks limbs towards their axes and leaves them where they are along their length. Run backwards
it is a motion like any other, and the drape needs no further means. Kazhdan, Solomon & Ben-Chen 2012: with the
Laplacian of the first shape kept, the flow does not pinch off necks.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vto_pipeline.cloth.placement.rigid_escape import escape_rigidly
from vto_pipeline.geometry.intersections import intersecting_faces
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

_STEP = 1e-3  # m²: a limb of radius r shrinks by exp(-1e-3 / r²) a step, a wrist of 30 mm to a third
_MOST = 12  # steps: an arm is a line long before, and a torso still two thirds


class BodyGrowth(NamedTuple):
    """The growth of a body, and its garment.

    Args:
        garment: Where it is when the body begins to grow.
        body: From thin to full.
    """

    garment: TriangleMesh
    body: MovingBody


def plan_body_growth(body: TriangleMesh, garment: TriangleMesh, job: Job) -> BodyGrowth:
    """Return the body's growth, from the least thinning at which it no longer crosses the garment.

    Where it crosses however thin, the garment is not about the body, and is led there as a whole if that helps.

    Args:
        body: Closed or with holes [m].
        garment: In its place about the body [m].
        job: Warned when the garment is led, or no thinning gets the body clear of it.
    """
    grown, crossing = _thin_until_clear(body, garment)
    if not crossing:
        return BodyGrowth(garment, grown)
    led = TriangleMesh(escape_rigidly(body, garment), garment.faces)
    about, still = _thin_until_clear(body, led)
    if still:
        job.warn(f"the garment does not surround the body: {crossing} pairs of triangles cross it even at its thinnest")
        return BodyGrowth(garment, grown)
    way = 1e3 * (led.vertices - garment.vertices).mean(axis=0)
    job.warn(
        f"the garment does not surround the body as it stands; it was moved by "
        f"({', '.join(f'{part:.0f}' for part in way)}) mm (x, y, z) before the body grows"
    )
    return BodyGrowth(led, about)


def _thin_until_clear(body: TriangleMesh, garment: TriangleMesh) -> tuple[MovingBody, int]:
    """Return the body's growth from the least sufficient thinning, or the most, and the pairs that cross."""
    import igl
    from scipy.sparse.linalg import splu

    faces = body.faces.astype("i8")
    mass = igl.massmatrix(body.vertices, faces, igl.MASSMATRIX_TYPE_BARYCENTRIC)
    flow = splu((mass - _STEP * igl.cotmatrix(body.vertices, faces)).tocsc())
    frames = [body.vertices]
    crossing = len(intersecting_faces(garment, body))
    while crossing and len(frames) <= _MOST:
        frames.append(flow.solve(mass @ frames[-1]))
        crossing = len(intersecting_faces(garment, TriangleMesh(frames[-1], body.faces)))
    return MovingBody(np.stack(frames[::-1]), body.faces), crossing
