"""How long stages will take, and how much memory: learnt from what they took, by what a plan knows of their inputs.

The logarithm of a stage's time, or of its peak memory, is a sum: a constant, a multiple of the logarithm of each size
and of each setting, and an effect of each thing that was given, such as one body under many garments. All are
estimated together with normal priors (ridge regression), so that few records give no wild exponents, and with Huber's
weights, so that a run that compiled its kernels, or met a busy machine, counts as one and not as ten. What another
build, or another machine, took tells how time grows with size; how long it takes here is for this one's own to tell.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.pipeline.execution.key import time_key
from vto_pipeline.pipeline.execution.store import MANIFEST, Store
from vto_pipeline.pipeline.given import Given
from vto_pipeline.pipeline.plan import Plan, Step
from vto_pipeline.pipeline.request import Request

Figures = Mapping[str, float | str]
"""What a plan knows of a stage's work: logarithms of sizes and settings, and names of what was given."""

FILES = " files"
"""What follows the key of something given in the name of the number of its files."""
TIMED = "timed"
"""Key of a record's `time_key`; as one of its figures, the name of what it was timed on."""
_NOISE = 0.3  # of the logarithm of a time: one run against the next
_EXPONENT = 1.0  # prior of the power of a size; work is rarely more than quadratic
_EFFECT = 0.5  # prior of what one garment or body adds to the logarithm
_TIMED_EFFECT = 3.0  # what another build or machine may add: anything
_HUBER = 1.345  # of the noise: 95 % efficient where nothing is an outlier
_LEAST_RECORDS = 4  # of a stage; below them the median
_LATEST = 200  # records of a stage that are read
_ROUNDS = 20
_SHORTEST = 1e-3  # s: what clocks tell apart


def step_figures(
    request: Request, plan: Plan, size: Callable[[Path], tuple[int, int]] | None = None
) -> dict[str, Figures]:
    """Return for each stage of a plan what is known of its work: of all that it is made from, and of all settings.

    Args:
        request: What is given.
        plan: What will be done.
        size: Path -> files and bytes, where many plans share one memory; None: look.
    """
    size = size or cache(size_of)
    known: dict[str, dict[str, float | str]] = {a: _of_given(one, size) for a, one in request.given.items()}
    found: dict[str, Figures] = {}
    for step in plan.steps:
        merged = _of_settings(step)
        for artifact in step.inputs:
            merged.update(known.get(artifact, {}))
        found[step.stage.name] = merged
        for artifact in step.stage.makes:
            if plan.makers.get(artifact) == step.stage.name:
                known[artifact] = merged
    return found


def size_of(path: Path) -> tuple[int, int]:
    """Return how many files there are at a path, and how many bytes they hold; none where there is nothing."""
    count = total = 0
    for file in path.rglob("*") if path.is_dir() else [path]:
        with suppress(OSError):
            if file.is_file():
                count, total = count + 1, total + file.stat().st_size
    return count, total


def _of_given(one: Given, size: Callable[[Path], tuple[int, int]]) -> dict[str, float | str]:
    sizes = [size(path) for path in one.paths]
    found: dict[str, float | str] = {one.key: str(one.source)}
    if sizes:
        files, held = (sum(column) for column in zip(*sizes, strict=True))
        found |= {f"{one.key}{FILES}": math.log1p(files), f"{one.key} bytes": math.log1p(held)}
    return found


def _of_settings(step: Step) -> dict[str, float | str]:
    """Return the settings that were chosen, against their defaults; what is not there is as by default."""
    found: dict[str, float | str] = {}
    for name in step.settings.model_fields_set:
        value, default = getattr(step.settings, name), type(step.settings).model_fields[name].default
        label = f"{step.stage.section}.{name}"
        if value == default:
            continue
        if _is_positive(value) and _is_positive(default):
            found[label] = math.log(value / default)
        else:
            found[label] = str(value)
    return found


