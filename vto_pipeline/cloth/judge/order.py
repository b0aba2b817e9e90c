"""Layer order: whether inner garments lie beneath outer ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.cloth.judge.crossings import crossings_between
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.mesh import TriangleMesh

_WIDTH = 1e-6  # m: of the slivers that stand for straight ways


def outside_outer_garment(inner: TriangleMesh, outer: TriangleMesh, body: TriangleMesh) -> NDArray[np.int64]:
    """Return which vertices of the inner garment lie outside the outer one.

    Those are they whose straight way to the nearest place of the body passes through the outer one, and through as many
    folds of it inwards as outwards and once more. What the outer one does not cover is not outside it.

    Args:
        inner, outer: Garments as worn [m].
        body: Beneath both [m].
    """
    end = inner.vertices
    start = SurfaceDistance(body).nearest(end).point
    way = end - start
    aside = np.cross(way, np.eye(3)[np.abs(way).argmin(axis=1)])
    aside *= _WIDTH / np.maximum(np.linalg.norm(aside, axis=1, keepdims=True), np.finfo(float).tiny)
    slivers = np.arange(3 * len(end), dtype=np.int32).reshape(3, -1).T
    ways = TriangleMesh(np.vstack([start, end, end + aside]), slivers)
    passed = np.bincount(crossings_between(ways, outer)[:, 0], minlength=len(end))
    return np.flatnonzero(passed % 2)
