"""A bench: a function from `quick` and a watch to rows, each a measured point of a scene and a method."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from importlib import import_module
from typing import Any

from vto_pipeline.bench.timing import Timing, threads_now
from vto_pipeline.errors import ComputationError

ALL = "all stages"
"""Method of a row that is the sum of others."""
Value = float | str | bool | None
"""A figure, or a word where there is none: "diverged"."""
Measured = tuple[Timing, Mapping[str, Value]]


@dataclass(frozen=True)
class Row:
    """One measured point.

    Args:
        scene: What was computed, such as "hang 32".
        method: How: a solver, an integrator, a constraint, a kernel.
        settings: The budget: substeps, sweeps, step size; plain values.
        vertices: How large.
        seconds: Median run time, compiled [s].
        errors: Name, ending in its unit -> value. Names are the bench's own.
        runs: How many times it ran; one when a single run exceeds the budget of `timing.timed`.
        compile_s: What the first, untimed run took on top: compilation, or loading the compiled code [s].
        threads: Threads the kernels could use.
        spread_s: From the shortest to the longest of its runs [s]; None where there was one.
    """

    scene: str
    method: str
    settings: Mapping[str, Value]
    vertices: int
    seconds: float
    errors: Mapping[str, Value]
    runs: int = 1
    compile_s: float = 0.0
    threads: int = field(default_factory=threads_now)
    spread_s: float | None = None

    @property
    def key(self) -> str:
        """What tells one point of a bench from another: all that was chosen, nothing that was measured."""
        chosen = [self.scene, self.method, self.vertices, self.threads, dict(self.settings)]
        return json.dumps(chosen, sort_keys=True, default=float)

    def as_json(self) -> dict[str, Any]:
        """Return plain values; a figure that is not finite becomes the word "nan", "inf" or "-inf"."""
        plain = asdict(self)
        plain["settings"], plain["errors"] = _plain(self.settings), _plain(self.errors)
        return plain

    @classmethod
    def from_json(cls, plain: Mapping[str, Any]) -> Row:
        """Return the row that `as_json` wrote; an older one had no spread."""
        return cls(**{one.name: plain[one.name] for one in fields(cls) if one.name in plain})


class Watch:
    """Tells whoever waits how far a bench is, and spares it what an earlier run has measured.

    Args:
        say: Takes one line of progress.
        known: Rows that need not be measured again.
    """

    def __init__(self, say: Callable[[str], None] = lambda text: None, known: Iterable[Row] = ()) -> None:
        self._say = say
        self._known = {row.key: row for row in known}

    def __call__(self, text: str) -> None:
        """Say what comes next."""
        self._say(text)

    def row(
        self, scene: str, method: str, settings: Mapping[str, Value], vertices: int, measure: Callable[[], Measured]
    ) -> Row:
        """Return the row of this point: as an earlier run measured it, or measured now.

        A computation that fails is a row too: its "status" says why.
        """
        wanted = Row(scene, method, settings, vertices, 0.0, {})
        kept = self._known.get(wanted.key)
        if kept is not None:
            return kept
        self(" ".join([scene, method, *(f"{name}={value}" for name, value in settings.items())]))
        began = time.perf_counter()
        try:
            timing, errors = measure()
        except ComputationError as failure:
            timing, errors = Timing(time.perf_counter() - began), {"status": failure.problem}
        return replace(
            wanted,
            seconds=timing.seconds,
            errors=errors,
            runs=timing.runs,
            compile_s=timing.compile_s,
            spread_s=timing.spread_s,
        )


Rows = Callable[[bool, Watch], Iterable[Row]]
"""What a bench module offers as `rows(quick, watch)`. A generator's rows are kept as they come, also on Ctrl-C."""


@dataclass(frozen=True)
class Bench:
    """A line of the table of benches.

    Args:
        about: One line of help.
        module: Where its `rows` is; loaded when it runs.
        draw: From the document to the PNG.
    """

    about: str
    module: str
    draw: Callable[[Mapping[str, Any]], bytes]

    def rows(self, quick: bool, watch: Watch) -> Iterable[Row]:
        """Measure."""
        measure: Rows = import_module(self.module).rows
        return measure(quick, watch)


def least_seconds(rows: Iterable[Mapping[str, Any]]) -> float:
    """Return the time that measuring rows of a document took, at least: what each needed besides is not known [s]."""
    timed = (row for row in rows if row["method"] != ALL)
    return sum(row["seconds"] * max(row.get("runs", 1), 1) + row.get("compile_s", 0.0) for row in timed)


def _plain(values: Mapping[str, Value]) -> dict[str, Value]:
    return {str(name): _plain_value(value) for name, value in values.items()}


def _plain_value(value: Value) -> Value:
    if value is None or isinstance(value, str | bool | int):
        return value
    number = float(value)
    return number if math.isfinite(number) else str(number)
