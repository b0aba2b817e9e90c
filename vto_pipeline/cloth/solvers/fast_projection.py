"""Newton's method on positions and multipliers together, with a sparse direct solve."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray
from scipy.sparse import block_array, block_diag, bsr_array, coo_array, csr_array, diags_array, vstack
from scipy.sparse.linalg import splu

from vto_pipeline.cloth.constraints.rigid import rigid_kind
from vto_pipeline.cloth.constraints.sweep import stiffness_one, stiffness_scratch
from vto_pipeline.cloth.implicit_step.dual_system import LinearisedConstraints
from vto_pipeline.cloth.implicit_step.iterated import DualIterated, ImplicitStep
from vto_pipeline.cloth.implicit_step.line_search import Merit
from vto_pipeline.cloth.implicit_step.plane_multiplier import solve_plane_contacts
from vto_pipeline.cloth.model.build import ClothModel
from vto_pipeline.model.arrays import FloatArray

_REGULARISED = 1e-12  # share of ∇C W ∇Cᵀ that a row gets as compliance: rigid rows that repeat each other stay solvable


class FastProjection(DualIterated):
    """All constraints at once, with a direct solve in each iteration.

    Goldenthal et al. 2007 project onto rigid constraints; with compliance the projection ends in backward Euler. The
    matrix [[M + h² K, ∇Cᵀ], [∇C, -α̃]], with what stress adds to the stiffness in K, is quasidefinite and needs no
    pivoting (Vanderbei 1995). A step is shortened until it leads down. Planes are rows too: those that push, or that x
    is behind (the primal-dual active set of Hintermüller, Ito & Kunisch 2002); friction comes last, from what they
    push. With a rigid constraint there is neither K nor a shorter step, which is the projection as published.

    Args:
        model, sweeps, damping, max_speed: See `Iterated`.
    """

    def __init__(self, model: ClothModel, *, sweeps: int = 1, damping: float = 0.0, max_speed: float = np.inf) -> None:
        super().__init__(model, sweeps=sweeps, damping=damping, max_speed=max_speed)
        self._free = np.repeat(model.inverse_mass > 0.0, 3)

    def solve(self, step: ImplicitStep, x: FloatArray) -> None:
        """See `Iterated.solve`."""
        self.linear.reset()
        merit = None if rigid_kind(self.model.constraints, step.start) else Merit(self.model, step)
        normals, heights = step.planes()
        able = step.contacts.active & (self.model.inverse_mass > 0.0)
        pushes = np.zeros(heights.shape)
        for _ in range(self.sweeps):
            if not np.isfinite(x).all():
                break
            gaps = np.einsum("svk,vk->sv", normals, x) - heights
            working = able & (pushes - gaps * self.model.mass > 0.0)
            planes = _plane_rows(working, normals)
            moved, pushed = self._direction(step, x, planes, gaps[working], pushes[working], merit is not None)
            pushes[:] = 0.0
            pushes[working] = np.maximum(pushed, 0.0)
            share = 1.0 if merit is None else merit.share(x, moved, pushes)
            x += share * moved
        weights = self.model.inverse_mass
        solve_plane_contacts(x, step.start, weights, step.contacts, step.t0, step.t1, pushes[:, :, None] * normals)

    def _direction(
        self,
        step: ImplicitStep,
        x: FloatArray,
        planes: csr_array,
        gaps: FloatArray,
        pushes: FloatArray,
        stressed: bool,
    ) -> tuple[FloatArray, FloatArray]:
        """Return the step of Newton's method [m], shape (V, 3), and what planes push after it [kg m]; λ is changed."""
        linear, model, free = self.linear, self.model, self._free
        residuals = linear.at(x, step.start, step.h)
        inertia = np.where(model.inverse_mass > 0.0, model.mass, 0.0)[:, None] * (step.target - x)
        if not stressed:  # what the turning of gradients left behind is not asked for: see `linearised`
            inertia = -linear.pull(linear.multipliers) - (planes.T @ pushes).reshape(x.shape)
            inertia[model.inverse_mass == 0.0] = 0.0
        corner = diags_array(np.where(free, np.repeat(model.mass, 3), 1.0)).tocsr()
        rows, right, softs = [], [], []
        for data, kind, residual in zip(model.constraints, linear.kinds, residuals, strict=True):
            whole = 1.0 + kind.viscous[0]
            rows.append(_jacobian(kind, free))
            softs.append(_soft(kind) / whole)
            # the unknown is the new λ, not its change: what x̃ and λ owe each other then cancels
            right.append((residual + np.einsum("nbc,nc->nb", kind.soft, kind.multipliers)).ravel() / whole)
            if stressed:
                corner = corner + _stiffness(_stress(x, data), kind, step.h, free)
        jacobian = vstack([*rows, planes], format="csr")
        soft = block_diag([*softs, coo_array((len(gaps), len(gaps)))], format="csr")
        spread = jacobian.power(2) @ np.repeat(model.inverse_mass, 3) + np.finfo(float).tiny
        matrix = block_array(
            [[corner, jacobian.T], [jacobian, -soft - diags_array(_REGULARISED * spread)]], format="csc"
        )
        factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        found = factors.solve(np.concatenate([inertia.ravel(), *right, -gaps]))
        place = x.size
        for one in linear.multipliers:
            one[:] = -found[place : place + one.size].reshape(one.shape)
            place += one.size
        return found[: x.size].reshape(x.shape), -found[place:]


