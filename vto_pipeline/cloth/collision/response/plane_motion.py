"""Position of a contact plane within its contact span."""

from __future__ import annotations

from numba import njit

from vto_pipeline.numerics.vector import axpy, load, scale, sub, unit


@njit(cache=True, error_model="numpy")
def plane_at(contacts, s, i, t0, t1):
    """Return the plane of surface s for vertex i at the end of a step.

    Args:
        contacts: Planes of a span.
        s, i: Which.
        t0, t1: Begin and end of the step, as shares of the span.

    Returns:
        Unit normal; the point on the surface [m]; the distance to keep from it along the normal [m]; and how far the
        surface moves in the step [m].
    """
    p0, p1 = load(contacts.point[s, i], 0), load(contacts.point[s, i], 1)
    n0, n1 = load(contacts.normal[s, i], 0), load(contacts.normal[s, i], 1)
    away = sub(p1, p0)
    normal = unit(axpy(t1, sub(n1, n0), n0))
    offset = contacts.offset[s, i, 0] + t1 * (contacts.offset[s, i, 1] - contacts.offset[s, i, 0])
    return normal, axpy(t1, away, p0), offset, scale(t1 - t0, away)
