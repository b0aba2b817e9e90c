"""The system of an implicit step in its multipliers, for constraints of any kind.

From (x, λ), a change Δλ moves the vertices by Δx = W ∇Cᵀ Δλ, and solves the step where A Δλ = r with
A = (1 + γ) ∇C W ∇Cᵀ + α̃ and r = -(C + α̃ λ + γ ∇C (x - xⁿ)); Macklin et al. 2016, eq. 15 to 18.

What is left out there is left out here: ∇C turns while λ grows, so that M (x - x̃) and ∇C(x)ᵀ λ part by the order of
h² |a| times how far the threads turn in the step. Small steps make that small; `geometric_stiffness` puts it back.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import njit, prange

from vto_pipeline.cloth.constraints.sweep import PARALLEL_FROM, kind_of, linearise_one, prepare, rows_of
from vto_pipeline.cloth.model.build import ClothModel
from vto_pipeline.model.arrays import FloatArray, IntArray

_CHUNK = 128  # stencils a thread takes at a time
_NOTHING = 1e-13  # a pivot smaller than this share of what it was is rounding


class LinearisedConstraints(NamedTuple):
    """The constraints of one kind, linearised. Arrays are overwritten by each linearisation.

    Args:
        vertices: Shape (N, S).
        starts, colours: See `numerics.blocks.Blocks`.
        viscous: γ = β / h, shape (1,).
        gradients: ∇C, shape (N, B, S, 3).
        soft: α̃ = α / h², shape (N, B, B).
        residual: r, shape (N, B).
        inverse: Inverse of A's diagonal block, shape (N, B, B).
        multipliers: λ so far in this step, shape (N, B).
    """

    vertices: IntArray
    starts: IntArray
    colours: IntArray
    viscous: FloatArray
    gradients: FloatArray
    soft: FloatArray
    residual: FloatArray
    inverse: FloatArray
    multipliers: FloatArray


class Linearised:
    """The linearised step of a cloth, with its memory.

    Args:
        model: The cloth.

    Attributes:
        kinds: Each kind's rows.
    """

    def __init__(self, model: ClothModel) -> None:
        self.kinds = tuple(_empty_constraints(data) for data in model.constraints)
        self._model = model
        self._pull = np.zeros((len(model.mass), 3))

    @property
    def multipliers(self) -> tuple[FloatArray, ...]:
        """Return λ of each kind, shape (N, B) each; writing to it changes λ."""
        return tuple(rows.multipliers for rows in self.kinds)

    def reset(self) -> None:
        """Set λ to zero, as at the start of a step."""
        for one in self.multipliers:
            one[:] = 0.0

    def at(self, x: FloatArray, start: FloatArray, h: float) -> tuple[FloatArray, ...]:
        """Linearise at positions x, with those at the start of the step, both [m], shape (V, 3); h [s].

        Returns:
            r of each kind, shape (N, B) each; the next call overwrites it.
        """
        for data, rows in zip(self._model.constraints, self.kinds, strict=True):
            rows.viscous[0] = data.damping / h
            prepare(x, data)
            _linearise(x, start, self._model.inverse_mass, h, data, rows)
        return tuple(rows.residual for rows in self.kinds)

    def precondition(self, source: Sequence[FloatArray], out: Sequence[FloatArray]) -> None:
        """Write D⁻¹ source into out, with A's block diagonal D."""
        for rows, right, solved in zip(self.kinds, source, out, strict=True):
            _multiply_blocks(rows.inverse, right, solved)

    def apply(self, source: Sequence[FloatArray], out: Sequence[FloatArray]) -> None:
        """Write A source into out."""
        self.pull(source)
        for rows, right, product in zip(self.kinds, source, out, strict=True):
            _gather(rows, self._model.inverse_mass, self._pull, right, product)

    def move(self, x: FloatArray, change: Sequence[FloatArray]) -> None:
        """Add a change to λ, and what it moves to x [m], shape (V, 3)."""
        self.pull(change)
        for rows, one in zip(self.kinds, change, strict=True):
            rows.multipliers[:] += one
        x += self._model.inverse_mass[:, None] * self._pull

    def pull(self, source: Sequence[FloatArray]) -> FloatArray:
        """Return ∇Cᵀ source, shape (V, 3); the next call overwrites it."""
        self._pull[:] = 0.0
        for rows, right in zip(self.kinds, source, strict=True):
            _scatter(rows, right, self._pull)
        return self._pull


def inner(one: Sequence[FloatArray], other: Sequence[FloatArray]) -> float:
    """Return the inner product of two sets of multipliers."""
    return sum(float(np.vdot(a, b)) for a, b in zip(one, other, strict=True))


