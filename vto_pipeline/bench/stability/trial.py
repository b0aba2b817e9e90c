"""One method on one case, guarded, so that any outcome becomes a verdict with its figures."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress

import numpy as np

from vto_pipeline.bench.bench import Measured, Value
from vto_pipeline.bench.stability.case import StabilityCase
from vto_pipeline.bench.timing import Timing
from vto_pipeline.cloth.collision.contacts import empty_contacts
from vto_pipeline.cloth.dynamics.methods import Method
from vto_pipeline.cloth.dynamics.residual import elastic_energy
from vto_pipeline.cloth.model.build import ClothState, at_rest
from vto_pipeline.errors import ComputationError, VtoError
from vto_pipeline.model.arrays import FloatArray

ENERGY = 0.05
"""How much mechanical energy may grow, as a share of what the cloth starts with and its weight times its size."""

VERDICTS = (
    "passes",
    "refused",  # input that no method may accept
    "limited",  # an explicit method holds up to the step that theory gives it, and breaks there
    "stretches",
    "overstressed",  # the energy of what is left stretched is out of bounds, but not the motion
    "does not move",  # though gravity pulls it
    "does not recover",
    "always grows",  # an explicit method without any stable step, as theory says
    "gains energy",
    "too slow",
    "diverges",
    "crashes",
    "breaks elsewhere",  # an explicit method breaks where theory says that it holds, or the reverse
    "accepted",  # input that must be refused
    "does not apply",
)
"""What can be said of a method and a case, from good to bad."""

RECOVERED = 0.01
"""At this distance from the rest shape, rms over vertices as a share of the size, a cloth has recovered."""

_LINGER = 30  # frames it must stay there before the run is cut short


Maker = Callable[..., Method]


def run_trial(case: StabilityCase, make: Maker, limit: float) -> Measured:
    """Run a method on a case.

    Args:
        case: The case.
        make: The method's class.
        limit: Wall time after which it is too slow [s].

    Returns:
        The timing, and: verdict, one of `VERDICTS`; finite; frames; energy_gain, the most by which mechanical energy
        exceeded its start, as a share (see `ENERGY`); motion_gain, the same without what is stored in the cloth;
        step_times_frequency, h ω_max at rest; strain_left; and where the rest shape is asked for, distance_mm,
        distance_share of the size, and recovery_frames, after which it stays within `RECOVERED`.
    """
    with undisturbed():
        run, compile_s = _Run(case), 0.0
        began = time.perf_counter()
        try:
            compile_s = _warmed(case, make)
            began = time.perf_counter()
            verdict = run.through(_made(case, make), began + limit)
        except ComputationError:
            verdict = "diverges"
        except VtoError as error:
            return Timing(0.0), {"verdict": "does not apply", "finite": None, "why": error.problem}
        except (ArithmeticError, RuntimeError, ValueError) as error:
            verdict = "crashes"
            run.why = f"{type(error).__name__}: {error}"[:200]
        return Timing(time.perf_counter() - began, compile_s=compile_s), run.findings(verdict)


class _Run:
    """A run as far as it came."""

    def __init__(self, case: StabilityCase) -> None:
        self.why = ""
        self._case = case
        self._state = at_rest(case.start)
        stored, moving = _energies(case, self._state)
        self._first = stored + moving
        weight = float((case.model.mass[:, None] * np.abs(case.model.gravity)).sum())
        self._scale = stored + weight * case.size
        self._gain = self._motion_gain = self._moved = 0.0
        self._distances: list[float] = []
        self._frames = 0

    def through(self, method: Method, deadline: float) -> str:
        """Go through all frames, and return the verdict."""
        case, contacts = self._case, empty_contacts(len(self._case.start))
        while self._frames < case.frames and not self._stays_recovered():
            state = method.advance(self._state, contacts, case.h, case.substeps)
            self._frames += 1
            stored, moving = _energies(case, state)
            if not (np.isfinite(stored + moving) and np.isfinite(state.positions).all()):
                self._gain = self._motion_gain = np.inf
                return "diverges"
            self._state = state
            self._moved = max(self._moved, float(np.linalg.norm(state.positions - case.start, axis=1).max()))
            self._gain = max(self._gain, self._share(stored + moving))
            self._motion_gain = max(self._motion_gain, self._share(moving))
            if case.recovers:
                self._distances.append(case.distance(state.positions) / case.size)
            if time.perf_counter() > deadline and self._frames < case.frames:
                return "too slow"
        return self._judged()

    def findings(self, verdict: str) -> Mapping[str, Value]:
        """Return what the table shows."""
        finite = verdict not in ("diverges", "crashes")
        found: dict[str, Value] = {
            "verdict": verdict,
            "finite": finite,
            "frames": self._frames,
            "energy_gain": self._gain,
            "motion_gain": self._motion_gain,
            "step_times_frequency": self._case.step_times_frequency,
        }
        if finite:
            found["strain_left"] = self._case.max_strain(self._state.positions)
        if self._case.recovers and self._distances:
            found["distance_share"] = self._distances[-1] if finite else np.inf
            found["distance_mm"] = 1e3 * self._case.size * self._distances[-1] if finite else np.inf
            found["recovery_frames"] = self._recovery() if finite else None
        if self.why:
            found["why"] = self.why
        return found

    def _share(self, energy: float) -> float:
        return (energy - self._first) / self._scale if self._scale > 0.0 else 0.0

    def _judged(self) -> str:
        if self._motion_gain > ENERGY:
            return "gains energy"
        if self._gain > ENERGY:
            return "overstressed"
        if self._moved < self._case.fall:
            return "does not move"
        if self._case.recovers and self._recovery() is None:
            return "does not recover"
        if self._case.max_strain(self._state.positions) > self._case.strain:
            return "stretches"
        return "passes"

    def _recovery(self) -> int | None:
        """Return the frame from which on it stays near its rest shape; None when it does not."""
        far = np.flatnonzero(np.array(self._distances) > RECOVERED)
        first = int(far[-1]) + 2 if len(far) else 1
        return first if first <= len(self._distances) else None

    def _stays_recovered(self) -> bool:
        return len(self._distances) >= _LINGER and max(self._distances[-_LINGER:]) <= RECOVERED


@contextmanager
def undisturbed() -> Iterator[None]:
    """Keep quiet about overflow and singular matrices: here they are findings, and end in a verdict."""
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def _warmed(case: StabilityCase, make: Maker) -> float:
    """Return how long the first step of an instance takes, which compiles what the run needs [s]."""
    began = time.perf_counter()
    with suppress(ComputationError, ArithmeticError, RuntimeError, ValueError):  # the run itself will show it
        _made(case, make).advance(at_rest(case.rest), empty_contacts(len(case.rest)), case.h, 1)
    return time.perf_counter() - began


def _made(case: StabilityCase, make: Maker) -> Method:
    return make(case.model, sweeps=case.sweeps, damping=case.damping, max_speed=np.inf)


def _energies(case: StabilityCase, state: ClothState) -> tuple[float, float]:
    """Return the elastic energy, and the kinetic and potential energy, the last from the start's height [J]."""
    kinetic = 0.5 * float(case.model.mass @ (state.velocities**2).sum(axis=1))
    fallen: FloatArray = (state.positions - case.start) @ case.model.gravity
    return elastic_energy(case.storing, state.positions), kinetic - float(case.model.mass @ fallen)
