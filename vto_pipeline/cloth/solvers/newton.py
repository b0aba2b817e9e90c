"""Backward Euler in large steps by Newton's method with multigrid, for stiff and for fine cloth.

Each step minimises ½ |y - x̃|²_M / h² + E(y) over the positions y, x̃ being where the cloth would go without forces
(Martin et al. 2011, eq. 3). One Newton iteration from the start of the step is the scheme of Baraff & Witkin 1998. It
is enough while the objective falls as a parabola does; where cloth turns, or is thrown about, more are made. The
stiffness is positive semidefinite (`cloth.stiffness`), the systems are solved by `linear_system`, and contacts are part
of them. Near rest, where what is left out to keep it so is what cloth waits for, it may be exact.

On the way to rest each step takes a share off what is left: a small one of folds, for which that stiffness is far too
large, however long the step. So moves are carried on (Nesterov 1983): an iteration begins where the last one leads.
What would take 1/λ steps then takes 1/√λ.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from math import exp
from typing import NamedTuple

import numpy as np

from vto_pipeline.cloth.collision.contacts import Contacts
from vto_pipeline.cloth.collision.response.active_set import LYING, ActiveSet, active_set, add_pairs, no_contacts
from vto_pipeline.cloth.collision.response.contact_springs import (
    add_contacts,
    add_last_forces,
    contact_energy,
    displacement_by_planes,
    linked_contacts,
    project_to_contacts,
    update_active_set,
)
from vto_pipeline.cloth.collision.response.step_response import resolve_plane_contacts
from vto_pipeline.cloth.collision.self_collision.pairs import no_pairs
from vto_pipeline.cloth.collision.self_collision.self_contact import SelfContact
from vto_pipeline.cloth.constraints.bending.hinge_moments import by_hinges
from vto_pipeline.cloth.constraints.rigid import refuse_rigid
from vto_pipeline.cloth.constraints.sweep import PARALLEL_FROM, add_damping_forces, add_forces, has_lacking
from vto_pipeline.cloth.implicit_step.dissipation import dissipated
from vto_pipeline.cloth.implicit_step.lacking import complete, times_lacking
from vto_pipeline.cloth.implicit_step.linear_system import LinearSystem
from vto_pipeline.cloth.implicit_step.momentum import free_components, keep_momentum
from vto_pipeline.cloth.implicit_step.rest_ahead import RestAhead, rest_ahead
from vto_pipeline.cloth.implicit_step.stiffness import Stiffness
from vto_pipeline.cloth.model.build import ClothModel, ClothState
from vto_pipeline.cloth.model.internal_friction import copy_sliders, restore_sliders, slip, with_own_sliders
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.line_search import backtracking_shares
from vto_pipeline.numerics.linear.block_matrix import BlockMatrix

_LEFT = 6.0  # 1/s: share of the forces at the begin of a step left by a linear solve, times h, so errors fall with h
_OF_WEIGHT = 0.3  # share of the weight that counts as force where cloth is in balance
_ENOUGH = 3  # Newton iterations of a step that comes down by full moves
_BENT = 0.06  # 1/s: share of the motion's energy that curvature left out by an iteration may cost in a second
_SLIGHT = 10.0  # times what is allowed: a fall that is not worth a second way down
_SHORTEST = 1e-10  # share of a Newton step: from a point, cloth begins to grow by a millionth of its edges
_ROUNDING = 1e-9  # relative change of the objective that is no change
_CHANGED = 0.05  # of the contact forces: amiss by less, their set is good enough
_FEW = 4.0  # contacts' mean force, amiss: with more, what lies on a fine mesh breaks loose in the next step
_HARDLY = 0.4  # the same with the exact stiffness: a tight garment's contacts bear a hundred times its weight
_CARRIED = 0.92  # of the last move: from there on, shares λ of 0.002 and more come to rest as fast as can be
_CALM = 2  # solutions in a step that contacts were known in: what meets others at each step is not carried on
_ON_THE_WAY, _NEARLY = 5, 0.25  # rounds, and amiss, where only the end matters: the next step puts that right
_IN_CIRCLES = 8  # rounds: with the exact stiffness, contacts that take more push and let go in turn
_CROSSED = 0.01  # of an edge: how far a plane may be crossed without solving again


class Limits(NamedTuple):
    """What a step may take at most; it mostly takes less.

    Args:
        iterations: Of Newton, where a step will not come down.
        contact_rounds: Solutions with a revised set of contacts, an iteration.
        extensions: Times an iteration is solved again with what it would have passed through.
    """

    iterations: int = 20
    contact_rounds: int = 20
    extensions: int = 2


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

    Attributes:
        self_contact: What keeps the cloth from itself, if anything; may be set between runs.
        exact: Whether steps use the exact stiffness, and are only taken where their systems are positive definite with
            it and their contacts come to an end; may be set.
        definite: Whether all systems of the last step were and did, with the exact stiffness.
        active: The contacts of the last step, and the forces they bore.
        limits: Of a step; may be lowered where its time is short.
        accelerated: Whether the end matters, not the way there: then moves are carried on, where calm; may be set.
    """

    def __init__(self, model: ClothModel, *, sweeps: int = 1, damping: float = 0.0, max_speed: float = np.inf) -> None:
        model = with_own_sliders(model)
        self._model = model = replace(model, constraints=by_hinges(model.constraints))
        self._sweeps = sweeps
        self._damping = damping
        self._max_speed = max_speed
        self.self_contact: SelfContact | None = None
        self.limits = Limits()
        self.exact = self.definite = self.accelerated = False
        self._solved, self._calm = 0, 0.0  # solutions in this step; s: length of the last step, if it was calm
        self._firm = False  # whether this step's contacts push only where cloth came through, and then firmly
        self._checked = False
        self._held = model.inverse_mass == 0.0
        self._lacks = has_lacking(model.constraints)
        self._stiffness = Stiffness(model)
        self._system = LinearSystem(self._stiffness.matrix, self._held)
        self._stiffness.write_to(self._system.blocks)
        self.active: ActiveSet = no_contacts(0)
        self._components = free_components(model, self._stiffness.matrix)
        self._allowed = 0.0  # what a step may cost in energy by being solved in part [J]
        self._whole = np.zeros((len(model.mass), 3))  # what the residuals of a step are measured against [N]

    @property
    def can_use_exact_stiffness(self) -> bool:
        """Whether systems with the exact stiffness can be solved: of very large cloth they are not factored."""
        return self._system.eliminates

    def advance(self, state: ClothState, contacts: Contacts, h: float, substeps: int) -> ClothState:
        """Return the state after `substeps` steps of h [s]. The contacts hold for their whole span.

        Held vertices go on with the velocity they have. A step that would need the exact stiffness and has no system
        that is positive definite, or no end of its contacts, is not taken, nor are those after it.

        Raises:
            ConfigError: a constraint is rigid.
        """
        if not self._checked:
            refuse_rigid(self._model.constraints, state.positions, "newton")
            self._checked = True
        restore_sliders(self._model, state.sliders)
        x, v = state.positions.copy(), state.velocities.copy()
        for step in range(substeps):
            if self.self_contact is not None:
                self.self_contact.set_time_span(state.time + step * h, state.time + (step + 1) * h)
            if not self._step(x, v, contacts, step / substeps, (step + 1) / substeps, h):
                return ClothState(x, v, state.time + step * h, copy_sliders(self._model))
        return ClothState(x, v, state.time + substeps * h, copy_sliders(self._model))

    @property
    def pushing_contacts(self) -> int:
        """How many contacts pushed in the last step."""
        return int(self.active.pushing.sum())

    def rest_ahead(self, state: ClothState, active: ActiveSet, h: float) -> RestAhead | None:
        """Return where the cloth would come to rest within h [s], were these contacts to stay."""
        restore_sliders(self._model, state.sliders)
        return rest_ahead(self._model, self._stiffness, self._system, self._held, active, state.positions, h)

    def _step(self, x: FloatArray, v: FloatArray, contacts: Contacts, t0: float, t1: float, h: float) -> bool:
        """Take a step, in place; return whether it was taken, else all is as it was."""
        model, held = self._model, self._held
        start, known = x.copy(), self.active
        self.definite = self.exact
        move = (h * exp(-self._damping * h)) * v
        move[held] = 0.0
        led = held & (v != 0.0).any(axis=1)
        x[led] += h * v[led]
        target = x + move + (~held)[:, None] * (h * h * model.gravity)
        itself = self.self_contact
        pairs = no_pairs() if itself is None else itself.find_pairs(start, target, h, move)
        carries = self.accelerated and h == self._calm and not led.any()
        self._firm, self._calm, self._solved = self.exact or carries, 0.0, 0
        lying = 0.0 if self._firm else LYING
        self.active = active_set(contacts, pairs, t0, t1, model.inverse_mass, start, move, self.active, lying)
        if led.any():  # what they pull at their neighbours by being led is no measure
            forces = model.mass[:, None] * model.gravity
            add_forces(start, model.constraints, forces)
            self._whole = self._unbalanced(forces)
        self._allowed = _BENT * h * self._inertia(x, target, h)
        begin = x + _CARRIED * h * v if carries and not self.exact else x
        first = self._iterate(x, begin, target, x + move - begin, h, begins=True, measured=bool(led.any()))
        if first.share < 1.0 and begin is not x:
            first = self._iterate(x, x, target, move, h, begins=True)
        if not led.any():  # else it is mostly what the led vertices have pulled at their neighbours
            self._allowed = max(self._allowed, _BENT * h * first.fall)
        if first.share == 1.0 or first.foreseen < _SLIGHT * self._allowed or self.exact:
            done = self._descend(x, target, h, first)
        else:  # the way there is curved: begin at its other end, and take the lower of the two
            done = self._descend(x, target, h, self._iterate(x, target, target, np.zeros_like(x), h))
            if done.share < 1.0 or done.left > first.left:
                done = min(done, self._descend(x, target, h, first), key=lambda one: one.left)
        if self.exact and not self.definite:
            x[:], self.active = start, known
            return False
        self._calm = h if self._solved <= _CALM else 0.0
        x[:] = done.y
        longest, many = self._max_speed * h, len(x) >= PARALLEL_FROM
        resolve_plane_contacts(x, v, start, model.inverse_mass, contacts, t0, t1, h, longest, True, many)
        if itself is not None:
            x[:], _ = itself.collision_free(start, x, displacement_by_planes(self.active, start))
            v[:] = (x - start) / h
            self._keep_momentum(v, (target - start) / h)  # what was cut short has pushed something else
        slip(x, model.constraints)
        return True

    def _unbalanced(self, forces: FloatArray) -> FloatArray:
        """Return what residuals are measured against [N], shape (V, 3): the forces that set the cloth in motion.

        What contacts bear sets nothing in motion. But a share of the weight counts always.

        Args:
            forces: Elastic and gravity [N], shape (V, 3); changed.
        """
        model = self._model
        add_last_forces(self.active, forces)
        forces[self._held] = 0.0
        weight = np.linalg.norm(model.gravity) * np.where(self._held, 0.0, model.mass)
        return np.hypot(forces, _OF_WEIGHT * weight[:, None])

    def _descend(self, x: FloatArray, target: FloatArray, h: float, done: _Iteration) -> _Iteration:
        """Iterate on until the objective is a parabola, to within what is allowed, or will not fall."""
        zero = np.zeros_like(x)
        for iteration in range(1, max(self.limits.iterations, self._sweeps)):
            if self.exact and not self.definite:
                break
            straight = abs(done.fall - done.foreseen) <= self._allowed + _ROUNDING * abs(done.left)
            if done.share == 1.0 and iteration >= self._sweeps and (straight or iteration >= _ENOUGH):
                break
            after = self._iterate(x, done.y, target, zero, h)
            if after.share == 0.0:
                after = self._iterate(x, done.y, target, zero, h, exactly=True)
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
        *,
        exactly: bool = False,
        begins: bool = False,
        measured: bool = False,
    ) -> _Iteration:
        """Take a Newton iteration from y, of a step of time from x.

        Args:
            x, y: Positions at the start of the step and now [m], shape (V, 3).
            target: Where vertices would go without forces [m], shape (V, 3).
            guess: Of the move from y [m], shape (V, 3).
            h: Step [s].
            exactly: Whether its system is to be solved to rounding.
            begins: Whether it is the first of its step.
            measured: Whether it is known what residuals are measured against.
        """
        model, system = self._model, self._system
        matrix = self._assembled(y, h)
        system.uncouple()
        forces = (model.mass / (h * h))[:, None] * (target - y)
        energy = add_forces(y, model.constraints, forces)
        drag = np.zeros_like(y)
        if y is not x:
            add_damping_forces(y, (y - x) / h, model.constraints, drag)
        forces += drag
        forces[self._held] = 0.0
        if begins:
            if not measured:  # in the cloth's own frame: speed is no force
                self._whole = self._unbalanced(forces - (model.mass / (h * h))[:, None] * guess)
            fallen = guess + (~self._held)[:, None] * (h * h * model.gravity)
            guess = min(guess, fallen, key=lambda move: system.parabola(forces, move))
        elif self._sweeps > 1:  # who asks for more wants to get to the end
            self._whole = forces
        lacking = partial(times_lacking, model.constraints, self._held, y, h)
        bare = matrix.blocks[matrix.diagonal]
        move, pushes, changed, good = guess.copy(), (0.0, 0.0, 0.0), 0.0, _CHANGED
        _, rounds, extensions = self.limits
        on_the_way, few = self.accelerated and not self.definite, _HARDLY if self.definite else _FEW
        rounds = min(rounds, _IN_CIRCLES if self.definite else _ON_THE_WAY if on_the_way else rounds)
        while True:
            right = forces.copy()
            touches = len(self.active.key) > 0
            if touches:
                matrix.blocks[matrix.diagonal] = bare
                between = system.couple(*linked_contacts(self.active, self._held))
                add_contacts(self.active, model.mass, self._held, h, x, y, matrix, right, between, self._firm)
                project_to_contacts(self.active, model.inverse_mass, x, y, move)
            if self.definite:
                self.definite = system.eliminated(right, move)
                if self.definite and self._lacks:
                    self.definite = complete(move, right, system.substitute, lacking) is None
                if not self.definite:
                    return _Iteration(y, 0.0, 0.0, 0.0, np.inf)
            else:
                system.solve(right, move, self._whole, _LEFT * h, exactly=exactly or touches)
            rounds -= 1
            self._solved += 1
            self._keep_momentum(move, target - y)
            if touches:
                pushes = tuple(contact_energy(self.active, x, y + share * move) for share in (0.0, 0.5, 1.0))
                changed = update_active_set(self.active, x, y + move, _CROSSED * model.edge_length)
                good = _NEARLY if on_the_way else min(_CHANGED, few / max(self.pushing_contacts, 1))
            if changed >= good and rounds > 0:
                continue
            if changed >= good or extensions == 0 or not self._add_contacts_on_path(x, y + move):
                break
            extensions -= 1
            rounds = max(rounds, 1)
        if changed >= good:
            self._solved += _CALM  # no calm step: contacts are still not known
        if self.definite and changed >= good:
            self.definite = False
            return _Iteration(y, 0.0, 0.0, 0.0, np.inf)
        foreseen = -system.parabola(right, move)
        if self._lacks:
            foreseen -= 0.5 * float(np.vdot(move, lacking(move)))
        lost = dissipated(model.constraints, y, move, h, drag)
        parabola = tuple(push + loss for push, loss in zip(pushes, lost, strict=True))
        return self._shortened(y, target, move, h, energy, parabola, foreseen)

    def _assembled(self, y: FloatArray, h: float) -> BlockMatrix:
        """Return the matrix of a step of h [s] at positions y [m], without contacts."""
        if self.definite:
            return self._stiffness.assemble_exact(y, 1.0 / (h * h), 1.0 / h)
        return self._stiffness.assemble(y, 1.0 / (h * h), 1.0, 1.0 / h)

    def _add_contacts_on_path(self, x: FloatArray, end: FloatArray) -> bool:
        """Add what a move from x to end would pass through to the contacts; return whether there was any."""
        if self.self_contact is None:
            return False
        _, met = self.self_contact.collision_free(x, end)
        before = len(self.active.key)
        self.active = add_pairs(self.active, met, x, end - x)
        return len(self.active.key) > before

    def _keep_momentum(self, move: FloatArray, wanted: FloatArray) -> None:
        """Shift each piece that nothing holds so that its mean move is the wanted one, whatever the solution left.

        Pieces that push each other count as one.
        """
        if self._components is not None:
            keep_momentum(self._components, self.active, self._model.mass, move, wanted)

    def _shortened(
        self,
        y: FloatArray,
        target: FloatArray,
        move: FloatArray,
        h: float,
        energy: float,
        parabola: tuple[float, ...],
        foreseen: float,
    ) -> _Iteration:
        """Return y + share move with the first share of 1, ½, ¼ ... that does not raise the objective.

        Args:
            y, target, move: [m], shape (V, 3).
            h: Step [s].
            energy: Elastic, at y [J].
            parabola: What planes and dampers hold after a share of 0, ½ and 1 of the move [J].
            foreseen: By how much the objective would fall were it a parabola [J].
        """
        now = energy + self._inertia(y, target, h) + parabola[0]
        bend = 2.0 * (parabola[0] - 2.0 * parabola[1] + parabola[2])
        slope = parabola[2] - parabola[0] - bend
        for share in backtracking_shares(_SHORTEST):
            there = y + share * move
            energy = add_forces(there, self._model.constraints, np.zeros_like(there))
            held = parabola[0] + share * (slope + share * bend)
            fall = now - energy - self._inertia(there, target, h) - held
            if fall >= -self._allowed - _ROUNDING * now:
                return _Iteration(there, share, fall, foreseen, now - fall)
        return _Iteration(y, 0.0, 0.0, foreseen, now)

    def _inertia(self, y: FloatArray, target: FloatArray, h: float) -> float:
        off = y - target
        return float(0.5 / (h * h) * np.einsum("i,ij,ij->", self._model.mass, off, off))
