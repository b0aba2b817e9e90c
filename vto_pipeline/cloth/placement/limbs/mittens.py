"""A body in mittens: the convex hulls of the ends of its limbs, padded, about its fingers and toes.

There is room for a finger between the vertices of coarse cloth, and none for a mitten. Cloth that a body has grown in
with them on is clear of what is in them, but for where its edges are so long that they cut through the padding.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from vto_pipeline.cloth.placement.limbs.limbs import Limbs
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.body import MovingBody

_CORNERS = np.stack(np.meshgrid(*3 * [[-1.0, 1.0]]), axis=-1).reshape(-1, 3)
_WAYS = np.vstack([np.eye(3), -np.eye(3), _CORNERS / np.sqrt(3.0)])
"""Fourteen ways out, the corners of what stands for a ball about each point."""


def in_mittens(body: MovingBody, limbs: Limbs, padding: float) -> MovingBody:
    """Return the body with the convex hull of the end of each limb as a part of its own, which moves along with it.

    Args:
        body: To be covered.
        limbs: Of the body as it ends.
        padding: How far a hull stands off the body as it ends [m]; where that moves, there is none at the begin.
    """
    frames, faces = [body.keyframes], [body.faces]
    count, moves = body.keyframes.shape[1], len(body.keyframes) > 1
    share = np.linspace(0.0 if moves else 1.0, 1.0, len(body.keyframes))[:, None, None]
    for end in limbs.ends():
        points = body.keyframes[-1, end][:, None] + padding * _WAYS
        used, hull = _hull(points.reshape(-1, 3))
        source, way = np.divmod(used, len(_WAYS))
        frames.append(body.keyframes[:, end[source]] + share * padding * _WAYS[way])
        faces.append(hull + np.int32(count))
        count += len(used)
    return MovingBody(np.concatenate(frames, axis=1), np.concatenate(faces))


def _hull(points: FloatArray) -> tuple[IntArray, IntArray]:
    """Return which points are corners of their convex hull, shape (N,), and its faces, outward, shape (F, 3)."""
    hull = ConvexHull(points)
    corners = points[hull.simplices]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.einsum("ij,ij->i", normal, hull.equations[:, :3]) < 0.0
    faces = np.where(inward[:, None], hull.simplices[:, ::-1], hull.simplices)
    used, faces = np.unique(faces, return_inverse=True)
    return used.astype(np.int32), faces.reshape(-1, 3).astype(np.int32)
