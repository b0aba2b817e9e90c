"""The dihedral angle of two triangles, and its derivatives by the four vertices.

Bridson, Marino & Fedkiw 2003; gradients as in Tamstorf & Grinspun 2013, "Discrete bending forces and their Jacobians".
"""

from __future__ import annotations

from math import atan2

from numba import njit

from vto_pipeline.numerics.vector import add, axpy, cross, dot, norm, scale, sub


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


@njit(cache=True, error_model="numpy", forceinline=True)
def add_dihedral_hessian(weight, x0, x1, x2, x3, blocks):
    """Add a weight times the second derivatives of the angle of `dihedral` to blocks, shape (4, 4, 3, 3).

    Only how the wings' gradients change is derived; the rest follows from symmetry, and from that it changes nothing
    when all four vertices move alike. Tamstorf & Grinspun 2013, section 4.
    """
    e, r2, r3 = sub(x1, x0), sub(x2, x0), sub(x3, x0)
    length = norm(e)
    n2, n3 = cross(e, r2), cross(r3, e)
    area2, area3 = dot(n2, n2), dot(n3, n3)
    if length == 0.0 or area2 < 1e-30 * length**4 or area3 < 1e-30 * length**4:
        return
    _add_wing(2, weight, 1.0, e, length, r2, n2, area2, blocks)
    _add_wing(3, weight, -1.0, e, length, r3, n3, area3, blocks)


@njit(cache=True, error_model="numpy", forceinline=True)
def _add_wing(wing, weight, side, e, length, r, n, area, blocks):
    """Add what one wing does: with g its gradient, and (t - 1) g and -t g its shares of those of the edge's ends.

    Args:
        wing: Its vertex, 2 or 3.
        weight: Of it all.
        side: 1 or -1: n = side e × r.
        e, length: The edge from vertex 0 to 1, and its length [m].
        r: From vertex 0 to the wing's [m].
        n, area: The normal, twice the triangle's area long, and the square of that.
        blocks: Changed in place.
    """
    slope = scale(-weight * length / area, n)
    t = dot(r, e) / (length * length)
    shift = scale(1.0 / (length * length), axpy(-2.0 * t, e, r))  # of t as vertex 1 moves
    for m in range(3):
        axis = (1.0 if m == 0 else 0.0, 1.0 if m == 1 else 0.0, 1.0 if m == 2 else 0.0)
        by_wing = _slope_change(scale(side, cross(e, axis)), n, area, -weight * length / area)
        by_end = _slope_change(scale(side, cross(axis, r)), n, area, -weight * length / area)
        by_end = axpy(-weight * e[m] / (length * area), n, by_end)
        _add_pair(wing, 1, m, by_end, blocks)
        _add_pair(wing, 0, m, scale(-1.0, add(by_wing, by_end)), blocks)
        _add_pair(0, 1, m, axpy(shift[m], slope, scale(t - 1.0, by_end)), blocks)


@njit(cache=True, error_model="numpy", forceinline=True)
def _slope_change(turned, n, area, factor):
    """Return by how much factor n changes, factor being in proportion to 1 / |n|², as n changes by `turned`."""
    return scale(factor, axpy(-2.0 * dot(n, turned) / area, n, turned))


@njit(cache=True, error_model="numpy", forceinline=True)
def _add_pair(a, b, m, column, blocks):
    """Add column m of block (a, b), the same to (b, a) as a row, and less it to the diagonal blocks."""
    for k in range(3):
        blocks[a, b, k, m] += column[k]
        blocks[b, a, m, k] += column[k]
        blocks[a, a, k, m] -= column[k]
        blocks[b, b, m, k] -= column[k]
