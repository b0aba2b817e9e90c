"""A weighted sum of four points of the cloth at a place in space: C = Σ c_s x_s - target, three equal rows.

One kind for all that is linear in the positions: isometric bending, attachments; see their builders.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from vto_pipeline.cloth.constraints.kind import Kind
from vto_pipeline.numerics.linear.coloured_blocks import blocks
from vto_pipeline.numerics.mechanics.xpbd_row import multiplier_step
from vto_pipeline.numerics.vector import add, axpy, dot, load, scale, store, sub

_CANCELLED = 1e-9  # of the weights: what rounding leaves of them


class Combination(NamedTuple):
    """Weighted sums, in the order in which they are solved.

    Args:
        vertices: Shape (N, 4). A vertex may be repeated with no weight.
        weights: c, shape (N, 4).
        target: [m], shape (N, 3). May be moved between steps.
        compliance: α of each of the three rows, shape (N,); zero is rigid.
        damping: Rayleigh's β, loss in proportion to stiffness [s].
        starts, colours: See `numerics.blocks.Blocks`.
    """

    vertices: NDArray[np.int32]
    weights: NDArray[np.float64]
    target: NDArray[np.float64]
    compliance: NDArray[np.float64]
    damping: float
    starts: NDArray[np.int64]
    colours: NDArray[np.int64]


def combinations(
    vertices: NDArray[np.int32],
    weights: NDArray[np.float64],
    target: NDArray[np.float64] | None,
    compliance: ArrayLike,
    positions: NDArray[np.float64],
    damping: float,
) -> Combination:
    """Return weighted sums of vertices.

    Args:
        vertices: Shape (N, 4).
        weights: c, shape (N, 4).
        target: [m], shape (N, 3); the origin when None.
        compliance: Shape (N,) or one for all.
        positions: Of all vertices, by which they are put in order [m], shape (V, 3).
        damping: Rayleigh's β [s].
    """
    order, starts, colours = blocks(vertices, positions)
    places = np.zeros((len(vertices), 3)) if target is None else np.asarray(target, dtype=np.float64)
    soft = np.broadcast_to(np.asarray(compliance, dtype=np.float64), len(vertices))
    return Combination(
        np.ascontiguousarray(vertices[order], dtype=np.int32),
        np.ascontiguousarray(weights[order], dtype=np.float64),
        places[order],
        soft[order],
        damping,
        starts,
        colours,
    )


def holds_to_place(data: Combination) -> NDArray[np.bool_]:
    """Return which sums resist a shift of the whole cloth, shape (N,): those whose weights do not cancel."""
    weights = data.weights
    return np.abs(weights.sum(axis=1)) > _CANCELLED * np.abs(weights).sum(axis=1)


@njit(cache=True, error_model="numpy", forceinline=True)
def _sum(i, x, data):
    """Return Σ c_s x_s."""
    total = (0.0, 0.0, 0.0)
    for s in range(4):
        total = axpy(data.weights[i, s], load(x, data.vertices[i, s]), total)
    return total


@njit(cache=True, error_model="numpy", forceinline=True)
def _gap(i, x, data):
    """Return C."""
    return sub(_sum(i, x, data), load(data.target, i))


@njit(cache=True, error_model="numpy", forceinline=True)
def _project(i, x, start, inverse_mass, data, multipliers, h):
    weight = 0.0
    for s in range(4):
        weight += inverse_mass[data.vertices[i, s]] * data.weights[i, s] ** 2
    if weight == 0.0:
        return
    moved = (0.0, 0.0, 0.0)
    if data.damping > 0.0:
        moved = sub(_sum(i, x, data), _sum(i, start, data))
    gap, before = _gap(i, x, data), load(multipliers, i)
    soft, viscous = data.compliance[i] / (h * h), data.damping / h
    shift = (
        multiplier_step(gap[0], weight, soft, before[0], moved[0], viscous),
        multiplier_step(gap[1], weight, soft, before[1], moved[1], viscous),
        multiplier_step(gap[2], weight, soft, before[2], moved[2], viscous),
    )
    store(multipliers, i, add(before, shift))
    for s in range(4):
        v = data.vertices[i, s]
        store(x, v, axpy(inverse_mass[v] * data.weights[i, s], shift, load(x, v)))


@njit(cache=True, error_model="numpy", forceinline=True)
def _force(i, x, data, forces):
    gap = _gap(i, x, data)
    pull = scale(-1.0 / data.compliance[i], gap)
    for s in range(4):
        v = data.vertices[i, s]
        store(forces, v, axpy(data.weights[i, s], pull, load(forces, v)))
    return -0.5 * dot(pull, gap)


@njit(cache=True, error_model="numpy", forceinline=True)
def _linearise(i, x, data, values, gradients, compliance):
    values[0], values[1], values[2] = _gap(i, x, data)
    gradients[:] = 0.0
    compliance[:] = 0.0
    for row in range(3):
        compliance[row, row] = data.compliance[i]
        for s in range(4):
            gradients[row, s, row] = data.weights[i, s]


@njit(cache=True, error_model="numpy", forceinline=True)
def _stiffness(i, x, data, material, stress, blocks):
    """The exact one: constant, and nothing from stress."""
    blocks[:] = 0.0
    stiff = material / data.compliance[i]
    for a in range(4):
        for b in range(4):
            for k in range(3):
                blocks[a, b, k, k] = stiff * data.weights[i, a] * data.weights[i, b]


KIND = Kind(Combination, 3, _project, _force, _linearise, None, _stiffness)
