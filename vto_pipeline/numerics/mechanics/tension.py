"""Geometric stiffness of a triangle from its stress.

A tension is what `tension_pulls` needs: the tensile plane stress S that acts along a normal n, and each thread's own
tension against turning in the plane, along p and q.
"""

from __future__ import annotations

from math import sqrt

from numba import njit

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
    return tensile(uu, vv, tilt * iu * iv), normal, turn_u, unit(slopes[2]), turn_v, unit(slopes[3])


@njit(cache=True, error_model="numpy", forceinline=True)
def tension_pulls(tension, du, dv, m):
    """Return how the pulls on F_u and F_v change as a corner with shape gradient (du, dv) moves along axis m."""
    (uu, vv, uv), n, turn_u, p, turn_v, q = tension
    return (
        axpy((uu * du + uv * dv) * n[m], n, scale(turn_u * du * p[m], p)),
        axpy((uv * du + vv * dv) * n[m], n, scale(turn_v * dv * q[m], q)),
    )
