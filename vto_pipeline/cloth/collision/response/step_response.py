"""Contact response after a step of any solver."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from vto_pipeline.cloth.collision.response.plane_motion import plane_at
from vto_pipeline.numerics.mechanics.friction import friction_shift
from vto_pipeline.numerics.vector import add, axpy, dot, load, norm, scale, store, sub

_CHUNK = 512  # vertices a thread takes at a time


@njit(cache=True, error_model="numpy")
def resolve_plane_contacts(x, v, start, inverse_mass, contacts, t0, t1, h, longest, finish, threaded):
    """Put all vertices in front of their contact planes, with friction; to finish a step, take their speed.

    Args:
        x: Positions [m], shape (V, 3), changed in place.
        v: Velocities [m/s], shape (V, 3); written when the step is finished.
        start: Positions at the start of the step [m], shape (V, 3).
        inverse_mass: [1/kg], shape (V,); zero holds a vertex.
        contacts: Planes.
        t0, t1: Begin and end of the step, as shares of the span of the contacts.
        h: Step [s].
        longest: No vertex moves farther [m].
        finish: Whether this ends the step.
        threaded: Whether to use threads.
    """
    if threaded:
        _resolve_parallel(x, v, start, inverse_mass, contacts, t0, t1, h, longest, finish)
    else:
        _resolve(x, v, start, inverse_mass, contacts, t0, t1, h, longest, finish, np.int64(0), len(x))


@njit(cache=True, error_model="numpy", parallel=True)
def _resolve_parallel(x, v, start, inverse_mass, contacts, t0, t1, h, longest, finish):
    for chunk in prange((len(x) + _CHUNK - 1) // _CHUNK):
        first, last = _CHUNK * chunk, min(len(x), _CHUNK * chunk + _CHUNK)
        _resolve(x, v, start, inverse_mass, contacts, t0, t1, h, longest, finish, first, last)


@njit(cache=True, error_model="numpy")
def _resolve(x, v, start, inverse_mass, contacts, t0, t1, h, longest, finish, first, last):
    for i in range(first, last):
        if inverse_mass[i] == 0.0:
            continue
        begin, here = load(start, i), load(x, i)
        for s in range(len(contacts.friction)):
            if not contacts.active[s, i]:
                continue
            normal, place, offset, carried = plane_at(contacts, s, i, t0, t1)
            push = offset - dot(normal, sub(here, place))
            if push > 0.0:
                here = axpy(push, normal, here)
                slip = sub(sub(here, begin), carried)
                here = add(here, friction_shift(slip, normal, push, contacts.friction[s]))
        if finish:
            move = sub(here, begin)
            length = norm(move)
            if length > longest:
                here = axpy(longest / length, move, begin)
                move = sub(here, begin)
            store(v, i, scale(1.0 / h, move))
        store(x, i, here)