def _empty_constraints(data: Any) -> LinearisedConstraints:
    count, corners = data.vertices.shape
    rows = kind_of(data).rows
    return LinearisedConstraints(
        data.vertices,
        data.starts,
        data.colours,
        np.zeros(1),
        np.zeros((count, rows, corners, 3)),
        np.zeros((count, rows, rows)),
        np.zeros((count, rows)),
        np.zeros((count, rows, rows)),
        np.zeros((count, rows)),
    )


@njit(cache=True, error_model="numpy", parallel=True)
def _linearise(x, start, inverse_mass, h, data, rows):
    count = len(data.vertices)
    for chunk in prange((count + _CHUNK - 1) // _CHUNK):
        for i in range(_CHUNK * chunk, min(count, _CHUNK * chunk + _CHUNK)):
            _linearise_stencil(i, x, start, inverse_mass, h, data, rows)


@njit(cache=True, error_model="numpy")
def _linearise_stencil(i, x, start, inverse_mass, h, data, rows):
    size, corners, viscous = rows_of(data), data.vertices.shape[1], rows.viscous[0]
    gradients, soft, left, block = rows.gradients[i], rows.soft[i], rows.residual[i], rows.inverse[i]
    linearise_one(i, x, data, left, gradients, soft)
    for b in range(size):
        for s in range(corners):
            vertex = data.vertices[i, s]
            for k in range(3):
                left[b] += viscous * gradients[b, s, k] * (x[vertex, k] - start[vertex, k])
        for c in range(size):
            soft[b, c] /= h * h
            left[b] += soft[b, c] * rows.multipliers[i, c]
            block[b, c] = soft[b, c]
            for s in range(corners):
                weight = (1.0 + viscous) * inverse_mass[data.vertices[i, s]]
                for k in range(3):
                    block[b, c] += weight * gradients[b, s, k] * gradients[c, s, k]
        left[b] = -left[b]
    _invert(block)


@njit(cache=True, error_model="numpy")
def _invert(block):
    """Invert a positive semidefinite matrix in place by Gauss-Jordan; what has no pivot left gets zero."""
    size = len(block)
    before = np.empty(size)
    for j in range(size):
        before[j] = block[j, j]
    for j in range(size):
        solid = block[j, j] > _NOTHING * before[j]
        pivot = 1.0 / block[j, j] if solid else 0.0
        for i in range(size):
            if i == j:
                continue
            factor = block[i, j] * pivot
            for k in range(size):
                if k != j:
                    block[i, k] -= factor * block[j, k]
            block[i, j] = -factor
        for k in range(size):
            block[j, k] = block[j, k] * pivot
        block[j, j] = pivot


@njit(cache=True, error_model="numpy")
def _scatter(rows, source, out):
    for colour in range(len(rows.colours) - 1):
        first, last = rows.colours[colour], rows.colours[colour + 1]
        if len(out) >= PARALLEL_FROM and last - first > 1:
            _scatter_colour(rows, source, out, first, last)
        else:
            for block in range(first, last):
                _scatter_block(rows, source, out, block)


@njit(cache=True, error_model="numpy", parallel=True)
def _scatter_colour(rows, source, out, first, last):
    for block in prange(first, last):
        _scatter_block(rows, source, out, block)


@njit(cache=True, error_model="numpy")
def _scatter_block(rows, source, out, block):
    _, size, corners, _ = rows.gradients.shape
    for i in range(rows.starts[block], rows.starts[block + 1]):
        for s in range(corners):
            vertex = rows.vertices[i, s]
            for b in range(size):
                for k in range(3):
                    out[vertex, k] += source[i, b] * rows.gradients[i, b, s, k]


@njit(cache=True, error_model="numpy", parallel=True)
def _gather(rows, weights, pull, source, out):
    for i in prange(len(source)):
        _gather_stencil(i, rows, weights, pull, source, out)


@njit(cache=True, error_model="numpy")
def _gather_stencil(i, rows, weights, pull, source, out):
    _, size, corners, _ = rows.gradients.shape
    whole = 1.0 + rows.viscous[0]
    for b in range(size):
        total = 0.0
        for s in range(corners):
            vertex = rows.vertices[i, s]
            for k in range(3):
                total += whole * weights[vertex] * rows.gradients[i, b, s, k] * pull[vertex, k]
        for c in range(size):
            total += rows.soft[i, b, c] * source[i, c]
        out[i, b] = total


@njit(cache=True, error_model="numpy", parallel=True)
def _multiply_blocks(blocks, source, out):
    for i in prange(len(source)):
        for b in range(source.shape[1]):
            out[i, b] = 0.0
            for c in range(source.shape[1]):
                out[i, b] += blocks[i, b, c] * source[i, c]
