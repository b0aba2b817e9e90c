"""Contact within an iteration, with accumulated multipliers."""

from __future__ import annotations

from math import sqrt

from numba import njit, prange

from vto_pipeline.cloth.collision.response.plane_motion import plane_at
from vto_pipeline.numerics.vector import add, axpy, dot, load, scale, store, sub

_CHUNK = 512  # vertices a thread takes at a time


@njit(cache=True, error_model="numpy", parallel=True)
def solve_plane_contacts(x, start, weights, contacts, t0, t1, pressed):
    """Do one sweep of projected Gauss-Seidel over the contacts, in place.

    `resolve_plane_contacts` can only push. Iterated with other constraints it would keep what the first guess needed,
    and end in a point that depends on the way there; here the sum of the pushes, not each of them, is kept above zero,
    and friction inside the cone of that sum (Jean & Moreau 1992; Erleben 2007, section 4).

    Args:
        x: Positions [m], shape (V, 3), changed in place.
        start: Positions at the start of the step [m], shape (V, 3).
        weights: How far a push moves a vertex [1/kg], shape (V,); zero holds it.
        contacts: Planes.
        t0, t1: Begin and end of the step, as shares of the span of the contacts.
        pressed: Push of each plane on each vertex in this step [kg m], shape (S, V, 3), changed in place.
    """
    for chunk in prange((len(x) + _CHUNK - 1) // _CHUNK):
        for i in range(_CHUNK * chunk, min(len(x), _CHUNK * chunk + _CHUNK)):
            for s in range(len(contacts.friction)):
                if weights[i] > 0.0 and contacts.active[s, i]:
                    _solve_plane_contact(i, s, x, start, weights[i], contacts, t0, t1, pressed)


@njit(cache=True, error_model="numpy")
def _solve_plane_contact(i, s, x, start, weight, contacts, t0, t1, pressed):
    here, before = load(x, i), load(pressed[s], i)
    normal, place, offset, carried = plane_at(contacts, s, i, t0, t1)
    lack = offset - dot(normal, sub(here, place))
    pushed = dot(before, normal)
    push = max(0.0, pushed + lack / weight)
    here = axpy(weight * (push - pushed), normal, here)
    slip = sub(sub(here, load(start, i)), carried)
    rubbed = axpy(-pushed, normal, before)
    wanted = axpy(-1.0 / weight, axpy(-dot(slip, normal), normal, slip), rubbed)
    length, most = sqrt(dot(wanted, wanted)), contacts.friction[s] * push
    rub = scale(most / length, wanted) if length > most else wanted
    store(x, i, axpy(weight, sub(rub, rubbed), here))
    store(pressed[s], i, add(scale(push, normal), rub))
