"""Implicit solids: signed distances (negative inside) and the ways to join them, on arrays of points.

The distances are exact or first order near the surface, which is all that surface extraction asks for.
"""

from __future__ import annotations

import numpy as np

from vto_pipeline.model.arrays import FloatArray


def length(vectors: FloatArray) -> FloatArray:
    """Euclidean length of each row, shape (N,)."""
    squared: FloatArray = np.einsum("ij,ij->i", vectors, vectors)
    return np.sqrt(squared)


def smooth_union(a: FloatArray, b: FloatArray, radius: float) -> FloatArray:
    """Union with a fillet of about `radius` [m]: the quadratic smooth minimum (Quilez 2013), never above min(a, b)."""
    overlap = np.maximum(radius - np.abs(a - b), 0.0) / radius
    joined: FloatArray = np.minimum(a, b) - 0.25 * radius * overlap**2
    return joined


def smooth_cut(a: FloatArray, b: FloatArray, radius: float) -> FloatArray:
    """Intersection with an edge rounded by about `radius` [m]."""
    return -smooth_union(-a, -b, radius)


def ellipsoid(points: FloatArray, center: FloatArray, radii: FloatArray) -> FloatArray:
    """Distance to an axis-aligned ellipsoid, first order: f / |grad f| with f = |p / r| - 1 scaled (Quilez 2008).

    Args:
        points: Shape (N, 3) [m].
        center, radii: Shape (3,) [m].

    Returns:
        Shape (N,) [m].
    """
    offset = points - center
    near = length(offset / radii)
    slope = length(offset / np.square(radii))
    return near * (near - 1.0) / np.maximum(slope, 1e-9)


def cone(points: FloatArray, start: FloatArray, end: FloatArray, radii: tuple[float, float]) -> FloatArray:
    """Distance to a capsule whose radius goes from radii[0] at `start` to radii[1] at `end` [m], shape (N,)."""
    axis = end - start
    along = np.clip((points - start) @ axis / (axis @ axis), 0.0, 1.0)
    nearest = start + along[:, None] * axis
    return length(points - nearest) - (radii[0] + along * (radii[1] - radii[0]))


def bump(points: FloatArray, center: FloatArray, height: float, spread: float) -> FloatArray:
    """How far a Gaussian bump lifts the surface [m]: subtract it from a distance. Shape (N,)."""
    return height * np.exp(-0.5 * np.square((points - center) / spread).sum(axis=1))
