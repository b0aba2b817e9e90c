"""Contour minimisation: motions of edges and faces that shorten an intersection contour.

Volino & Magnenat-Thalmann 2006, "Resolving surface collisions through intersection contour minimization". The contour
is a polygon of crossings. One of edge e (unit) with a face of normal n follows the edge's shift d as
d - e (d · n) / (e · n), so the contour of directions r₁, r₂ from there to its neighbours shortens fastest for
d = r - n (r · e) / (e · n), r = r₁ + r₂.
"""

from __future__ import annotations

import numpy as np

from vto_pipeline.cloth.untangle.contours import FREE, Crossings
from vto_pipeline.model.arrays import FloatArray

_GRAZING = 0.2  # |e · n| below which the crossing would run away along the edge


def contour_shortening_shifts(crossing: Crossings, vertices: FloatArray) -> FloatArray:
    """Return the shift of each crossing's edge, against its face, that shortens the contour fastest, shape (N, 3).

    Its length is how many metres the contour loses per metre of shift.

    Args:
        crossing: On contours.
        vertices: [m], shape (V, 3).
    """
    pull = np.zeros_like(crossing.point)
    for here, there in ((0, 1), (1, 0)):
        start, end = crossing.ends[:, here], crossing.ends[:, there]
        known = start != FREE
        start, end = start[known], end[known]
        goal = np.where((end != FREE)[:, None], crossing.point[end], crossing.corner[known])
        way = np.nan_to_num(goal - crossing.point[start])
        length = np.linalg.norm(way, axis=1, keepdims=True)
        np.add.at(pull, start, np.divide(way, length, out=np.zeros_like(way), where=length > 0.0))
    along = vertices[crossing.edge[:, 1]] - vertices[crossing.edge[:, 0]]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    steep = np.einsum("nd,nd->n", along, crossing.normal)
    steep = np.where(steep < 0.0, np.minimum(steep, -_GRAZING), np.maximum(steep, _GRAZING))
    lift: FloatArray = (np.einsum("nd,nd->n", pull, along) / steep)[:, None] * crossing.normal
    return pull - lift
