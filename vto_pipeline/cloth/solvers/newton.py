"""Backward Euler in large steps, solved by Newton with multigrid: the method for stiff and for fine cloth.

Each step minimises ½ |y - x̃|²_M / h² + E(y) over the positions y, x̃ being where the cloth would go without forces
(Martin et al. 2011, eq. 3). One Newton iteration from the begin of the step is the scheme of Baraff & Witkin 1998. It
is enough while the objective falls as a parabola does; where cloth turns, or is thrown about, more are made. The
stiffness is positive semidefinite (`cloth.stiffness`), the systems are solved by conjugate gradients with multigrid,
and contacts are part of them.
"""

from __future__ import annotations

from math import exp
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.cloth.build import ClothModel, ClothState
from vto_pipeline.cloth.collision.contacts import Contacts
from vto_pipeline.cloth.collision.planes import (
    Planes,
    add_planes,
    keep_to_planes,
    place_planes,
    planes,
    planes_energy,
    revise_planes,
)
from vto_pipeline.cloth.collision.respond import respond
from vto_pipeline.cloth.constraints.rigid import refuse_rigid
from vto_pipeline.cloth.constraints.sweep import PARALLEL_FROM, add_damping_forces, add_forces
from vto_pipeline.cloth.losses import own, recall, remember, slip
from vto_pipeline.cloth.stiffness import Stiffness
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.block_matrix import BlockMatrix, row_times
from vto_pipeline.numerics.linear import pcg
from vto_pipeline.numerics.multigrid import hierarchy, update

_LEFT = 6.0  # 1/s: share of the forces at the begin of a step left by a linear solve, times h, so errors fall with h
_OF_WEIGHT = 0.3  # share of the weight that counts as force where cloth is in balance
_CYCLES = 30  # at most, of a linear solve
_MORE_CYCLES = 200  # where that was not enough to go down
_ENOUGH = 3  # Newton iterations of a step that comes down by full moves
_HARDEST = 20  # Newton iterations at most, of a step that will not come down
_BENT = 0.06  # 1/s: share of the motion's energy that curvature left out by an iteration may cost in a second
_SLIGHT = 10.0  # times what is allowed: a fall that is not worth a second way down
_SHORTEST = 1e-10  # share of a Newton step: from a point, cloth begins to grow by a millionth of its edges
_ROUNDING = 1e-9  # relative change of the objective that is no change
_CONTACT_ROUNDS = 3  # revisions of the set of pushing planes, a step
_CHANGED = 0.02  # of the touching planes, under which their set is good enough
_CROSSED = 0.01  # of an edge: how far a plane may be crossed without solving again


class _Iteration(NamedTuple):
    """What a Newton iteration came to.

    Args:
        y: Positions after it [m], shape (V, 3).
        share: Of the move that was taken.
        fall: Of the objective [J].
        foreseen: Its fall were it a parabola [J].
        left: The objective after it [J].
    """

    y: FloatArray
    share: float
    fall: float
    foreseen: float
    left: float


