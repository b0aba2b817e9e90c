"""A batch before its rows run: each one planned, and those finished at once that need no computing."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from vto_pipeline.errors import VtoError
from vto_pipeline.io.documents import Document
from vto_pipeline.pipeline.batch.order import Row
from vto_pipeline.pipeline.batch.roots import ANYWHERE, Roots
from vto_pipeline.pipeline.catalogue import Catalogue
from vto_pipeline.pipeline.execution.cost_model import CostModel, size_of, step_figures
from vto_pipeline.pipeline.execution.digest import digest_path
from vto_pipeline.pipeline.execution.forecast import stored_results
from vto_pipeline.pipeline.execution.key import run_key
from vto_pipeline.pipeline.execution.run import run
from vto_pipeline.pipeline.execution.store import Store
from vto_pipeline.pipeline.plan import Plan, Step
from vto_pipeline.pipeline.request import Request, read_setting, with_setting
from vto_pipeline.stages.entry import planning
from vto_pipeline.stages.entry.outcome import Outcome

_TOLD = 20  # rows of which a message tells what is wrong


@dataclass(frozen=True)
class PlannedRow:
    """A row that can be run.

    Args:
        row: What it runs.
        key: Of its result.
        done: Whether it was done before.
        stored: Whether, though it was not, the result of every stage is stored.
        seconds: Time that it will take, as far as the cost model knows; None where it knows none of its stages. What
            several rows share counts in the first of them.
    """

    row: Row
    key: str
    done: bool
    stored: bool
    seconds: float | None = None


def with_settings(rows: Sequence[Row], overrides: Sequence[str]) -> list[Row]:
    """Return rows with settings "section.key=value" that win over their documents.

    Raises:
        ConfigError: one of them is no setting, or not valid.
    """
    chosen = [read_setting(text, planning.catalogue()) for text in overrides]
    found = []
    for row in rows:
        data = row.data
        for setting in chosen:
            data = with_setting(data, *setting)
        found.append(replace(row, data=data))
    return found


def plan_rows(
    rows: Sequence[Row],
    store: Store,
    is_done: Callable[[str, str], bool],
    force_all: bool,
    roots: Roots = ANYWHERE,
) -> list[PlannedRow]:
    """Plan every row, so that no mistake waits until hours have passed. A file that rows share is read once.

    Args:
        rows: All of the batch.
        store: Where the rows keep their results.
        is_done: Name and key of a row -> whether it was done before.
        force_all: Of the runs.
        roots: Where all given files must lie.

    Raises:
        VtoError: of the first row that is wrong; it names what is wrong in the others, too.
    """
    tables, of_path = planning.catalogue(), cache(digest_path)
    forecast = _Forecast(store)
    found, faults = [], dict[str, VtoError]()
    for row in rows:
        try:
            request, plan, _ = _plan(row, tables)
            for path in [path for one in request.given.values() for path in one.paths]:
                roots.check_path(path, row.where)
            key = run_key(request, plan, force_all, of_path)
        except VtoError as error:
            error.where = f"row {row.name}, {error.where or row.where}"
            faults[row.name] = error
            continue
        done = is_done(row.name, key)
        results = [] if done else list(stored_results(request, plan, store, force_all, of_path))
        missing = [step for step, result in results if result is None]
        stored = not done and all(step.stage.final for step in missing)
        found.append(PlannedRow(row, key, done, stored, forecast.seconds(request, plan, missing)))
    if faults:
        raise _together(faults)
    return found


def _together(faults: Mapping[str, VtoError]) -> VtoError:
    """Return the first fault of a batch, and in its hint those of the other rows, which are then told at once."""
    first, *others = faults.items()
    lines = [f"row {name}: {error.problem}" for name, error in others[:_TOLD]]
    if len(others) > _TOLD:
        lines.append(f"and {len(others) - _TOLD} more")
    if lines:
        rest = f"{len(faults)} rows are wrong, also\n    " + "\n    ".join(lines)
        first[1].hint = f"{first[1].hint}; {rest}" if first[1].hint else rest
    return first[1]


class _Forecast:
    """The time of rows, one after another."""

    def __init__(self, store: Store) -> None:
        self._model, self._size = CostModel(store), cache(size_of)
        self._counted: set[tuple[Any, ...]] = set()

    def seconds(self, request: Request, plan: Plan, missing: Sequence[Step]) -> float | None:
        """Return the time [s] of the stages of a row that are to run and that no row before it runs."""
        if not self._model or not missing:
            return None
        figures, known = step_figures(request, plan, self._size), []
        for step in missing:
            name = step.stage.name
            work = (name, *sorted(figures[name].items()))
            if work not in self._counted and (seconds := self._model.seconds(name, figures[name])) is not None:
                known.append(seconds)
            self._counted.add(work)
        return sum(known) if known else None


def finish_stored(row: Row, folder: Path, store: Store, force_all: bool) -> Outcome | None:
    """Finish a row whose results are all stored, in this process; None where that fails, for whatever reason.

    Args:
        row: The row.
        folder: Of its run.
        store: Where its results are.
        force_all: Of the run.
    """
    with suppress(Exception):  # a process of its own tells what is wrong, and costs no other row
        request, plan, tables = _plan(row, planning.catalogue())
        return Outcome(folder, run(request, plan, tables, folder, force_all=force_all, cache=store.folder), tables)
    return None


def _plan(row: Row, tables: Catalogue) -> tuple[Request, Plan, Catalogue]:
    return planning.planned_document(Document(row.data, Path(row.where)), row.base, (), tables)