def _is_positive(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0 < value < math.inf


@dataclass(frozen=True)
class StageCost:
    """The fitted cost of one stage.

    Args:
        constant: Of the logarithm of the time, or of the memory.
        means: Size or setting -> mean of its logarithm.
        terms: Size or setting -> power; (given key, name) as "key = name" -> effect.
    """

    constant: float
    means: Mapping[str, float]
    terms: Mapping[str, float]

    def expected(self, figures: Figures) -> float:
        """Return the expected time [s] or memory [MB]; what was never met counts as average."""
        total = self.constant
        for name, value in figures.items():
            if isinstance(value, str):
                total += self.terms.get(f"{name} = {value}", 0.0)
            elif name in self.terms:
                total += self.terms[name] * (value - self.means[name])
        return math.exp(total)


def fit_cost(records: Iterable[tuple[Figures, float]]) -> StageCost | None:
    """Fit what a stage took.

    Args:
        records: Figures and time [s], or memory [MB], of each time it ran.

    Returns:
        The fit; the median where there are few; None where there are none.
    """
    rows = list(records)
    if not rows:
        return None
    logs = np.log(np.maximum([taken for _, taken in rows], _SHORTEST))
    middle = float(np.median(logs))
    columns = _columns([figures for figures, _ in rows])
    if len(rows) < _LEAST_RECORDS or not columns:
        return StageCost(middle, {}, {})
    means = {name: float(column.mean()) for name, (column, is_size) in columns.items() if is_size}
    matrix = np.column_stack([column - means.get(name, 0.0) for name, (column, _) in columns.items()])
    priors = np.array([_prior(name, is_size) for name, (_, is_size) in columns.items()])
    penalty = np.diag(np.concatenate([[0.0], (_NOISE / priors) ** 2]))
    design = np.column_stack([np.ones(len(rows)), matrix])
    found = np.concatenate([[middle], np.zeros(matrix.shape[1])])
    for _ in range(_ROUNDS):
        away = np.abs(logs - design @ found)
        weights = np.minimum(1.0, _HUBER * _NOISE / np.maximum(away, 1e-12))
        found = np.linalg.solve(design.T @ (weights[:, None] * design) + penalty, design.T @ (weights * logs))
    return StageCost(float(found[0]), means, dict(zip(columns, map(float, found[1:]), strict=True)))


def _prior(name: str, is_size: bool) -> float:
    if name.startswith(f"{TIMED} = "):
        return _TIMED_EFFECT
    return _EXPONENT if is_size else _EFFECT


def _columns(figures: list[Figures]) -> dict[str, tuple[np.ndarray[Any, np.dtype[np.float64]], bool]]:
    """Return what differs between records: column, and whether it is a size rather than one of several names."""
    found: dict[str, tuple[np.ndarray[Any, np.dtype[np.float64]], bool]] = {}
    for name in sorted({name for one in figures for name in one}):
        values = [one.get(name, 0.0) for one in figures]
        words = sorted({value for value in values if isinstance(value, str)})
        for word in words:
            found[f"{name} = {word}"] = np.array([float(value == word) for value in values]), False
        if not words:
            found[name] = np.array(values, dtype=np.float64), True
    return {name: (column, is_size) for name, (column, is_size) in found.items() if np.ptp(column) > 0}


class CostModel:
    """The cost of every stage that has run before, as the records of a store tell.

    Args:
        store: Where the results are.
    """

    def __init__(self, store: Store) -> None:
        stages = sorted(path.name for path in store.folder.glob("*/") if not path.name.startswith("."))
        records = {stage: list(_records(store, stage)) for stage in stages}
        self._timed = {TIMED: time_key()}
        own = {stage: [row for row in of if row[0][TIMED] == self._timed[TIMED]] for stage, of in records.items()}
        self._own = {stage for stage, of in own.items() if of}
        for stage in self._own:
            if len(records[stage]) < _LEAST_RECORDS:  # too few to tell what is due to this build
                records[stage] = own[stage]
        self._seconds = {stage: fit_cost((one, seconds) for one, seconds, _ in of) for stage, of in records.items()}
        self._peaks = {stage: fit_cost((one, peak) for one, _, peak in of) for stage, of in records.items()}

    def __bool__(self) -> bool:
        return any(cost is not None for cost in self._seconds.values())

    def timed_here(self, stage: str) -> bool:
        """Return whether a stage has run as it would now: this build of it, on this machine."""
        return stage in self._own

    def seconds(self, stage: str, figures: Figures) -> float | None:
        """Return how long a stage will take [s]; None where it has never run."""
        cost = self._seconds.get(stage)
        return None if cost is None else cost.expected({**figures, **self._timed})

    def peak_mb(self, stage: str, figures: Figures) -> float | None:
        """Return how much memory the process will take while a stage runs [MB]; None where it has never run."""
        cost = self._peaks.get(stage)
        return None if cost is None else cost.expected({**figures, **self._timed})


def _records(store: Store, stage: str) -> Iterator[tuple[Figures, float, float]]:
    """Yield figures, time [s] and peak memory [MB] of a stage's latest results that were not skipped.

    The time is that by default: at a level that takes a third of it, three times as much as was measured.
    """
    dated = []
    for manifest in (store.folder / stage).glob(f"*/{MANIFEST}"):
        with suppress(OSError):  # gone meanwhile
            dated.append((manifest.stat().st_mtime_ns, manifest))
    for _, manifest in sorted(dated)[-_LATEST:]:
        with suppress(OSError, ValueError, KeyError, TypeError):  # not ours
            record = json.loads(manifest.read_text(encoding="utf-8"))["record"]
            if not record["reason"]:
                by_default = float(record["seconds"]) / float(record.get("share", 1.0))
                figures = {**record["figures"], TIMED: record.get(TIMED, "")}
                yield figures, by_default, float(record["peak_mb"])
