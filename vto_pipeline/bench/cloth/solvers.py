"""Every method with different budgets on hanging, falling and worn cloth: error against run time.

What the error is taken against:

* Stretch against zero: cloth hardly stretches, and this is what figures of other programs are given in. A soft fabric
  stretches in truth; its curve ends in a plateau, and a stiffer one goes on.
* Distance and mean height against the reference: the default method in steps so small that halving them changes
  little. What is left is the reference's own row. A hanging sheet has one such shape, and so has a shirt that comes to
  rest; the sheet on the ball, undamped and without bending stiffness, buckles into other folds with any change of
  step, so there only the mean height is compared.
* Residual: the residual force as a share of weight; see `cloth.dynamics.residual`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from math import inf

import numpy as np

from vto_pipeline.bench.bench import Measured, Row, Value, Watch
from vto_pipeline.bench.cloth.iterations import iteration_rows
from vto_pipeline.bench.cloth.scenes import Scene, hang, measures, shirt, sphere
from vto_pipeline.bench.measures import distance_mm
from vto_pipeline.bench.report_card.fronts import Trade
from vto_pipeline.bench.timing import Timing, clocked, timed
from vto_pipeline.cloth.dynamics.methods import FRAME, METHODS, choose_method
from vto_pipeline.cloth.dynamics.step_length import run_at_own_pace
from vto_pipeline.cloth.dynamics.stepper import StepConfig, Stepper
from vto_pipeline.cloth.model.build import ClothState, at_rest
from vto_pipeline.cloth.model.settings import checked
from vto_pipeline.errors import ComputationError, VtoError

FOLDS = "sphere"
"""The scene whose shape depends on every rounding: no distance there."""

Ended = tuple[ClothState, float]
"""Last frame, and residual there."""


@dataclass(frozen=True)
class SolverCase:
    """A scene with the range of what is spent on it.

    Args:
        name: Of the scene; its stiffness is a setting.
        settings: What the scene is made with.
        make: Makes it.
        factors: Times a method's usual steps and iterations, ascending.
        patience: A run that takes longer is not repeated, and the method gets no larger budget [s].
        most: A run that would take longer is left out [s].
        reference: Substeps a frame of the reference.
    """

    name: str
    settings: dict[str, Value]
    make: Callable[[], Scene]
    factors: Sequence[float]
    patience: float
    most: float
    reference: int


_SPENT = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0), 20.0, 60.0, 64
_QUICKLY_SPENT = (0.25, 1.0), 0.2, 0.4, 16
_TRIED = 3  # single steps, of which the fastest tells how long a run would take


def rows(quick: bool, watch: Watch) -> Iterable[Row]:
    """Measure; see the module."""
    for case in _cases(quick):
        yield from _rows_of(case, watch)
    yield from iteration_rows(24 if quick else 64, 32 if quick else 512, 0.2 if quick else 10.0, watch)


def run_scene(scene: Scene, config: StepConfig) -> Ended:
    """Return the last frame of a scene, and the residual there.

    Raises:
        DivergedError: the cloth left every bound.
    """
    stepper = _stepper(scene, config)
    with np.errstate(all="ignore"):  # of a run that diverges
        state = run_at_own_pace(stepper, at_rest(scene.start), scene.seconds)
        return state, stepper.residual(state)


def timed_run(scene: Scene, config: StepConfig, *, budget: float, most: float = inf) -> tuple[Ended | None, Timing]:
    """Return what `run_scene` returns, and how long it takes: preparing the method counts, building the model does not.

    Args:
        scene: The scene.
        config: Method, steps, iterations.
        budget: A run that takes longer is not repeated [s].
        most: A run that would take longer, going by its second step, is not begun; None is returned, and the time
            that it would take [s].
    """
    stepper = _stepper(scene, config)
    with np.errstate(all="ignore"):
        began = time.perf_counter()
        stepper.prepare(scene.start)
        first = stepper.run(at_rest(scene.start), FRAME / stepper.substeps)
        stepper.residual(first)
        compile_s = time.perf_counter() - began
        step = min(clocked(stepper.run, first, FRAME / stepper.substeps)[1] for _ in range(_TRIED))
    expected = step * stepper.substeps * scene.seconds / FRAME
    if expected > most:
        return None, Timing(expected, 0, compile_s)
    ended, timing = timed(lambda: run_scene(scene, config), budget=budget)
    return ended, replace(timing, compile_s=compile_s)


def _stepper(scene: Scene, config: StepConfig) -> Stepper:
    skin = np.full(len(scene.start), scene.skin)
    return Stepper(scene.model, scene.colliders, skin, config, damping=scene.damping)


def _cases(quick: bool) -> Iterator[SolverCase]:
    if quick:
        yield SolverCase("hang 10", {"stiffness": 1e4}, lambda: hang(10), *_QUICKLY_SPENT)
        yield SolverCase("sphere 10", {"stiffness": 1e4}, lambda: sphere(10), *_QUICKLY_SPENT)
        yield SolverCase("shirt 50 mm", {}, lambda: shirt(50.0, seconds=0.4), *_QUICKLY_SPENT)
        return
    for count in (32, 64, 128):
        for stiffness in (1e4, 1e5):
            yield SolverCase(f"hang {count}", {"stiffness": stiffness}, partial(hang, count, stiffness), *_SPENT)
    for count in (32, 64):
        yield SolverCase(f"sphere {count}", {"stiffness": 1e4}, partial(sphere, count), *_SPENT)
    yield SolverCase("shirt 20 mm", {}, shirt, *_SPENT)


def _rows_of(case: SolverCase, watch: Watch) -> Iterator[Row]:
    scene = case.make()
    reference = cache(partial(_reference, case, scene))
    count = len(scene.start)
    fine: dict[str, Value] = {**case.settings, "substeps": case.reference}
    yield watch.row(case.name, "reference", fine, count, lambda: reference()[1])
    given = replace(case, most=inf)  # what stands on the report card is always measured
    measure = partial(_measure, given, scene, checked(StepConfig, None), lambda: reference()[0])
    yield watch.row(case.name, "default", case.settings, count, measure)
    for method in METHODS:
        for substeps, sweeps in _budgets(scene, method, case.factors):
            spent: dict[str, Value] = {**case.settings, "substeps": substeps, "sweeps": sweeps}
            config = StepConfig.model_validate({"solver": method, "substeps": substeps, "sweeps": sweeps})
            measure = partial(_measure, case, scene, config, lambda: reference()[0])
            row = watch.row(case.name, method, spent, count, measure)
            yield row
            if row.seconds > case.patience:
                break


def _budgets(scene: Scene, method: str, factors: Sequence[float]) -> list[tuple[float, int]]:
    """Return (substeps a frame, iterations a step), cheapest first: either of a method's usual ones times the factors.

    Methods that iterate on a step are given more steps, and more iterations.
    """
    usual = choose_method(scene.model, scene.start, method, None, None)
    steps = [(_whole(usual.substeps * factor), usual.sweeps) for factor in factors]
    more = [(usual.substeps, max(1, round(usual.sweeps * factor))) for factor in factors if usual.sweeps > 1]
    return sorted(dict.fromkeys(steps + more), key=lambda budget: (budget[0] * budget[1], budget))


def _whole(substeps: float) -> float:
    """Return a whole number of steps a frame, or a share of one for steps longer than a frame."""
    return substeps if substeps < 1.0 else float(round(substeps))


def _measure(case: SolverCase, scene: Scene, config: StepConfig, truth: Callable[[], ClothState]) -> Measured:
    """Return one row's time and errors; of a run that failed, how."""
    try:
        ended, timing = timed_run(scene, config, budget=case.patience, most=case.most)
    except ComputationError:
        return Timing(0.0), {"status": "diverged"}
    except VtoError as error:
        return Timing(0.0), {"status": error.problem}
    return timing, {"status": "too slow"} if ended is None else _errors(scene, ended, truth())


def _errors(scene: Scene, ended: Ended, truth: ClothState) -> dict[str, Value]:
    state, residual = ended
    mass = scene.model.mass / scene.model.mass.sum()
    errors: dict[str, Value] = {**measures(scene, state), "residual": residual}
    errors["height_mm"] = 1e3 * abs(float(mass @ (state.positions - truth.positions)[:, 1]))
    if not scene.name.startswith(FOLDS):
        errors["distance_mm"] = distance_mm(state.positions, truth.positions)
    return errors


def _reference(case: SolverCase, scene: Scene) -> tuple[ClothState, Measured]:
    """Return the reference, and its row: its errors are those against steps twice as large."""
    fine, half = (StepConfig.model_validate({"substeps": case.reference // split}) for split in (1, 2))
    coarse, _ = run_scene(scene, half)
    ended, timing = timed(lambda: run_scene(scene, fine), runs=1)
    return ended[0], (timing, _errors(scene, ended, coarse))


TRADE = Trade(("rms_stretch", "distance_mm"), lambda quick: lambda row: row.method == "default", scene=("stiffness",))
