"""A moving surface as few shapes that are added up: principal components of its frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vto_pipeline.model.arrays import FloatArray


@dataclass(frozen=True)
class PrincipalShapes:
    """Frame t is `base + sum over k of weights[t, k] * shapes[k]`.

    Args:
        base: [m], shape (V, 3).
        shapes: [m], shape (K, V, 3).
        weights: Shape (T, K), between -1 and 1.
        error: Farthest that a vertex is from where it was in any frame [m].
    """

    base: FloatArray
    shapes: FloatArray
    weights: FloatArray
    error: float


def principal_shapes(frames: FloatArray, error: float) -> PrincipalShapes:
    """Return the fewest principal components that keep every vertex in every frame this near.

    They are those of the frames about their mean, the strongest first, by the eigenvectors of the frames' products
    with each other (Sirovich 1987, the method of snapshots).

    Args:
        frames: [m], shape (T, V, 3).
        error: How far a vertex may be off [m].
    """
    count, vertices = frames.shape[:2]
    flat = np.asarray(frames, dtype=float).reshape(count, -1)
    base = flat.mean(axis=0)
    off = flat - base
    _, vectors = np.linalg.eigh(off @ off.T)
    vectors = vectors[:, ::-1]
    shapes = vectors.T @ off
    left, kept = off.copy(), 0
    while kept < count and _farthest(left, vertices) > error:
        left -= np.outer(vectors[:, kept], shapes[kept])
        kept += 1
    scale = np.abs(vectors[:, :kept]).max(axis=0, initial=0.0)
    return PrincipalShapes(
        base.reshape(vertices, 3),
        (scale[:, None] * shapes[:kept]).reshape(kept, vertices, 3),
        vectors[:, :kept] / scale,
        _farthest(left, vertices),
    )


def _farthest(left: FloatArray, vertices: int) -> float:
    return float(np.linalg.norm(left.reshape(-1, vertices, 3), axis=2).max(initial=0.0))
