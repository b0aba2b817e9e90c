"""The table: every method on every case, limits of explicit methods, refused inputs, worn fabrics."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from math import ceil

import numpy as np

from vto_pipeline.bench.bench import Measured, Row, Watch
from vto_pipeline.bench.cloth.closed_forms import growth_and_frequency
from vto_pipeline.bench.stability.case import StabilityCase
from vto_pipeline.bench.stability.limits import HIGHEST, LIMIT, STEPS, breaks_at, measured_growth, predicted_break
from vto_pipeline.bench.stability.refused import REFUSED, REFUSED_VERTICES, refuse
from vto_pipeline.bench.stability.sheets import quiet_sheet, sheet_cases
from vto_pipeline.bench.stability.strands import strand_cases
from vto_pipeline.bench.stability.trial import Maker, run_trial, undisturbed
from vto_pipeline.bench.stability.worn import worn_rows
from vto_pipeline.bench.timing import timed
from vto_pipeline.cloth.dynamics.methods import FRAME, METHODS, choose_method

DEFAULT = "default"
"""The method that a simulation chooses by the scene, with the steps and iterations it chooses."""

_PATIENCE = 5.0  # [s] a cell; beyond it a method is too slow
_QUICK_PATIENCE = 2.0
_QUICK_METHODS = ("xpbd", "symplectic_euler", "rk4", "backward_euler")
_QUICK_CASES = (
    "stiffness 1e4/1e8",
    "mass ratio 1:1000",
    "h 1/60",
    "h 1/2000",
    "slivers 1e-6",
    "random on a sphere",
    "collapsed to a point",
)
_OWN_SWEEPS = {"newton": 1}  # an iteration of it is a whole linear solve, and it adds some where one does not do
_MATCH = 2e-3  # of the predicted limit, to which the measured one must agree: it is bracketed to 1e-4
_SOMEWHERE = 0.5  # hω at which the growth per step is compared too


def rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """Measure; see the module."""
    cases = [case for case in (*strand_cases(), *sheet_cases()) if not quick or case.name in _QUICK_CASES]
    patience = _QUICK_PATIENCE if quick else _PATIENCE
    for case in cases:
        yield _default_cell(case, patience, watch)
    yield from _refusals(DEFAULT, None, watch)
    yield from worn_rows(quick, DEFAULT, watch)
    for name in _QUICK_METHODS if quick else METHODS:
        for case in cases:
            told = replace(case, sweeps=_OWN_SWEEPS.get(name, case.sweeps))
            yield _cell(name, told, METHODS[name], patience, watch)
        yield _limit(name, watch)
        yield from _refusals(name, name, watch)


def _default_cell(case: StabilityCase, patience: float, watch: Watch) -> Row:
    """What is chosen by the scene; of its own step only where the step is not what is tried."""
    choice = choose_method(case.model, case.start, None, None, None)
    if not case.step_tried:
        substeps = ceil(choice.substeps * case.h * case.substeps / FRAME - 1e-9)
        case = replace(case, h=case.h * case.substeps / substeps, substeps=substeps)
    return _cell(DEFAULT, replace(case, sweeps=choice.sweeps), METHODS[choice.method], patience, watch, choice.method)


def _cell(name: str, case: StabilityCase, make: Maker, patience: float, watch: Watch, chosen: str = "") -> Row:
    settings = {**case.settings, "patience_s": patience, **({"chosen": chosen} if chosen else {})}
    return watch.row(case.name, name, settings, len(case.start), lambda: run_trial(case, make, patience))


def _refusals(name: str, solver: str | None, watch: Watch) -> Iterator[Row]:
    for what in REFUSED:
        yield watch.row(what, name, {}, REFUSED_VERTICES, partial(refuse, what, solver))


def _limit(name: str, watch: Watch) -> Row:
    case = quiet_sheet()
    settings = {"steps": STEPS, "highest": HIGHEST}
    return watch.row("stability limit", name, settings, len(case.start), lambda: measured_limit(name, case))


def measured_limit(name: str, case: StabilityCase) -> Measured:
    """Return where a method breaks on the highest mode of a case, beside what theory says.

    Returns:
        The timing, and: verdict; holds_at and breaks_at [hω]; growth_at_half, per step at hω = ½; and for explicit
        methods the same from theory, with limit, the largest hω at which nothing grows.
    """
    with undisturbed():
        make = METHODS[name]
        (holds, breaks), timing = timed(lambda: breaks_at(case, make), runs=1)
        found = {"holds_at": holds, "breaks_at": breaks, "growth_at_half": measured_growth(case, make, _SOMEWHERE)}
        if name not in LIMIT:
            return timing, {"verdict": "passes" if breaks == np.inf else "limited", **found}
        predicted = predicted_break(name)
        theory = {
            "limit": LIMIT[name],
            "predicted_break": predicted,
            "predicted_growth_at_half": growth_and_frequency(name, _SOMEWHERE)[0],
        }
    if abs(breaks - predicted) > _MATCH * predicted:
        verdict = "breaks elsewhere"
    else:
        verdict = "limited" if LIMIT[name] else "always grows"
    return timing, {"verdict": verdict, **found, **theory}


TRADE = "whether a method survives is a yes or a no, not an error that time buys"
