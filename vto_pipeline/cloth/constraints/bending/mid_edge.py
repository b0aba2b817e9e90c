"""The slope of a surface across its edges, from the hinge angles about them: exact for any quadratic surface.

The three edges of a triangle and the slopes across them give its curvature (Morley's element; Grinspun, Gingold,
Reisman & Zorin 2006, "Computing discrete shape operators on general meshes", section 4). Where these slopes are no
unknowns of their own, the mean of the two triangles' slopes usually stands in for them. That mean is right on a
regular mesh only; on an irregular one it leaves an error of several per cent which no refinement takes away. Here four
more hinges, the other edges of the two triangles, correct it: the least change of the mean that makes the slope exact
for every quadratic surface. Then a constant curvature is found exactly, and a constant moment, being carried by
slopes that two triangles share, pulls on no inner vertex: consistent both ways, so it converges on any mesh.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_DAMPED = 1e-3  # of the mean squared angle: where few hinges say little, stay near the mean
_Points = NDArray[np.float64]


def slope_shares(triangles: NDArray[np.float64], beyond: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return by how much the slope at an edge's middle exceeds the slope in its own triangle, per angle of each hinge.

    Args:
        triangles: Rest corners of the edge's own triangle, the edge first [m], shape (N, 3, 3); then `beyond`.
        beyond: Rest corners of the triangle across the edge, and of those across the own triangle's second and third
            edge and across the other triangle's second and third edge, from that edge on [m]; NaN where there is none,
            shape (N, 5, 3, 3). Across a seam, each in its own panel.

    Returns:
        Shares of the angles at the edge itself and at these four edges, in this order, shape (N, 5).
    """
    length = np.linalg.norm(triangles[:, 1] - triangles[:, 0], axis=1)
    half = np.zeros((len(length), 2))
    half[:, 0] = 0.5 * length
    tail, head = -half, half  # the edge lies on the x-axis, its middle in the origin
    own = _unfold(tail, head, triangles)
    other = _unfold(head, tail, beyond[:, 0])
    angles = np.stack(
        [
            _angles(tail, head, own, other),
            _angles(head, own, tail, _unfold(own, head, beyond[:, 1])),
            _angles(own, tail, head, _unfold(tail, own, beyond[:, 2])),
            _angles(tail, other, head, _unfold(other, tail, beyond[:, 3])),
            _angles(other, head, tail, _unfold(head, other, beyond[:, 4])),
        ],
        axis=2,
    )  # of the three unit quadratics at the five hinges
    angles = np.where(np.isfinite(angles), angles, 0.0)
    slope = (_values(head) - _values(own)) / own[:, 1, None]  # in the triangle; at the edge's middle it is zero
    mean = 0.5 * angles[:, :, 0]
    gram = angles @ angles.transpose(0, 2, 1)
    damping = _DAMPED / 3.0 * np.trace(gram, axis1=1, axis2=2)
    gram += np.maximum(damping, np.finfo(float).tiny)[:, None, None] * np.eye(3)
    change = np.linalg.solve(gram, (slope - mean)[:, :, None])
    shares: NDArray[np.float64] = (angles.transpose(0, 2, 1) @ change)[:, :, 0]
    shares[:, 0] += 0.5
    return shares


def _unfold(p: _Points, q: _Points, rest: _Points) -> _Points:
    """Return where the last corner of a triangle lies in the plane when its first edge runs from p to q, shape (N, 2).

    Where the two sides of a seam differ in length, as where one is gathered, the corner keeps its height over the edge
    and its share of the way along it.

    Args:
        p, q: Ends of the edge in the plane, the triangle to its left [m], shape (N, 2).
        rest: The triangle at rest [m], shape (N, 3, 3).
    """
    along = q - p
    to_r, edge = rest[:, 2] - rest[:, 0], rest[:, 1] - rest[:, 0]
    squared = np.einsum("ij,ij->i", edge, edge)
    foot = np.einsum("ij,ij->i", to_r, edge) / squared
    height = np.linalg.norm(np.cross(edge, to_r), axis=1) / np.sqrt(squared)
    left = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    return p + foot[:, None] * along + height[:, None] * left


def _values(point: _Points) -> _Points:
    """Return the quadratics with unit second derivatives xx, yy and xy at points (N, 2), shape (N, 3)."""
    x, y = point[:, 0], point[:, 1]
    return np.column_stack([0.5 * x * x, 0.5 * y * y, x * y])


def _angles(p: _Points, q: _Points, r: _Points, s: _Points) -> _Points:
    """Return the angles of hinge p q with wings r (left) and s (right) when its corners lie on the quadratics.

    They are small angles, with the sign of `numerics.bending.dihedral`: positive where the wings go down.
    """
    along = q - p
    length = np.linalg.norm(along, axis=1)
    bend = np.zeros((len(p), 3))
    for wing in (r, s):
        out = wing - p
        foot = (np.einsum("ij,ij->i", out, along) / length**2)[:, None]
        height = np.abs(along[:, 0] * out[:, 1] - along[:, 1] * out[:, 0]) / length
        bend += ((1.0 - foot) * _values(p) + foot * _values(q) - _values(wing)) / height[:, None]
    return bend
