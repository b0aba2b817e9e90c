"""In-plane strain of a triangle along its threads.

The deformation gradient F = (F_u, F_v) maps the flat rest triangle, laid out along warp (u) and weft (v), to space.
Strains are those of Baraff & Witkin 1998, section 4.2, with the shear angle itself for shear: warp |F_u| - 1, weft
|F_v| - 1, γ = asin(u · v) of the unit threads u and v. For small strain they are the engineering strains of an
orthotropic sheet. Their gradients are unit vectors however far the triangle is deformed, which keeps one linear step
about right: a flattened triangle is turned open, not thrown.
"""

from __future__ import annotations

from math import asin, sqrt

from numba import njit

from vto_pipeline.numerics.vector import axpy, dot, norm, scale


@njit(cache=True, error_model="numpy")
def deformation(x0, x1, x2, g):
    """Return F_u and F_v for corner positions and shape gradients g = (g0u, g0v, g1u, g1v, g2u, g2v) [1/m]."""
    fu = axpy(g[0], x0, axpy(g[2], x1, scale(g[4], x2)))
    fv = axpy(g[1], x0, axpy(g[3], x1, scale(g[5], x2)))
    return fu, fv


@njit(cache=True, error_model="numpy")
def strains(fu, fv):
    """Return the strains and how they change with F.

    Returns:
        (warp strain, weft strain, shear angle), the cosine of the shear angle, the inverse lengths (1/|F_u|,
        1/|F_v|), and the gradients: of warp and weft strain the unit threads u and v, of the shear angle the unit
        vectors p = (v - sin γ u) / cos γ and q = (u - sin γ v) / cos γ, each over the length of its own thread.
    """
    lu, lv = norm(fu), norm(fv)
    iu, iv = 1.0 / lu if lu > 0.0 else 0.0, 1.0 / lv if lv > 0.0 else 0.0
    u, v = scale(iu, fu), scale(iv, fv)
    sine = min(1.0, max(-1.0, dot(u, v)))
    cosine = sqrt(1.0 - sine * sine)
    ic = 1.0 / cosine if cosine > 1e-9 else 0.0  # threads on one line do not say which way they opened
    p, q = scale(ic, axpy(-sine, u, v)), scale(ic, axpy(-sine, v, u))
    return (lu - 1.0, lv - 1.0, asin(sine)), cosine, (iu, iv), u, v, p, q


@njit(cache=True, error_model="numpy")
def thread_pulls(force, inverse, u, v, p, q):
    """Return the pulls on F_u and F_v of forces (warp, weft, shear) that act along the strains' gradients."""
    return axpy(force[2] * inverse[0], p, scale(force[0], u)), axpy(force[2] * inverse[1], q, scale(force[1], v))


@njit(cache=True, error_model="numpy")
def on_corner(du, dv, pull_u, pull_v):
    """Return the pull on a corner with shape gradient (du, dv)."""
    return axpy(du, pull_u, scale(dv, pull_v))


@njit(cache=True, error_model="numpy")
def solve_symmetric(a, b, c, d, e, f, x, y, z):
    """Return a solution of [[a, b, c], [b, d, e], [c, e, f]] s = (x, y, z), for a positive semidefinite matrix.

    LDLᵀ. A pivot that rounding has eaten up is left out, so rigid constraints that repeat each other do no harm.
    """
    p1 = _inverse(a, a)
    l1, l2 = b * p1, c * p1
    p2 = _inverse(d - l1 * b, d)
    m = e - l1 * c
    l3 = m * p2
    y2 = y - l1 * x
    s3 = (z - l2 * x - l3 * y2) * _inverse(f - l2 * c - l3 * m, f)
    s2 = y2 * p2 - l3 * s3
    return x * p1 - l1 * s2 - l2 * s3, s2, s3


@njit(cache=True, error_model="numpy")
def _inverse(pivot, before):
    """Return 1 / pivot, or zero where the pivot is nothing beside what it was before elimination."""
    return 1.0 / pivot if pivot > 1e-13 * before else 0.0
