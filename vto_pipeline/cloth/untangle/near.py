"""Rows that keep untangled parts from running into each other."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.cloth.collision.self_collision.candidates import self_candidates
from vto_pipeline.cloth.collision.self_collision.surface_features import Features
from vto_pipeline.cloth.untangle.rows import SeparationRows, separation_rows
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.distance import barycentric_point, closest_on_segments, closest_on_triangle
from vto_pipeline.numerics.spatial.bvh import Bvh, refit_swept
from vto_pipeline.numerics.vector import add, load, norm, scale, store, sub, unit


def near_rows(
    tree: Bvh, features: Features, positions: FloatArray, reach: float, thickness: float, skip: NDArray[np.bool_]
) -> list[SeparationRows]:
    """Return rows that keep features of the cloth `thickness` apart, on the side where they are.

    Args:
        tree: Over the faces; is fitted.
        features: Of the cloth.
        positions: [m], shape (V, 3).
        reach: Distance up to which two features are near [m].
        thickness: [m].
        skip: Vertices whose sides are not known, shape (V,); they take no part.
    """
    radius = np.full(len(positions), 0.5 * reach)
    refit_swept(tree, positions, positions, features.faces, radius)
    to_face, to_edge = self_candidates(tree, features, positions, positions, radius, skip)
    parts = []
    for ids, found in (
        (np.column_stack([to_face[:, 0], features.faces[to_face[:, 1]]]), _to_faces),
        (np.column_stack([features.edges[to_edge[:, 0]], features.edges[to_edge[:, 1]]]), _to_edges),
    ):
        coefficients, normal, distance = found(positions, ids)
        kept = (distance > 0.0) & (distance < reach)
        level = np.full(int(kept.sum()), thickness)
        parts.append(separation_rows(ids[kept], coefficients[kept], normal[kept], level, positions, len(positions)))
    return parts


@njit(cache=True, error_model="numpy")
def _to_faces(positions, ids):  # type: ignore[no-untyped-def]
    """Return coefficients (K, 4), unit directions (K, 3) and distances (K,) of vertices from faces."""
    coefficients, normal, distance = np.empty(ids.shape), np.empty((len(ids), 3)), np.empty(len(ids))
    for k in range(len(ids)):
        p = load(positions, ids[k, 0])
        a, b, c = load(positions, ids[k, 1]), load(positions, ids[k, 2]), load(positions, ids[k, 3])
        weights, _ = closest_on_triangle(p, a, b, c)
        away = sub(p, barycentric_point(weights, a, b, c))
        distance[k] = norm(away)
        store(normal, k, unit(away))
        coefficients[k, 0] = 1.0
        for m in range(3):
            coefficients[k, m + 1] = -weights[m]
    return coefficients, normal, distance


@njit(cache=True, error_model="numpy")
def _to_edges(positions, ids):  # type: ignore[no-untyped-def]
    """Return coefficients (K, 4), unit directions (K, 3) and distances (K,) of edges from edges."""
    coefficients, normal, distance = np.empty(ids.shape), np.empty((len(ids), 3)), np.empty(len(ids))
    for k in range(len(ids)):
        a, b = load(positions, ids[k, 0]), load(positions, ids[k, 1])
        c, d = load(positions, ids[k, 2]), load(positions, ids[k, 3])
        s, t = closest_on_segments(a, b, c, d)
        away = sub(add(scale(1.0 - s, a), scale(s, b)), add(scale(1.0 - t, c), scale(t, d)))
        distance[k] = norm(away)
        store(normal, k, unit(away))
        coefficients[k, 0], coefficients[k, 1], coefficients[k, 2], coefficients[k, 3] = 1.0 - s, s, t - 1.0, -t
    return coefficients, normal, distance
