"""A cloth as a system of ordinary differential equations, M dv/dt = f(x) + r(x, v): what integrators work on."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from vto_pipeline.cloth.collision.response.penalty import Penalty
from vto_pipeline.cloth.constraints.sweep import add_damping_forces, add_forces
from vto_pipeline.cloth.implicit_step.stiffness import Stiffness
from vto_pipeline.cloth.integrators.air import add_drag, add_drag_rate
from vto_pipeline.cloth.model.build import ClothModel
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.linear.block_matrix import BlockMatrix, multiply
from vto_pipeline.numerics.linear.conjugate_gradients import pcg
from vto_pipeline.numerics.linear.multigrid import Hierarchy, hierarchy, update_hierarchy


class ForceSystem:
    """Forces with a potential, f = -∇U (elastic and gravity), and resistance r = -∇D in v (Rayleigh and air).

    Args:
        model: The cloth. Its constraints' β is Rayleigh's stiffness term.
        damping: Rayleigh's mass term α [1/s].
        air: ½ρc, pressure on a triangle over the square of its speed against its normal [kg/m³].

    Attributes:
        mass: [kg], shape (V, 1).
        free: 1 for vertices that move and 0 for held ones, shape (V, 1).
        inverse_mass: [1/kg], zero for held vertices, shape (V, 1).
        weight: [N], shape (V, 3).
        damping: α [1/s].
        air: ½ρc [kg/m³]; may be set between runs.
        penalty: Contacts as forces, if they are; may be set between runs.
    """

    def __init__(self, model: ClothModel, damping: float = 0.0, air: float = 0.0) -> None:
        self.mass = model.mass[:, None]
        self.inverse_mass = model.inverse_mass[:, None]
        self.free = (self.inverse_mass > 0.0).astype(np.float64)
        self.weight = self.mass * model.gravity
        self.damping = damping
        self.air = air
        self.penalty: Penalty | None = None
        self._model = model
        self._viscous = any(data.damping > 0.0 for data in model.constraints)

    def potential(self, x: FloatArray) -> tuple[float, FloatArray]:
        """Return U [J] and f = -∇U [N], shape (V, 3), at positions x [m], shape (V, 3)."""
        forces = self.weight.copy()
        energy = add_forces(x, self._model.constraints, forces)
        if self.penalty is not None:
            energy += self.penalty.add_forces(x, forces)
        return energy - float(np.vdot(self.weight, x)), forces

    def resistance(self, x: FloatArray, v: FloatArray) -> tuple[float, FloatArray]:
        """Return D [W] and r = -∇D [N] at velocities v [m/s]: -α M v - β K v - drag.

        K is the material stiffness ∇Cᵀ α⁻¹ ∇C; D is convex in v.
        """
        forces = -self.damping * self.mass * v
        if self._viscous:
            add_damping_forces(x, v, self._model.constraints, forces)
        power = -0.5 * float(np.vdot(v, forces))
        if self.penalty is not None:
            power += self.penalty.add_resistance(x, v, forces)
        drag = self._drag(x, v)
        return power - float(np.vdot(v, drag)) / 3.0, forces + drag

    def acceleration(self, x: FloatArray, v: FloatArray) -> FloatArray:
        """Return M⁻¹ (f + r) [m/s²], shape (V, 3); zero for held vertices."""
        _, forces = self.potential(x)
        if self.resists:
            forces += self.resistance(x, v)[1]
        return self.inverse_mass * forces

    def matrix(self, x: FloatArray, v: FloatArray, mass_factor: float, rate: float) -> BlockMatrix:
        """Return m M + K(x) + rate · ∂(-r)/∂v, positive definite; rows of held vertices are those of the identity.

        Args:
            x: Positions [m], shape (V, 3).
            v: Velocities [m/s], shape (V, 3).
            mass_factor: m [1/s²].
            rate: How fast v changes with x [1/s].
        """
        stiffness, _ = self._assembly
        matrix = stiffness.assemble(x, mass_factor + rate * self.damping, 1.0, rate)
        if self.air > 0.0 and rate > 0.0:
            places = np.where(self._model.inverse_mass > 0.0, matrix.diagonal, np.int32(-1))
            add_drag_rate(x, v, self._model.faces, self.air, rate, matrix.blocks, places)
        if self.penalty is not None:
            self.penalty.add_to(matrix, x, rate)
        return matrix

    def solve(self, right: FloatArray, tolerance: float) -> FloatArray:
        """Return the solution of A d = right, shape (V, 3), for the matrix A that was made last.

        Args:
            right: Shape (V, 3).
            tolerance: Share of the residual that may be left; see `numerics.linear.conjugate_gradients`.
        """
        stiffness, levels = self._assembly
        update_hierarchy(levels)
        found, reached = np.zeros_like(right), np.empty_like(right)
        pcg(levels, right, found, right, tolerance, 10 * len(right) + 100, len(levels.rows) > 2)
        multiply(stiffness.matrix, found, reached)
        return found + self.shift(right - reached)

    def shift(self, residual: FloatArray) -> FloatArray:
        """Return the translation [m], shape (3,), that solves A d = residual [N] as far as the whole cloth goes.

        With it linear momentum is conserved to rounding, whatever the tolerance of the rest. None where vertices are
        held.
        """
        if not self.free.all():
            return np.zeros(3)
        stiffness, _ = self._assembly
        return np.linalg.solve(stiffness.matrix.blocks.sum(axis=0), residual.sum(axis=0))

    def _drag(self, x: FloatArray, v: FloatArray) -> FloatArray:
        forces = np.zeros_like(x)
        if self.air > 0.0:
            add_drag(x, v, self._model.faces, self.air, forces)
        return forces

    @cached_property
    def _assembly(self) -> tuple[Stiffness, Hierarchy]:
        """What explicit methods never need."""
        stiffness = Stiffness(self._model)
        levels = hierarchy(stiffness.matrix, self._model.inverse_mass == 0.0)
        stiffness.write_to(levels.matrix.blocks[: len(stiffness.matrix.blocks)])
        return stiffness, levels

    @property
    def resists(self) -> bool:
        """Whether anything depends on velocity."""
        return self.damping > 0.0 or self._viscous or self.air > 0.0 or self.penalty is not None
