"""Move a cloth so that rows hold, smoothly and without stretching it.

Rows and bars are projected one after the other, again and again (Müller et al. 2007, "Position based dynamics").
Neighbours drag each other along a little, so that what is pushed takes its surroundings with it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from vto_pipeline.geometry.topology import edges, hinges
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.vector import axpy, load, norm, scale, store, sub

_DRAG = 0.2  # share of the difference of their moves that the ends of a bar lose in a sweep
_OPEN = 0.5  # distance across a hinge, as a share of the flat one, to which a kink is opened


class LengthBounds(NamedTuple):
    """How far apart vertices may be: those of an edge, and those across it, which keep a hinge from folding flat.

    Args:
        ends: Edges first, shape (B, 2).
        least, most: [m], shape (B,).
        opened: What `least` is to be where the cloth is kinked [m], shape (B,).
    """

    ends: IntArray
    least: FloatArray
    most: FloatArray
    opened: FloatArray


def length_bounds(mesh: TriangleMesh, rest: FloatArray) -> LengthBounds:
    """Return bars that let the cloth be as it is, or as it is at rest, and what lies between.

    Args:
        mesh: Where it is [m].
        rest: Its shape without forces [m], shape (V, 3).
    """
    links, across = edges(mesh), hinges(mesh)
    length, natural = _lengths(mesh.vertices, links), _lengths(rest, links)
    opened = _OPEN * _flat(rest, across)
    least = np.minimum(_lengths(mesh.vertices, across[:, 2:]), opened)
    return LengthBounds(
        np.vstack([links, across[:, 2:]]),
        np.concatenate([np.minimum(length, natural), least]),
        np.concatenate([np.maximum(length, natural), np.full(len(across), np.inf)]),
        np.concatenate([natural, opened]),
    )


def with_kinks_opened(bars: LengthBounds, vertices: IntArray, count: int) -> LengthBounds:
    """Return the bars with kinks at these of this many vertices to be opened."""
    kinked = np.zeros(count, np.bool_)
    kinked[vertices] = True
    return bars._replace(least=np.where(kinked[bars.ends].any(axis=1), bars.opened, bars.least))


def length_violation(positions: FloatArray, bars: LengthBounds) -> float:
    """Return how far bars are from where they may be, rms [m]."""
    length = _lengths(positions, bars.ends)
    off = np.maximum(bars.least - length, 0.0) + np.maximum(length - bars.most, 0.0)
    return float(np.sqrt(np.mean(off**2)))


def _lengths(positions: FloatArray, ends: IntArray) -> FloatArray:
    length: FloatArray = np.linalg.norm(positions[ends[:, 1]] - positions[ends[:, 0]], axis=1)
    return length


def _flat(rest: FloatArray, hinge: IntArray) -> FloatArray:
    """Return how far apart the outer corners of two triangles are in the plane [m], shape (H,)."""
    a, b, c, d = (rest[hinge[:, k]] for k in range(4))
    along = b - a
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    place = [np.einsum("hd,hd->h", p - a, along) for p in (c, d)]
    height = [np.linalg.norm(p - a - s[:, None] * along, axis=1) for p, s in zip((c, d), place, strict=True)]
    flat: FloatArray = np.hypot(place[0] - place[1], height[0] + height[1])
    return flat


@njit(cache=True, error_model="numpy")
def project_rows_and_lengths(positions, rows, bars, sweeps, pressed):  # type: ignore[no-untyped-def]
    """Return the positions [m], shape (V, 3), after this many sweeps; the rows have the last word.

    Args:
        positions: [m], shape (V, 3).
        rows: `SeparationRows`.
        bars: `LengthBounds`.
        sweeps: How many.
        pressed: Share of its shortage that a bar regains in a sweep.
    """
    x = positions.copy()
    count = len(bars.ends)
    for sweep in range(sweeps):
        _project_rows(x, rows)
        for k in range(count):  # to and fro, so that no direction is preferred
            e = k if sweep % 2 == 0 else count - 1 - k
            i, j = bars.ends[e, 0], bars.ends[e, 1]
            a, b = load(x, i), load(x, j)
            lag = sub(sub(b, load(positions, j)), sub(a, load(positions, i)))
            a, b = axpy(0.5 * _DRAG, lag, a), axpy(-0.5 * _DRAG, lag, b)
            way = sub(b, a)
            length = norm(way)
            move = (0.0, 0.0, 0.0)
            if length > bars.most[e]:
                move = scale(0.5 * (1.0 - bars.most[e] / length), way)
            elif 0.0 < length < bars.least[e]:
                move = scale(0.5 * pressed * (1.0 - bars.least[e] / length), way)
            store(x, i, axpy(1.0, move, a))
            store(x, j, axpy(-1.0, move, b))
    _project_rows(x, rows)
    return x


@njit(cache=True, error_model="numpy")
def _project_rows(x, rows):  # type: ignore[no-untyped-def]
    for k in range(len(rows.level)):
        n = load(rows.normal, k)
        value, weight = -rows.level[k], 0.0
        for m in range(rows.vertices.shape[1]):
            c = rows.coefficients[k, m]
            if c != 0.0:
                at = rows.vertices[k, m]
                value += c * (n[0] * x[at, 0] + n[1] * x[at, 1] + n[2] * x[at, 2])
                weight += c * c
        if value < 0.0 and weight > 0.0:
            for m in range(rows.vertices.shape[1]):
                c = rows.coefficients[k, m]
                if c != 0.0:
                    at = rows.vertices[k, m]
                    store(x, at, axpy(-value * c / weight, n, load(x, at)))
