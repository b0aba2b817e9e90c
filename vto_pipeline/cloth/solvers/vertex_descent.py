"""Vertex block descent: each vertex to the minimum of its own quadratic model, neighbours fixed."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from vto_pipeline.cloth.collision.response.plane_motion import plane_at
from vto_pipeline.cloth.constraints.sweep import (
    linearise_one,
    rows_of,
    solve_compliance,
    stiffness_one,
    stiffness_scratch,
)
from vto_pipeline.cloth.implicit_step.iterated import ImplicitStep, Iterated
from vto_pipeline.cloth.model.build import ClothModel
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.numerics.vector import add, axpy, dot, load, norm, scale, store, sub


class VertexDescent(Iterated):
    """Gauss-Seidel over vertices on |x - x̃|²_M / 2 + h² E, with blocks of 3 x 3.

    Chen et al. 2024, "Vertex block descent". Vertices of one colour share no constraint and are moved at once, so the
    result does not depend on threads. Planes and friction are part of each vertex's own minimum. It takes no rigid
    constraints, and stiff ones slowly: neighbours hold a vertex where it is.

    Args:
        model, sweeps, damping, max_speed: See `Iterated`.
    """

    takes_rigid = False

    def __init__(self, model: ClothModel, *, sweeps: int = 1, damping: float = 0.0, max_speed: float = np.inf) -> None:
        super().__init__(model, sweeps=sweeps, damping=damping, max_speed=max_speed)
        self._around = tuple(_around(data, len(model.mass)) for data in model.constraints)
        starts, columns = _neighbours(model.constraints, len(model.mass))
        self._order, self._colours = _coloured(starts, columns, model.inverse_mass > 0.0)

    def solve(self, step: ImplicitStep, x: FloatArray) -> None:
        """See `Iterated.solve`."""
        model, inertia = self.model, self.model.mass / step.h**2
        forces, blocks = np.zeros_like(x), np.zeros((len(x), 3, 3))
        kinds = list(zip(model.constraints, self._around, strict=True))
        for _ in range(self.sweeps):
            for first, last in pairwise(self._colours):
                chosen = self._order[first:last]
                _begin(x, step.target, inertia, chosen, forces, blocks)
                for data, (starts, stencils) in kinds:
                    _add_kind(x, step.start, data, starts, stencils, step.h, chosen, forces, blocks)
                _move(x, step.start, forces, blocks, step.contacts, step.t0, step.t1, chosen)


def _around(data: Any, count: int) -> tuple[IntArray, IntArray]:
    """Return the stencils around each vertex: where its list starts, shape (V + 1,), and stencil · S + corner."""
    flat = data.vertices.ravel()
    order = np.argsort(flat, kind="stable").astype(np.int32)
    starts: IntArray = np.searchsorted(flat[order], np.arange(count + 1)).astype(np.int32)
    return starts, order


def _neighbours(constraints: tuple[Any, ...], count: int) -> tuple[IntArray, IntArray]:
    """Return the vertices that share a stencil with each vertex, itself among them."""
    keys = [np.arange(count, dtype=np.int64) * (count + 1)]
    for data in constraints:
        corners = data.vertices.shape[1]
        rows = np.repeat(data.vertices, corners, axis=1).astype(np.int64)
        keys.append((rows * count + np.tile(data.vertices, (1, corners))).ravel())
    pairs = np.unique(np.concatenate(keys))
    starts = np.searchsorted(pairs, np.arange(count + 1, dtype=np.int64) * count)
    return starts.astype(np.int32), (pairs % count).astype(np.int32)


def _coloured(starts: IntArray, columns: IntArray, free: NDArray[np.bool_]) -> tuple[IntArray, IntArray]:
    """Return free vertices by colour, shape (F,), and the place of each colour's first, shape (K + 1,)."""
    colour = _colour(starts, columns)
    by_colour = np.argsort(colour, kind="stable")
    order: IntArray = by_colour[free[by_colour]].astype(np.int32)
    places: IntArray = np.concatenate([[0], np.cumsum(np.bincount(colour[free]))]).astype(np.int32)
    return order, places


