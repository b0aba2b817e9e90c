"""The dihedral angle of two triangles, and its gradient by the four vertices.

Bridson, Marino & Fedkiw 2003; gradients as in Tamstorf & Grinspun 2013, "Discrete bending forces and their Jacobians".
"""

from __future__ import annotations

from math import atan2

from numba import njit

from vto_pipeline.numerics.vector import axpy, cross, dot, norm, scale, sub


@njit(cache=True, error_model="numpy", forceinline=True)
def dihedral(x0, x1, x2, x3):
    """Return the signed angle [rad] of the hinge x0 x1 with wings x2 and x3, and its gradient with respect to each
    vertex.

    The faces are (x0, x1, x2) and (x1, x0, x3); flat is 0, and a fold that brings the outer sides apart is positive.
    A degenerate wing gives zero gradients, so that the hinge rests until the triangle has an area again.
    """
    zero = (0.0, 0.0, 0.0)
    e = sub(x1, x0)
    length = norm(e)
    n2 = cross(e, sub(x2, x0))
    n3 = cross(sub(x3, x0), e)
    area2, area3 = dot(n2, n2), dot(n3, n3)
    if length == 0.0 or area2 < 1e-30 * length**4 or area3 < 1e-30 * length**4:
        return 0.0, zero, zero, zero, zero
    angle = atan2(dot(cross(n2, n3), e) / length, dot(n2, n3))
    g2 = scale(-length / area2, n2)
    g3 = scale(-length / area3, n3)
    t2, t3 = dot(sub(x2, x0), e) / (length * length), dot(sub(x3, x0), e) / (length * length)
    g0 = axpy(t2 - 1.0, g2, scale(t3 - 1.0, g3))
    g1 = axpy(-t2, g2, scale(-t3, g3))
    return angle, g0, g1, g2, g3
