"""Projective dynamics as a quasi-Newton method: one prefactored matrix, corrected by a history of steps."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.linalg import SuperLU, splu

from vto_pipeline.cloth.constraints.sweep import linearised
from vto_pipeline.cloth.implicit_step.iterated import ImplicitStep, Iterated
from vto_pipeline.cloth.implicit_step.line_search import Merit
from vto_pipeline.cloth.implicit_step.plane_multiplier import solve_plane_contacts
from vto_pipeline.cloth.model.build import ClothModel
from vto_pipeline.model.arrays import FloatArray

_HISTORY = 8
_TOUCHING = 1e-12  # of the largest height of a plane: nearer than that, x is on it


class Projective(Iterated):
    """L-BFGS on |x - x̃|²_M / 2 + h² E whose first matrix is that of projective dynamics.

    Bouaziz et al. 2014 solve with M + h² Σ w GᵀG, which does not change while the cloth moves; Liu, Bouaziz & Kavan
    2017 show that it is the first matrix of a quasi-Newton method for any energy, which with a history of steps reaches
    the minimum. Here it is M + h² L with L the trace of ∇Cᵀ α⁻¹ ∇C over the directions of space, taken where the cloth
    was first seen: no less than that stiffness however its threads turn, one V x V matrix for all three directions, and
    factored once for each step size. Planes hold by projection: directions leave out what presses into a plane, and a
    step is bent along it (Bertsekas 1982); friction comes last, from what they push.

    Args:
        model, sweeps, damping, max_speed: See `Iterated`.
    """

    takes_rigid = False

    def __init__(self, model: ClothModel, *, sweeps: int = 1, damping: float = 0.0, max_speed: float = np.inf) -> None:
        super().__init__(model, sweeps=sweeps, damping=damping, max_speed=max_speed)
        self._free = (model.inverse_mass > 0.0)[:, None]
        self._first: FloatArray | None = None
        self._h = 0.0

    def solve(self, step: ImplicitStep, x: FloatArray) -> None:
        """See `Iterated.solve`."""
        factors = self._prefactored(step)
        merit = Merit(self.model, step)
        normals, heights = step.planes()
        able = step.contacts.active & (self.model.inverse_mass > 0.0)
        nothing = np.zeros(heights.shape)
        touching = _TOUCHING * max(1.0, float(np.abs(heights).max(initial=0.0)))
        pairs: deque[tuple[FloatArray, FloatArray]] = deque(maxlen=_HISTORY)
        x[:] = _before_planes(x, normals, heights, able)
        gradient = merit.at(x)[1]
        for _ in range(self.sweeps):
            gaps = np.einsum("svk,vk->sv", normals, x) - heights
            pushed = np.einsum("svk,vk->sv", normals, gradient)
            holding = np.where(able & (gaps <= touching) & (pushed > 0.0), 1.0, 0.0)[:, :, None] * normals
            direction = -_along(_two_loops(_along(gradient, holding), pairs, factors), holding) * self._free
            if float(np.vdot(direction, gradient)) >= 0.0:
                pairs.clear()
                direction = -_along(factors.solve(_along(gradient, holding)), holding) * self._free
            move = _before_planes(x + direction, normals, heights, able) - x
            share = merit.share(x, move, nothing)
            if share == 0.0:
                if not pairs:
                    break
                pairs.clear()
                continue
            x += share * move
            new = merit.at(x)[1]
            if float(np.vdot(new - gradient, move)) > 0.0:
                pairs.append((share * move, new - gradient))
            gradient = new
        gaps = np.einsum("svk,vk->sv", normals, x) - heights
        pushes = np.where(able & (gaps <= touching), np.einsum("svk,vk->sv", normals, gradient), 0.0)
        pressed = np.maximum(pushes, 0.0)[:, :, None] * normals
        solve_plane_contacts(x, step.start, self.model.inverse_mass, step.contacts, step.t0, step.t1, pressed)

    def _prefactored(self, step: ImplicitStep) -> SuperLU:
        if self._first is None:
            self._first = step.start.copy()
        if step.h != self._h:
            self._factors = self._factored(self._first, step.h)
            self._h = step.h
        return self._factors

    def _factored(self, x: FloatArray, h: float) -> SuperLU:
        """Return the factors of M + h² L, with rows of the identity for held vertices."""
        model, free = self.model, self._free[:, 0]
        count = len(free)
        own = np.arange(count)
        rows, columns, values = [own], [own], [np.where(free, model.mass, 1.0)]
        for data in model.constraints:
            _, gradients, compliance = linearised(x, data)
            stiffness = np.linalg.inv(compliance) * (h * h + h * data.damping)
            blocks = np.einsum("nbsk,nbc,nctk->nst", gradients, stiffness, gradients)
            corners = data.vertices.shape[1]
            row = np.repeat(data.vertices, corners, axis=1).ravel()
            column = np.tile(data.vertices, (1, corners)).ravel()
            rows.append(row)
            columns.append(column)
            values.append(blocks.ravel() * (free[row] & free[column]))
        places = (np.concatenate(rows), np.concatenate(columns))
        matrix = coo_array((np.concatenate(values), places), shape=(count, count)).tocsc()
        return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})


def _two_loops(gradient: FloatArray, pairs: deque[tuple[FloatArray, FloatArray]], factors: SuperLU) -> FloatArray:
    """Return the quasi-Newton matrix's inverse times a gradient; Nocedal & Wright 2006, algorithm 7.4."""
    result, shares = gradient.copy(), []
    for moved, change in reversed(pairs):
        share = float(np.vdot(moved, result)) / float(np.vdot(moved, change))
        shares.append(share)
        result -= share * change
    result = factors.solve(result)
    for (moved, change), share in zip(pairs, reversed(shares), strict=True):
        result += (share - float(np.vdot(change, result)) / float(np.vdot(moved, change))) * moved
    return result


def _along(vectors: FloatArray, holding: FloatArray) -> FloatArray:
    """Return vectors, shape (V, 3), without their parts along the normals of planes that hold, shape (S, V, 3)."""
    for normals in holding:
        vectors = vectors - (vectors * normals).sum(axis=1)[:, None] * normals
    return vectors


def _before_planes(x: FloatArray, normals: FloatArray, heights: FloatArray, able: NDArray[np.bool_]) -> FloatArray:
    """Return x [m], shape (V, 3), projected onto the half-spaces one after the other."""
    for normal, height, has in zip(normals, heights, able, strict=True):
        lack = np.where(has, np.maximum(height - (normal * x).sum(axis=1), 0.0), 0.0)
        x = x + lack[:, None] * normal
    return x
