"""Whether part of a hem ended turned up."""

from __future__ import annotations

import numpy as np

from vto_pipeline.geometry.geodesic import nearest_source
from vto_pipeline.geometry.topology import boundary_loops
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

_STRIP = 0.05
"""Width of the strip of cloth along a hem whose direction counts [m]."""
_DOWN = 0.5
"""Sine of the angle below the horizontal: where half of the strip points farther down, an opening is a hem."""
_UP = 0.3
"""Sine of the angle above the horizontal at which a strip is turned up: what flares widely stays below."""
_TOLD = 0.05
"""So much of a hem is told of [m]."""


def warn_if_turned_up(draped: TriangleMesh, job: Job) -> dict[str, object]:
    """Warn if part of a hem points upward, and return how much.

    A skirt that began as a flat disc may fold over as it falls, and come to rest so, even without friction. A person
    would pull it down.

    Args:
        draped: The garment on the body [m].
        job: Warned with the length and the place.

    Returns:
        turned_up_mm: length of all hems that is; nothing where there is no hem.
    """
    x, turned, hems, most, place = draped.vertices, 0.0, 0, _UP, draped.vertices[0]
    for loop in boundary_loops(draped):
        away, source = nearest_source(draped, loop, 1.2 * _STRIP)
        inner = np.flatnonzero((away > 0.8 * _STRIP) & np.isfinite(away))
        if len(inner) == 0:
            continue
        strip = x[source[inner]] - x[inner]
        up = strip[:, 1] / np.maximum(np.linalg.norm(strip, axis=1), 1e-12)
        if np.median(up) > -_DOWN:
            continue
        hems += 1
        each = np.linalg.norm(x[np.roll(loop, -1)] - x[loop], axis=1)
        turned += float(each[_along(loop, each, source[inner], up) > _UP].sum())
        if up.max() > most:
            most, place = up.max(), x[inner[up.argmax()]]
    if hems == 0:
        return {}
    if turned > _TOLD:
        job.warn(
            f"a hem is turned up along {100 * turned:.0f} cm, near ({place[0]:.2f}, {place[1]:.2f}, {place[2]:.2f}): "
            "the cloth folded over as it fell, which says nothing of the fit"
        )
    return {"turned_up_mm": 1e3 * turned}


def _along(loop: IntArray, each: FloatArray, source: IntArray, value: FloatArray) -> FloatArray:
    """Return the means of the values (N,) that are of each vertex of a loop (L,), or between its neighbours'.

    Args:
        loop: Vertices, shape (L,).
        each: Way from each to the next [m], shape (L,).
        source: Of which vertex each value is, shape (N,).
        value: Shape (N,).
    """
    size = max(int(source.max()), int(loop.max())) + 1
    count, total = np.bincount(source, minlength=size)[loop], np.bincount(source, value, size)[loop]
    place, told = np.cumsum(each) - each, count > 0
    return np.interp(place, place[told], total[told] / count[told], period=each.sum())