class Newton:
    """The solver with its working memory.

    Args:
        model: The cloth.
        sweeps: Newton iterations a step, more where a step does not come down.
        damping: Rate at which velocities fade [1/s].
        max_speed: No vertex moves faster [m/s].
    """

    def __init__(self, model: ClothModel, *, sweeps: int = 1, damping: float = 0.0, max_speed: float = np.inf) -> None:
        self._model = model = own(model)
        self._sweeps = sweeps
        self._damping = damping
        self._max_speed = max_speed
        self._checked = False
        self._held = model.inverse_mass == 0.0
        self._stiffness = Stiffness(model)
        self._levels = hierarchy(self._stiffness.matrix, self._held)
        self._stiffness.write_to(self._levels.matrix.blocks[: self._levels.slots[1]])
        self._planes: Planes = planes(0, len(model.mass))
        self._pieces, self._shift = _loose_pieces(self._stiffness.matrix, model.mass, self._held)
        self._allowed = 0.0  # what a step may cost in energy by being solved in part [J]
        self._whole = np.zeros((len(model.mass), 3))  # what the residuals of a step are measured against [N]

    def advance(self, state: ClothState, contacts: Contacts, h: float, substeps: int) -> ClothState:
        """Return the state after `substeps` steps of h [s]. The contacts hold for their whole span.

        Raises:
            ConfigError: a constraint is rigid.
        """
        if not self._checked:
            refuse_rigid(self._model.constraints, state.positions, "newton")
            self._checked = True
        if len(self._planes.friction) != len(contacts.friction):
            self._planes = planes(len(contacts.friction), len(self._held))
        recall(self._model, state.sliders)
        x, v = state.positions.copy(), state.velocities.copy()
        for step in range(substeps):
            self._step(x, v, contacts, step / substeps, (step + 1) / substeps, h)
        return ClothState(x, v, state.time + substeps * h, remember(self._model))

    def _step(self, x: FloatArray, v: FloatArray, contacts: Contacts, t0: float, t1: float, h: float) -> None:
        model, held = self._model, self._held
        move = (h * exp(-self._damping * h)) * v
        move[held] = 0.0
        target = x + move + (~held)[:, None] * (h * h * model.gravity)
        place_planes(self._planes, contacts, t0, t1, model.inverse_mass, x, target - x)
        self._allowed = _BENT * h * self._inertia(x, target, h)
        first = self._iterate(x, x, target, move, h)
        self._allowed = max(self._allowed, _BENT * h * first.fall)
        if first.share == 1.0 or first.foreseen < _SLIGHT * self._allowed:
            done = self._descend(x, target, h, first)
        else:  # the way there is curved: begin at its other end, and take the lower of the two
            done = self._descend(x, target, h, self._iterate(x, target, target, np.zeros_like(x), h))
            if done.share < 1.0 or done.left > first.left:
                done = min(done, self._descend(x, target, h, first), key=lambda one: one.left)
        start, x[:] = x.copy(), done.y
        longest = self._max_speed * h
        respond(x, v, start, model.inverse_mass, contacts, t0, t1, h, longest, True, len(x) >= PARALLEL_FROM)
        slip(x, model.constraints)

    def _descend(self, x: FloatArray, target: FloatArray, h: float, done: _Iteration) -> _Iteration:
        """Iterate on until the objective is a parabola, to within what is allowed, or will not fall."""
        zero = np.zeros_like(x)
        for iteration in range(1, max(_HARDEST, self._sweeps)):
            straight = abs(done.fall - done.foreseen) <= self._allowed + _ROUNDING * abs(done.left)
            if done.share == 1.0 and iteration >= self._sweeps and (straight or iteration >= _ENOUGH):
                break
            after = self._iterate(x, done.y, target, zero, h)
            if after.share == 0.0:
                after = self._iterate(x, done.y, target, zero, h, _MORE_CYCLES)
            if after.share == 0.0:
                break
            done = after
        return done

    def _iterate(
        self,
        x: FloatArray,
        y: FloatArray,
        target: FloatArray,
        guess: FloatArray,
        h: float,
        cycles: int = _CYCLES,
    ) -> _Iteration:
        """Take a Newton iteration from y, of a step of time from x.

        Args:
            x, y: Positions at the begin of the step and now [m], shape (V, 3).
            target: Where vertices would go without forces [m], shape (V, 3).
            guess: Of the move from y [m], shape (V, 3).
            h: Step [s].
            cycles: Iterations of the linear solver at most.
        """
        model, levels, planes = self._model, self._levels, self._planes
        matrix = self._stiffness.assemble(y, 1.0 / (h * h), 1.0, 1.0 / h)
        forces = (model.mass / (h * h))[:, None] * (target - y)
        energy = add_forces(y, model.constraints, forces)
        if y is not x:
            add_damping_forces(y, (y - x) / h, model.constraints, forces)
        forces[self._held] = 0.0
        if y is x:
            weight = np.linalg.norm(model.gravity) * np.where(self._held, 0.0, model.mass)
            pull = forces - (model.mass / (h * h))[:, None] * guess  # in the cloth's own frame: speed is no force
            self._whole = np.hypot(pull, _OF_WEIGHT * weight[:, None])
            guess = _better(matrix, forces, guess, guess + (~self._held)[:, None] * (h * h * model.gravity))
        elif self._sweeps > 1:  # who asks for more wants to get to the end
            self._whole = forces
        touches = bool(planes.there.any())
        bare = matrix.blocks[matrix.diagonal] if touches else None
        move, right, pushes = guess.copy(), forces, (0.0, 0.0, 0.0)
        for _ in range(_CONTACT_ROUNDS):
            if touches:
                matrix.blocks[matrix.diagonal] = bare
                right = forces.copy()
                add_planes(planes, model.mass, h, x, y, matrix, right)
                keep_to_planes(planes, x, y, move)
            update(levels)
            pcg(levels, right, move, self._whole, _LEFT * h, cycles, True)
            if not touches:
                self._keep_momentum(move, target - y)
                break
            pushes = tuple(planes_energy(planes, x, y + share * move) for share in (0.0, 0.5, 1.0))
            if revise_planes(planes, x, y + move, _CROSSED * model.edge_length) < _CHANGED:
                break
        foreseen = -_quadratic(matrix, right, move)
        return self._shortened(y, target, move, h, energy, pushes, foreseen)

    def _keep_momentum(self, move: FloatArray, wanted: FloatArray) -> None:
        """Shift each piece that nothing holds so that its mean move is the wanted one, whatever the solution left."""
        if self._pieces is None:
            return
        mass = self._model.mass
        for k in range(3):
            missing = np.bincount(self._pieces, mass * (wanted[:, k] - move[:, k]))
            move[:, k] += (self._shift * missing)[self._pieces]

    def _shortened(
        self,
        y: FloatArray,
        target: FloatArray,
        move: FloatArray,
        h: float,
        energy: float,
        pushes: tuple[float, ...],
        foreseen: float,
    ) -> _Iteration:
        """Return y + share move with the first share of 1, ½, ¼ ... that does not raise the objective.

        Args:
            y, target, move: [m], shape (V, 3).
            h: Step [s].
            energy: Elastic, at y [J].
            pushes: Energy of the planes after a share of 0, ½ and 1 of the move: a parabola [J].
            foreseen: By how much the objective would fall were it a parabola [J].
        """
        now = energy + self._inertia(y, target, h) + pushes[0]
        bend = 2.0 * (pushes[0] - 2.0 * pushes[1] + pushes[2])
        slope = pushes[2] - pushes[0] - bend
        share = 1.0
        while share > _SHORTEST:
            there = y + share * move
            energy = add_forces(there, self._model.constraints, np.zeros_like(there))
            pushed = pushes[0] + share * (slope + share * bend)
            fall = now - energy - self._inertia(there, target, h) - pushed
            if fall >= -self._allowed - _ROUNDING * now:
                return _Iteration(there, share, fall, foreseen, now - fall)
            share *= 0.5
        return _Iteration(y, 0.0, 0.0, foreseen, now)

    def _inertia(self, y: FloatArray, target: FloatArray, h: float) -> float:
        off = y - target
        return float(0.5 / (h * h) * np.einsum("i,ij,ij->", self._model.mass, off, off))


