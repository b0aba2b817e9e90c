"""Convergence to rest within a stated error: the motion still to come, and the error of the step size."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from vto_pipeline.cloth.dynamics.stepper import Stepper
from vto_pipeline.cloth.model.build import ClothState
from vto_pipeline.cloth.rest.foresight import VAGUE, Foresight, rms
from vto_pipeline.cloth.rest.stable_newton import LOOK, StableNewtonSteps
from vto_pipeline.errors import FallenError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.cloth import TraceRow

_QUIET = 3  # looks in a row under the bound: an oscillating cloth stands still for an instant at each turn
_COARSE = 2.0  # times the bound: waiting longer for a coarse answer, itself in error by more, is waste
_STILL, _LONG = 1e-4, 10  # m, looks in a row: what stays within that is waited for no longer, in balance or not
_ROUGH, _HARDLY = 1.0, 0.2  # weights, on the way; with so little of the bound to come, more may be left over
_STANDS = 1e-6  # m a look: not even what is about to buckle gets anywhere
_FOLDS, _THERE = 16.0, 0.1  # times e, from rounding to this share of the bound, grows what leaves an unstable place
_NEAR = 1e-3  # m a look: slow enough to ask whether it is
_JAMMED = 100.0  # weights left over: cloth on its way to rest has forces of the order of its weight
_JAM_LOOKS, _JAM_FALL = 5, 0.8  # looks, and the share that their least residual has to fall below
_WHOLE = 0.999  # of a look's time: more than rounding takes off
_SLOWEST = 0.95  # a decay slower than this cannot be told from none


@dataclass(frozen=True)
class SettleLimits:
    """Limits of settling.

    Args:
        error: Predicted distance to the state of rest, rms over vertices [m].
        residual: And residual force, as a share of weight, by methods whose state of rest is exact.
        seconds: Cloth time at most [s]; in longer steps than usual, as if they were of that length.
        finest: Steps per 1/60 s that are not refined further.
        deadline: `time.perf_counter` at which to stop; without effect on the result unless it is reached.
    """

    error: float
    residual: float
    seconds: float
    finest: int
    deadline: float = np.inf


@dataclass
class SettlingResult:
    """The result of settling.

    Args:
        state: At the end.
        settled: Whether both bounds were reached: cloth that stands still out of balance is not at rest.
        error: Predicted distance to the state of rest, rms over vertices [m]; infinite while unknown, as where jammed.
        residual: Residual force as a share of weight.
        trace: One row for each look.
        looks: Where some of its vertices were at each [m], shape (S, 3).
        jammed: Whether it was stopped since contacts hold forces far above its weight, and they do not fall.
        caught: Whether it was stopped since it passes through a body that has stretched it beyond what cloth bears.
    """

    state: ClothState
    settled: bool = False
    error: float = np.inf
    residual: float = np.inf
    trace: list[TraceRow] = field(default_factory=list)
    looks: list[FloatArray] = field(default_factory=list)
    jammed: bool = False
    caught: bool = False

    @property
    def error_mm(self) -> float | None:
        """The predicted distance in mm, None while unknown."""
        return 1e3 * self.error if np.isfinite(self.error) else None

    @property
    def not_settled_warning(self) -> str:
        """The warning where it did not settle."""
        if self.error_mm is None:
            return f"not at rest, error unknown{self._jam}"
        left = f"a residual force of {self.residual:.2g} of the weight"
        return f"not at rest: {self.error_mm:.1f} mm of motion predicted, {left}{self._jam}"

    @property
    def _jam(self) -> str:
        if self.caught:
            return "; cloth passes through the body, caught and stretched, and waiting will not free it"
        return "; cloth is jammed between contacts, and waiting will not free it" if self.jammed else ""


def relax_to_rest(
    stepper: Stepper,
    state: ClothState,
    limits: SettleLimits,
    watch: Callable[[float, float], None] = lambda done, error: None,
    is_caught: Callable[[FloatArray], bool] = lambda positions: False,
    fallen: Callable[[FloatArray], str] = lambda positions: "",
    some: Callable[[FloatArray], FloatArray] = lambda positions: positions[:0],
) -> SettlingResult:
    """Run until rest; where that depends on the steps, halve them until halving changes no more than the bound.

    The moves d of successive windows shrink by q, so d q / (1 - q) is still to come. Half the way of two windows is
    taken for d: what goes to and fro, as a vertex between two flanks, gets nowhere. A method that solves each step
    only in part, as one sweep of Gauss-Seidel does, leaves an error of order h² in the state of rest, so halving h
    shows three quarters of it (Richardson) and a third of that is left.

    A method that can be accelerated is: only the end matters, not the way.

    Cloth that buckles slowly hardly moves for a long while, so being quiet does not prove much. A method that knows the
    exact stiffness is asked by it what is stable and how far it has to go (`cloth.rest.foresight`); where that is near
    enough and forces are in balance, it is at rest. Else it goes on in steps that grow as long as the system is
    positive definite (`cloth.rest.stable_newton`): one of these goes all the way that was to come, and where it goes
    nowhere, the cloth is at rest, and stable. Where contacts change within such a step there may be none. But shorter
    ones with the exact stiffness hold nothing back: were the place unstable where a step of h was not definite, it
    would be left by a factor of e in each h.

    Args:
        stepper: The cloth among its colliders; its steps are changed, and as they were at the end if the rest does not
            depend on them. Its deadline is none at the end.
        state: Where to begin.
        limits: When to stop.
        watch: Receives the share of time used and the error [m] at each look.
        is_caught: Whether there is no way on from positions [m], shape (V, 3); asked once the first pull is over.
        fallen: Tells what of it is where nothing can hold it, at positions [m], shape (V, 3); nothing if none is.
        some: Returns those of the positions [m], shape (V, 3), that are to be kept of each look, shape (S, 3).

    Raises:
        FallenError: it has fallen off what it lay on, or a piece of it has.
    """
    began = time.perf_counter()
    result = SettlingResult(state)
    moves: list[float] = []
    drifts: list[float] = []
    earlier = state.positions
    coarse: FloatArray | None = None
    quiet, still, slow, stuck, stood, stood_at = 0, 0, 0, False, 0.0, state.positions
    stepper.prepare(state.positions)
    stepper.deadline = limits.deadline
    stepper.accelerate(True)
    exact, newton_steps = stepper.has_exact_rest, StableNewtonSteps(stepper, limits.residual)
    foresight = Foresight(stepper) if stepper.can_use_exact_stiffness and limits.error < VAGUE else None
    looks, taken, share = 0, 0, 0.0
    while share < 1.0 and not stepper.out_of_time:
        before, known = result.state.positions, stepper.contact_memory
        span = newton_steps.span
        after = stepper.run(result.state, span)
        residual = stepper.residual(after)
        looks += 1
        taken += after.time > result.state.time  # what is not taken costs next to nothing
        share = taken * LOOK / limits.seconds
        cut_short = after.time < result.state.time + _WHOLE * span
        moved, brief = rms(after.positions - before), span < LOOK or cut_short
        if newton_steps.diverged(residual, moved):
            stepper.contact_memory = known
            continue
        result.state, result.residual = after, residual
        if lost := fallen(after.positions):
            raise FallenError(
                f"{lost} has fallen off the body: nothing holds it",
                hint="does it go around the body, right way up, and is it tight enough above the legs to be held? "
                "Is each piece joined to what holds it?",
            )
        if rms(after.positions - stood_at) > _THERE * limits.error:
            stood, stood_at = 0.0, after.positions
            newton_steps.indefinite_step = np.inf
        elif stepper.was_positive_definite:
            stood += span
        balanced = result.residual < limits.residual or not exact
        if not brief:  # a shorter time tells nothing about rest
            moves.append(moved)
            drifts.append(0.5 * rms(after.positions - earlier) if len(moves) > 1 else moved)
            earlier = before
            whole = newton_steps.took_full_step and len(moves) > 1
            stable = whole or stood >= _FOLDS * newton_steps.indefinite_step
            to_come = max(moves[-2:]) if whole else max(moved, _still_to_come(drifts, limits.error >= VAGUE))
            result.error = max(to_come, VAGUE) if stepper.can_use_exact_stiffness and not stable else to_come
            if foresight is not None and not stable:
                result.error = foresight.error(after, to_come, ends=balanced and to_come <= limits.error)
            proven = stable or foresight is None or (balanced and result.error <= limits.error)
            if not exact:
                result.error += np.inf if coarse is None else rms(after.positions - coarse) / 3.0
        seconds = time.perf_counter() - began
        row = TraceRow(seconds, stepper.steps, 1e3 * result.error, result.residual, contacts=stepper.pushing_contacts)
        result.trace.append(row)
        result.looks.append(some(after.positions))
        watch(share, result.error)
        result.caught = looks >= _JAM_LOOKS and is_caught(after.positions)
        result.jammed = exact and _is_jammed([one.residual for one in result.trace])
        if result.caught or result.jammed:  # moves that do not come from forces that fall tell of no end
            result.error = np.inf
            result.trace[-1] = replace(row, error_mm=np.inf)
            break
        if brief:
            newton_steps.choose(False, stuck, residual, moved)
            continue
        first = coarse is None and not exact
        bound = _COARSE * limits.error if first else (1.0 if exact else 0.5) * limits.error
        still = still + 1 if to_come < _STILL else 0
        slow = slow + 1 if moved < _STILL else 0
        hardly = limits.error > VAGUE and limits.residual >= _ROUGH and to_come < _HARDLY * limits.error
        over = balanced or still >= _LONG or hardly
        stuck = slow >= (2 * _LONG if balanced else _LONG) or (balanced and moved <= _STANDS)
        quiet = quiet + 1 if to_come < bound and over and (proven or not stepper.was_positive_definite) else 0
        if stepper.can_use_exact_stiffness and limits.error < VAGUE:
            newton_steps.choose(over and moved < _NEAR, stuck, residual, moved)
        if quiet < (1 if exact and residual < limits.residual else _QUIET):  # at a turn of its way forces are large
            continue
        if result.error <= limits.error and proven:
            result.settled = balanced
            break
        if exact:
            continue
        if 2 * stepper.substeps > limits.finest:
            break
        coarse, moves, drifts, quiet = result.state.positions, [], [], 0
        stepper.substeps *= 2
    if exact:
        newton_steps.end()
    stepper.accelerate(False)
    stepper.deadline = np.inf
    return result


def _is_jammed(residuals: list[float]) -> bool:
    """Return whether forces far above the cloth's weight have ceased to fall."""
    if len(residuals) < 2 * _JAM_LOOKS:
        return False
    before, last = min(residuals[-2 * _JAM_LOOKS : -_JAM_LOOKS]), min(residuals[-_JAM_LOOKS:])
    return last > max(_JAMMED, _JAM_FALL * before)


def _still_to_come(drifts: list[float], roughly: bool) -> float:
    """Return the sum of the moves to come if these go on to shrink as the last four did, or roughly three [m]."""
    if len(drifts) >= 4:
        last, before, looks = max(drifts[-2:]), max(drifts[-4:-2]), 2
    elif roughly and len(drifts) == 3:
        last, before, looks = drifts[-1], drifts[-2], 1
    else:
        return np.inf
    shrink = min((last / before) ** (1.0 / looks), _SLOWEST) if before > 0.0 else 0.0
    return float(last * max(shrink / (1.0 - shrink), 1.0))
