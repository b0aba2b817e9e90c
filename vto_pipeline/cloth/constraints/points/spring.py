"""Springs between pairs of vertices: energy ½ (|x₁ - x₀| - l)² / α with the compliance α [m/N]; α = 0 is a rigid rod.

Mass-spring cloth (Provot 1995), strands and chains. Two vertices in one place have no direction and do not push.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from vto_pipeline.cloth.constraints.kind import Kind
from vto_pipeline.numerics.linear.coloured_blocks import blocks
from vto_pipeline.numerics.mechanics.xpbd_row import multiplier_step
from vto_pipeline.numerics.vector import axpy, dot, load, norm, scale, store, store_at, sub, unit


class Spring(NamedTuple):
    """Springs, in the order in which they are solved.

    Args:
        vertices: Ends, shape (N, 2).
        rest: Rest length [m], shape (N,).
        compliance: [m/N], shape (N,).
        damping: Rayleigh's β, loss in proportion to stiffness [s]; the damper along the spring is β / α [N·s/m].
        starts, colours: See `numerics.blocks.Blocks`.
    """

    vertices: NDArray[np.int32]
    rest: NDArray[np.float64]
    compliance: NDArray[np.float64]
    damping: float
    starts: NDArray[np.int64]
    colours: NDArray[np.int64]


def springs(
    pairs: ArrayLike,
    positions: NDArray[np.float64],
    compliance: ArrayLike,
    *,
    rest: ArrayLike | None = None,
    damping: float = 0.0,
) -> Spring:
    """Return springs between these pairs of vertices.

    Args:
        pairs: Shape (N, 2).
        positions: Of all vertices [m], shape (V, 3); rest lengths are those between them when none are given.
        compliance: [m/N], shape (N,) or one for all; zero is rigid, for solvers that can take it.
        rest: Rest lengths [m], shape (N,) or one for all.
        damping: Rayleigh's β [s].
    """
    ends = np.asarray(pairs, dtype=np.int32).reshape(-1, 2)
    lengths = np.linalg.norm(positions[ends[:, 1]] - positions[ends[:, 0]], axis=1) if rest is None else rest
    order, starts, colours = blocks(ends, positions)
    return Spring(
        np.ascontiguousarray(ends[order]),
        np.broadcast_to(np.asarray(lengths, dtype=np.float64), len(ends))[order],
        np.broadcast_to(np.asarray(compliance, dtype=np.float64), len(ends))[order],
        damping,
        starts,
        colours,
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def _project(i, x, start, inverse_mass, data, multipliers, h):
    a, b = data.vertices[i, 0], data.vertices[i, 1]
    xa, xb = load(x, a), load(x, b)
    wa, wb = inverse_mass[a], inverse_mass[b]
    apart = sub(xb, xa)
    length = norm(apart)
    if length == 0.0 or wa + wb == 0.0:
        return
    along = scale(1.0 / length, apart)
    stretched = 0.0
    if data.damping > 0.0:
        stretched = dot(along, sub(sub(xb, load(start, b)), sub(xa, load(start, a))))
    soft, viscous = data.compliance[i] / (h * h), data.damping / h
    shift = multiplier_step(length - data.rest[i], wa + wb, soft, multipliers[i, 0], stretched, viscous)
    multipliers[i, 0] += shift
    store(x, a, axpy(-shift * wa, along, xa))
    store(x, b, axpy(shift * wb, along, xb))


@njit(cache=True, error_model="numpy", forceinline=True)
def _force(i, x, data, forces):
    a, b = data.vertices[i, 0], data.vertices[i, 1]
    apart = sub(load(x, b), load(x, a))
    longer = norm(apart) - data.rest[i]
    tension = longer / data.compliance[i]
    along = unit(apart)
    store(forces, a, axpy(tension, along, load(forces, a)))
    store(forces, b, axpy(-tension, along, load(forces, b)))
    return 0.5 * tension * longer


@njit(cache=True, error_model="numpy", forceinline=True)
def _linearise(i, x, data, values, gradients, compliance):
    apart = sub(load(x, data.vertices[i, 1]), load(x, data.vertices[i, 0]))
    along = unit(apart)
    values[0] = norm(apart) - data.rest[i]
    store_at(gradients, 0, 0, scale(-1.0, along))
    store_at(gradients, 0, 1, along)
    compliance[0, 0] = data.compliance[i]


@njit(cache=True, error_model="numpy", forceinline=True)
def _stiffness(i, x, data, material, stress, blocks):
    apart = sub(load(x, data.vertices[i, 1]), load(x, data.vertices[i, 0]))
    length = norm(apart)
    along = unit(apart)
    stiff = material / data.compliance[i]
    taut = stress * max(length - data.rest[i], 0.0) / (data.compliance[i] * length) if length > 0.0 else 0.0
    for k in range(3):
        for m in range(3):
            value = (stiff - taut) * along[k] * along[m] + (taut if k == m else 0.0)
            blocks[0, 0, k, m] = blocks[1, 1, k, m] = value
            blocks[0, 1, k, m] = blocks[1, 0, k, m] = -value


KIND = Kind(Spring, 1, _project, _force, _linearise, None, _stiffness)