@njit(cache=True)
def _colour(starts, columns):
    """Return the smallest colour that no neighbour has, vertex by vertex."""
    count = len(starts) - 1
    colour = np.full(count, -1, np.int32)
    taken = np.full(count + 1, -1, np.int32)
    for i in range(count):
        for k in range(starts[i], starts[i + 1]):
            if colour[columns[k]] >= 0:
                taken[colour[columns[k]]] = i
        free = 0
        while taken[free] == i:
            free += 1
        colour[i] = free
    return colour


@njit(cache=True, error_model="numpy")
def _begin(x, target, inertia, chosen, forces, blocks):
    for i in chosen:
        for k in range(3):
            forces[i, k] = inertia[i] * (target[i, k] - x[i, k])
            for m in range(3):
                blocks[i, k, m] = inertia[i] if k == m else 0.0


@njit(cache=True, error_model="numpy", parallel=True)
def _move(x, start, forces, blocks, contacts, t0, t1, chosen):
    for k in prange(len(chosen)):
        _move_vertex(chosen[k], x, start, forces, blocks, contacts, t0, t1)


@njit(cache=True, error_model="numpy")
def _move_vertex(i, x, start, forces, blocks, contacts, t0, t1):
    inverse = np.eye(3)
    solve_compliance(blocks[i], inverse)
    here = add(_times(inverse, load(forces, i)), load(x, i))
    for s in range(len(contacts.friction)):
        if contacts.active[s, i]:
            here = _before_plane(i, s, here, load(start, i), inverse, contacts, t0, t1)
    store(x, i, here)


@njit(cache=True, error_model="numpy")
def _before_plane(i, s, here, begin, inverse, contacts, t0, t1):
    """Return the minimum of a vertex's quadratic model in front of a plane, with Coulomb friction against its slip."""
    normal, place, offset, carried = plane_at(contacts, s, i, t0, t1)
    lack = offset - dot(normal, sub(here, place))
    if lack <= 0.0:
        return here
    give = _times(inverse, normal)
    push = lack / dot(normal, give)
    here = axpy(push, give, here)
    slip = sub(sub(here, begin), carried)
    slip = axpy(-dot(slip, normal), normal, slip)
    length = norm(slip)
    if length == 0.0:
        return here
    along = scale(1.0 / length, slip)
    rubbed = min(length, contacts.friction[s] * push * dot(along, _times(inverse, along)))
    return axpy(-rubbed, along, here)


@njit(cache=True, error_model="numpy")
def _times(matrix, a):
    return dot(load(matrix, 0), a), dot(load(matrix, 1), a), dot(load(matrix, 2), a)


@njit(cache=True, error_model="numpy", parallel=True)
def _add_kind(x, start, data, starts, stencils, h, chosen, forces, blocks):
    for k in prange(len(chosen)):
        _add_vertex(chosen[k], x, start, data, starts, stencils, h, forces, blocks)


@njit(cache=True, error_model="numpy")
def _add_vertex(i, x, start, data, starts, stencils, h, forces, blocks):
    """Add the forces of one kind on vertex i, and their stiffness."""
    rows, corners = rows_of(data), data.vertices.shape[1]
    values, stress, gradients = np.empty(rows), np.empty((rows, 1)), np.empty((rows, corners, 3))
    compliance, local = np.empty((rows, rows)), np.empty((corners, corners, 3, 3))
    scratch = stiffness_scratch(data)
    viscous = data.damping / h
    for place in range(starts[i], starts[i + 1]):
        stencil, corner = stencils[place] // corners, stencils[place] % corners
        linearise_one(stencil, x, data, values, gradients, compliance)
        for b in range(rows):
            stress[b, 0] = values[b]
            if viscous > 0.0:
                for s in range(corners):
                    vertex = data.vertices[stencil, s]
                    for k in range(3):
                        stress[b, 0] += viscous * gradients[b, s, k] * (x[vertex, k] - start[vertex, k])
        solve_compliance(compliance, stress)
        stiffness_one(stencil, x, data, 1.0 + viscous, 1.0, local, scratch)
        for k in range(3):
            for b in range(rows):
                forces[i, k] -= gradients[b, corner, k] * stress[b, 0]
            for m in range(3):
                blocks[i, k, m] += local[corner, corner, k, m]