def _plane_rows(working: NDArray[np.bool_], normals: FloatArray) -> csr_array:
    _, vertex = np.nonzero(working)
    columns = 3 * vertex[:, None] + np.arange(3)
    starts = 3 * np.arange(len(vertex) + 1)
    return csr_array((normals[working].ravel(), columns.ravel(), starts), shape=(len(vertex), 3 * working.shape[1]))


def _jacobian(rows: LinearisedConstraints, free: NDArray[np.bool_]) -> csr_array:
    count, size, corners, _ = rows.gradients.shape
    columns = np.broadcast_to((3 * rows.vertices[:, :, None] + np.arange(3))[:, None], rows.gradients.shape)
    starts = 3 * corners * np.arange(count * size + 1)
    values = (rows.gradients * free[columns]).ravel()
    return csr_array((values, columns.ravel(), starts), shape=(count * size, len(free)))


def _soft(rows: LinearisedConstraints) -> bsr_array:
    count, size, _ = rows.soft.shape
    places = np.arange(count + 1)
    return bsr_array((rows.soft, places[:-1], places), shape=(count * size, count * size))


def _stiffness(blocks: FloatArray, rows: LinearisedConstraints, h: float, free: NDArray[np.bool_]) -> csr_array:
    """Return h² K of one kind from its stencils' blocks, without rows and columns of held vertices."""
    places = 3 * rows.vertices[:, :, None] + np.arange(3)
    corners = rows.vertices.shape[1]
    shape = (*rows.vertices.shape, 3, corners, 3)
    down = np.broadcast_to(places[:, :, :, None, None], shape)
    across = np.broadcast_to(places[:, None, None, :, :], shape)
    values = h * h * blocks.transpose(0, 1, 3, 2, 4) * free[down] * free[across]
    return coo_array((values.ravel(), (down.ravel(), across.ravel())), shape=(len(free), len(free))).tocsr()


@njit(cache=True, error_model="numpy", parallel=True)
def _stress(x: FloatArray, data: Any) -> FloatArray:
    """Return what stress adds to the stiffness of each stencil [N/m], shape (N, S, S, 3, 3)."""
    count, corners = data.vertices.shape
    blocks = np.zeros((count, corners, corners, 3, 3))
    for i in prange(count):
        stiffness_one(i, x, data, 0.0, 1.0, blocks[i], stiffness_scratch(data))
    return blocks
