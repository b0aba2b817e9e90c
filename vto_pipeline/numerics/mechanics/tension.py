"""Geometric stiffness of a triangle from its stress.

A tension is what `tension_pulls` needs: the plane stress S that acts along a normal n, and for each thread its tension
against turning in the plane, along p or q, and what shear makes of it, which leans along the thread.
"""

from __future__ import annotations

from math import sqrt

from numba import njit
from numba.extending import overload

from vto_pipeline.numerics.vector import axpy, cross, scale, unit


@njit(cache=True, error_model="numpy", forceinline=True)
def tensile(uu, vv, uv):
    """Return the tensile part of a plane stress: its eigenvalues above zero."""
    mean, half = 0.5 * (uu + vv), 0.5 * (uu - vv)
    radius = sqrt(half * half + uv * uv)
    high, low = max(mean + radius, 0.0), max(mean - radius, 0.0)
    middle, turn = 0.5 * (high + low), 0.5 * (high - low) / radius if radius > 0.0 else 0.0
    return middle + turn * half, middle - turn * half, turn * uv


@njit(cache=True, error_model="numpy", forceinline=True)
def thread_tension(stress, slopes, frame):
    """Return what a stress (warp, weft, shear) adds to the stiffness of `thread_strains`, for `tension_pulls`.

    Out of the plane that is the second Piola-Kirchhoff stress, in the plane the tension of each thread against turning.
    Only what is tensile counts, so it is positive semidefinite, and exact where nothing is compressed or sheared.
    """
    iu, iv, sine, cosine = frame
    tilt = stress[2] * (1.0 / cosine if cosine > 1e-7 else 0.0)
    uu = stress[0] * iu - tilt * sine * iu * iu
    vv = stress[1] * iv - tilt * sine * iv * iv
    normal = unit(cross(slopes[0], slopes[1]))
    turn_u, turn_v = max(stress[0], 0.0) * iu, max(stress[1], 0.0) * iv
    return tensile(uu, vv, tilt * iu * iv), normal, (turn_u, unit(slopes[2])), (turn_v, unit(slopes[3]))


@njit(cache=True, error_model="numpy", forceinline=True)
def exact_thread_tension(stress, slopes, frame):
    """Return all that a stress adds: Σ σ ∂²ε of the strains of `thread_strains`, indefinite where it compresses.

    As the thread u turns by dφ in the plane, its strain's slope u turns to p; that of shear, p / |F_u|, turns to -u,
    and shrinks as the thread gets longer: -(u pᵀ + p uᵀ) / |F_u|².
    """
    iu, iv, sine, cosine = frame
    tilt = stress[2] * (1.0 / cosine if cosine > 1e-7 else 0.0)
    uu = stress[0] * iu - tilt * sine * iu * iu
    vv = stress[1] * iv - tilt * sine * iv * iv
    lean_u, lean_v = scale(-stress[2] * iu * iu, slopes[0]), scale(-stress[2] * iv * iv, slopes[1])
    return (
        (uu, vv, tilt * iu * iv),
        unit(cross(slopes[0], slopes[1])),
        (stress[0] * iu, unit(slopes[2]), lean_u),
        (stress[1] * iv, unit(slopes[3]), lean_v),
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def tension_pulls(tension, du, dv, m):
    """Return how the pulls on F_u and F_v change as a corner with shape gradient (du, dv) moves along axis m."""
    (uu, vv, uv), n, thread_u, thread_v = tension
    return (
        axpy((uu * du + uv * dv) * n[m], n, _turned(thread_u, du, m)),
        axpy((uv * du + vv * dv) * n[m], n, _turned(thread_v, dv, m)),
    )


def _turned(thread, share, m):  # type: ignore[no-untyped-def]
    """Return a share of column m of turn p pᵀ, or, where shear leans, of turn p pᵀ + lean pᵀ + p leanᵀ."""
    raise NotImplementedError


@overload(_turned, inline="always")
def _turned_compiled(thread, share, m):
    if len(thread) == 2:
        return lambda thread, share, m: scale(thread[0] * share * thread[1][m], thread[1])
    return lambda thread, share, m: axpy(
        share * (thread[0] * thread[1][m] + thread[2][m]), thread[1], scale(share * thread[1][m], thread[2])
    )
