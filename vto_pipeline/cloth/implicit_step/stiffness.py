"""The matrix m M + s K of an implicit step: one pattern per cloth, values at each position.

The stiffness that steps use as a rule is kept positive semidefinite by leaving out what pressure takes away. The exact
one, indefinite where the cloth is about to buckle, is what a kind brings along, or else made of differences of the
forces, stencil by stencil.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from vto_pipeline.cloth.constraints.sweep import (
    PARALLEL_FROM,
    exact_one,
    force_one,
    kind_of,
    prepare,
    stiffness_one,
    stiffness_scratch,
)
from vto_pipeline.cloth.model.build import ClothModel
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.linear.block_matrix import BlockMatrix, pattern

_STEP = 1e-5  # of an edge: the error of central differences is its square, rounding a hundred-thousandth of an angle


class Stiffness:
    """The stiffness K = Σ ∇Cᵀ α⁻¹ ∇C + what stress adds, both positive semidefinite, of a cloth.

    Args:
        model: The cloth. Held vertices have an identity row and column.
    """

    def __init__(self, model: ClothModel) -> None:
        rows, columns = [np.empty(0, np.int32)], [np.empty(0, np.int32)]
        for data in model.constraints:
            corners = data.vertices.shape[1]
            rows.append(np.repeat(data.vertices, corners, axis=1).reshape(-1))
            columns.append(np.tile(data.vertices, (1, corners)).reshape(-1))
        self._matrix, places = pattern(np.concatenate(rows), np.concatenate(columns), len(model.mass))
        self._model = model
        self._places = []
        first = 0
        for data in model.constraints:
            count, corners = data.vertices.shape
            last = first + count * corners * corners
            self._places.append(places[first:last].reshape(count, corners, corners))
            first = last
        self._held = model.inverse_mass == 0.0

    @property
    def matrix(self) -> BlockMatrix:
        """The matrix that `assemble` writes."""
        return self._matrix

    def write_to(self, blocks: FloatArray) -> None:
        """Let `assemble` write its blocks here from now on, shape (B, 3, 3)."""
        self._matrix = self._matrix._replace(blocks=blocks)

    def assemble(
        self, x: FloatArray, mass_factor: float = 0.0, stiffness_factor: float = 1.0, damping_factor: float = 0.0
    ) -> BlockMatrix:
        """Return m M + s K + d Σ β ∇Cᵀ α⁻¹ ∇C at positions x [m], shape (V, 3).

        The matrix is overwritten by the next call.
        """
        _clear(self._matrix, self._held, mass_factor * self._model.mass)
        for data, places in zip(self._model.constraints, self._places, strict=True):
            prepare(x, data)
            material = stiffness_factor + damping_factor * data.damping
            _assemble(x, data, places, self._held, material, stiffness_factor, False, self._matrix.blocks)
        return self._matrix

    def assemble_exact(self, x: FloatArray, mass_factor: float = 0.0, damping_factor: float = 0.0) -> BlockMatrix:
        """Return m M - ∂f/∂x + d Σ β ∇Cᵀ α⁻¹ ∇C at positions x [m], shape (V, 3); symmetric but for rounding.

        Of a kind whose stencils share something, ∇Cᵀ α⁻¹ ∇C stands for what changes with that.

        The matrix is overwritten by the next call.
        """
        matrix = self._matrix
        _clear(matrix, self._held, mass_factor * self._model.mass)
        here, forces = x.copy(), np.empty_like(x)
        for data, places in zip(self._model.constraints, self._places, strict=True):
            prepare(x, data)
            known, damped = kind_of(data).exact is not None, damping_factor * data.damping
            _assemble(x, data, places, self._held, damped + known, 0.0, known, matrix.blocks)
            if not known:
                _differ(here, data, places, self._held, _STEP * self._model.edge_length, forces, matrix.blocks)
        return matrix


@njit(cache=True, error_model="numpy")
def _clear(matrix, held, mass):
    matrix.blocks[:] = 0.0
    for i in range(len(held)):
        for k in range(3):
            matrix.blocks[matrix.diagonal[i], k, k] = 1.0 if held[i] else mass[i]


@njit(cache=True, error_model="numpy")
def _assemble(x, data, places, held, material, stress, exact, blocks):
    for colour in range(len(data.colours) - 1):
        first, last = data.colours[colour], data.colours[colour + 1]
        if len(x) >= PARALLEL_FROM and last - first > 1:
            _assemble_colour(x, data, places, held, material, stress, exact, blocks, first, last)
        else:
            for block in range(first, last):
                _assemble_block(x, data, places, held, material, stress, exact, blocks, block)


@njit(cache=True, error_model="numpy", parallel=True)
def _assemble_colour(x, data, places, held, material, stress, exact, blocks, first, last):
    for block in prange(first, last):
        _assemble_block(x, data, places, held, material, stress, exact, blocks, block)


@njit(cache=True, error_model="numpy")
def _assemble_block(x, data, places, held, material, stress, exact, blocks, block):
    corners = data.vertices.shape[1]
    local = np.empty((corners, corners, 3, 3))
    scratch = stiffness_scratch(data)
    for i in range(data.starts[block], data.starts[block + 1]):
        if exact:
            exact_one(i, x, data, material, local)
        else:
            stiffness_one(i, x, data, material, stress, local, scratch)
        for a in range(corners):
            if held[data.vertices[i, a]]:
                continue
            for b in range(corners):
                if held[data.vertices[i, b]]:
                    continue
                place = places[i, a, b]
                for k in range(3):
                    for m in range(3):
                        blocks[place, k, m] += local[a, b, k, m]


@njit(cache=True, error_model="numpy")
def _differ(x, data, places, held, step, forces, blocks):
    for colour in range(len(data.colours) - 1):
        first, last = data.colours[colour], data.colours[colour + 1]
        if len(x) >= PARALLEL_FROM and last - first > 1:
            _differ_colour(x, data, places, held, step, forces, blocks, first, last)
        else:
            for block in range(first, last):
                _differ_block(x, data, places, held, step, forces, blocks, block)


@njit(cache=True, error_model="numpy", parallel=True)
def _differ_colour(x, data, places, held, step, forces, blocks, first, last):
    for block in prange(first, last):
        _differ_block(x, data, places, held, step, forces, blocks, block)


@njit(cache=True, error_model="numpy")
def _differ_block(x, data, places, held, step, forces, blocks, block):
    """Add -∂f/∂x of each stencil: its vertices are moved, and back, which no other block of a colour has.

    Moved all together they feel nothing: the last corner's column is what makes the rows' sums zero.
    """
    count = data.vertices.shape[1]
    moves, columns = np.empty(count, np.bool_), np.empty((count, 3, 3))
    for i in range(data.starts[block], data.starts[block + 1]):
        corners = data.vertices[i]
        last = count - 1
        for b in range(count):
            moves[b] = not held[corners[b]]
            for a in range(b):  # another one again, in the place of one that is missing at a rim
                moves[b] &= corners[a] != corners[b]
            if not moves[b]:
                last = -1
        for b in range(count):
            if b == last or not moves[b]:
                continue
            for m in range(3):
                here = x[corners[b], m]
                for side in (1.0, -1.0):
                    for a in corners:
                        forces[a, 0] = forces[a, 1] = forces[a, 2] = 0.0
                    x[corners[b], m] = here + side * step
                    force_one(i, x, data, forces)
                    for a in range(count):
                        for k in range(3):
                            before = 0.0 if side > 0.0 else columns[a, k, m]
                            columns[a, k, m] = before - side * forces[corners[a], k] / (2.0 * step)
                x[corners[b], m] = here
            for a in range(count):
                if not moves[a]:
                    continue
                for k in range(3):
                    for m in range(3):
                        blocks[places[i, a, b], k, m] += columns[a, k, m]
                        if last >= 0:
                            blocks[places[i, a, last], k, m] -= columns[a, k, m]
