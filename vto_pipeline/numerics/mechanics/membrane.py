"""In-plane strain of a triangle along its threads.

The deformation gradient F = (F_u, F_v) maps the flat rest triangle, laid out along warp (u) and weft (v), to space.
Every measure of strain here is three numbers (warp, weft, shear), for small strain the engineering strains of an
orthotropic sheet, and comes with its slopes: how warp strain changes with F_u, weft strain with F_v, and shear with
F_u and with F_v, four vectors. Whatever else a membrane needs is written once, for any measure.
"""

from __future__ import annotations

from math import asin, sqrt

from numba import njit

from vto_pipeline.numerics.vector import axpy, cross, dot, norm, scale, unit


@njit(cache=True, error_model="numpy", forceinline=True)
def deformation(x0, x1, x2, g):
    """Return F_u and F_v for corner positions and shape gradients g = (g0u, g0v, g1u, g1v, g2u, g2v) [1/m]."""
    fu = axpy(g[0], x0, axpy(g[2], x1, scale(g[4], x2)))
    fv = axpy(g[1], x0, axpy(g[3], x1, scale(g[5], x2)))
    return fu, fv


@njit(cache=True, error_model="numpy", forceinline=True)
def thread_strains(fu, fv):
    """Return warp strain |F_u| - 1, weft strain |F_v| - 1, shear angle γ = asin(u · v) of the unit threads u and v.

    Baraff & Witkin 1998, section 4.2, with the angle itself for shear. The slopes of warp and weft strain are unit
    vectors however far the triangle is deformed, which keeps one linear step about right: a flattened triangle is
    turned open, not thrown. Where a thread has no length or both lie on one line, some direction is taken to open.

    Returns:
        The strains; their slopes u, v, p / |F_u|, q / |F_v|, with the unit vectors p = (v - sin γ u) / cos γ and
        q = (u - sin γ v) / cos γ; and (1 / |F_u|, 1 / |F_v|, sin γ, cos γ).
    """
    lu, lv = norm(fu), norm(fv)
    if lu * lv == 0.0:
        return _collapsed(fu, fv, lu, lv)
    iu, iv = 1.0 / lu, 1.0 / lv
    u, v = scale(iu, fu), scale(iv, fv)
    sine = min(1.0, max(-1.0, dot(u, v)))
    cosine = sqrt(1.0 - sine * sine)
    if cosine > 1e-7:
        ic = 1.0 / cosine
        p, q = scale(iu * ic, axpy(-sine, u, v)), scale(iv * ic, axpy(-sine, v, u))
    else:
        across = _across(u)
        p, q = scale(iu, across), scale(-sine * iv, across)
    return (lu - 1.0, lv - 1.0, asin(sine)), (u, v, p, q), (iu, iv, sine, cosine)


@njit(cache=True, error_model="numpy", forceinline=True)
def _collapsed(fu, fv, lu, lv):
    """Return what `thread_strains` does where a thread has no length: it will open at right angles to the other."""
    zero = (0.0, 0.0, 0.0)
    u = scale(1.0 / lu, fu) if lu > 0.0 else (_across(scale(1.0 / lv, fv)) if lv > 0.0 else (1.0, 0.0, 0.0))
    v = scale(1.0 / lv, fv) if lv > 0.0 else scale(-1.0, _across(u))
    return (lu - 1.0, lv - 1.0, 0.0), (u, v, zero, zero), (0.0, 0.0, 0.0, 1.0)


@njit(cache=True, error_model="numpy", forceinline=True)
def _across(u):
    """Return a unit vector at right angles to the unit vector u, the opposite one for -u."""
    if abs(u[2]) < 0.9:
        return unit(cross(u, (0.0, 0.0, 1.0)))
    return unit(cross(u, (0.0, 1.0, 0.0)))


@njit(cache=True, error_model="numpy", forceinline=True)
def green_strains(fu, fv):
    """Return E_uu, E_vv and 2 E_uv of the Green-Lagrange strain E = ½ (FᵀF - I), and their slopes."""
    return (0.5 * (dot(fu, fu) - 1.0), 0.5 * (dot(fv, fv) - 1.0), dot(fu, fv)), (fu, fv, fv, fu)


@njit(cache=True, error_model="numpy", forceinline=True)
def pulls(along, slopes):
    """Return the pulls on F_u and F_v of what acts (along warp, along weft, along shear)."""
    return axpy(along[2], slopes[2], scale(along[0], slopes[0])), axpy(along[2], slopes[3], scale(along[1], slopes[1]))


@njit(cache=True, error_model="numpy", forceinline=True)
def corner_force(du, dv, pull_u, pull_v):
    """Return the pull on a corner with shape gradient (du, dv)."""
    return axpy(du, pull_u, scale(dv, pull_v))


@njit(cache=True, error_model="numpy", forceinline=True)
def mobility(slopes, w0, w1, w2, g):
    """Return ∇C W ∇Cᵀ of the three strains, upper triangle by rows, for inverse masses w of the corners."""
    warp, weft, shear_u, shear_v = slopes
    a = w0 * g[0] * g[0] + w1 * g[2] * g[2] + w2 * g[4] * g[4]
    b = w0 * g[0] * g[1] + w1 * g[2] * g[3] + w2 * g[4] * g[5]
    c = w0 * g[1] * g[1] + w1 * g[3] * g[3] + w2 * g[5] * g[5]
    return (
        a * dot(warp, warp),
        b * dot(warp, weft),
        dot(warp, axpy(a, shear_u, scale(b, shear_v))),
        c * dot(weft, weft),
        dot(weft, axpy(b, shear_u, scale(c, shear_v))),
        a * dot(shear_u, shear_u) + 2.0 * b * dot(shear_u, shear_v) + c * dot(shear_v, shear_v),
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def strain_changes(slopes, du, dv):
    """Return how the strains change, to first order, as F_u and F_v change by du and dv."""
    return dot(slopes[0], du), dot(slopes[1], dv), dot(slopes[2], du) + dot(slopes[3], dv)


@njit(cache=True, error_model="numpy", forceinline=True)
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


@njit(cache=True, error_model="numpy", forceinline=True)
def _inverse(pivot, before):
    """Return 1 / pivot, or zero where the pivot is nothing beside what it was before elimination."""
    return 1.0 / pivot if pivot > 1e-13 * before else 0.0