def _loose_pieces(
    matrix: BlockMatrix, mass: FloatArray, held: NDArray[np.bool_]
) -> tuple[NDArray[np.int32] | None, FloatArray]:
    """Return the piece of each vertex, shape (V,), None if all are held somewhere; and one over each piece's mass
    [1/kg], shape (P,), zero for pieces that are held."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    count = len(mass)
    ones = np.ones(len(matrix.columns), np.int8)
    pieces = connected_components(csr_array((ones, matrix.columns, matrix.starts), shape=(count, count)))[1]
    whole, pinned = np.bincount(pieces, mass), np.bincount(pieces, held)
    shift = np.divide(1.0, whole, out=np.zeros_like(whole), where=(pinned == 0) & (whole > 0.0))
    return (pieces if shift.any() else None), shift


def _better(matrix: BlockMatrix, right: FloatArray, one: FloatArray, other: FloatArray) -> FloatArray:
    """Return that of two guesses at A d = right, shape (V, 3), with the smaller ½ dᵀ A d - dᵀ right."""
    return one if _quadratic(matrix, right, one) <= _quadratic(matrix, right, other) else other


@njit(cache=True, error_model="numpy")
def _quadratic(matrix, right, d):
    """Return ½ dᵀ A d - dᵀ right."""
    total = 0.0
    for i in range(len(d)):
        a, b, c = row_times(matrix, i, d)
        total += d[i, 0] * (0.5 * a - right[i, 0])
        total += d[i, 1] * (0.5 * b - right[i, 1])
        total += d[i, 2] * (0.5 * c - right[i, 2])
    return total
