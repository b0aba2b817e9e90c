"""A body that grows from thin to full inside the garment, so that cloth it was never in is pushed out the right way.

Mean curvature flow shrinks limbs towards their axes and leaves them where they are along their length. Run backwards
it is a motion like any other, and the drape needs no further means. Kazhdan, Solomon & Ben-Chen 2012: with the
Laplacian of the first shape kept, the flow does not pinch off necks.
"""

from __future__ import annotations

import numpy as np

from vto_pipeline.geometry.intersections import intersecting_faces
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

_STEP = 1e-3  # m²: a limb of radius r shrinks by exp(-1e-3 / r²) a step, a wrist of 30 mm to a third
_MOST = 12  # steps: an arm is a line long before, and a torso still two thirds


def growing(body: TriangleMesh, garment: TriangleMesh, job: Job) -> MovingBody:
    """Return the body's growth, from the least thinning at which it no longer crosses the garment.

    Args:
        body: Closed or with holes [m].
        garment: In its place about the body [m].
        job: Warned when no thinning gets the body clear of the garment.
    """
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
    if crossing:
        job.warn(f"the garment does not surround the body: {crossing} pairs of triangles cross even the thinnest body")
    return MovingBody(np.stack(frames[::-1]), body.faces)
