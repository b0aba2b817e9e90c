"""What a run bought with its budgets, and what another minute would buy."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from vto_pipeline.model.cloth import TraceRow

_MORE = 60.0  # s
_FEWEST = 3  # errors that a rate is taken from
_LATE = 1.1  # of a budget; later it is not kept


def budget_lines(run_record: Mapping[str, Any], trace: Sequence[TraceRow]) -> Iterator[str]:
    """Yield what each budget of a run went into, in words; nothing for a run without.

    Args:
        run_record: What run.json holds.
        trace: Error against run time of its drape; empty where there is none.
    """
    if run_record.get("time_budget_s"):
        used = run_record.get("time_spent_s", run_record["seconds"])
        bought = ", ".join(_bought(run_record)) or "everything was stored"
        yield f"time budget: {used:.1f} of {run_record['time_budget_s']:g} s used; {bought}"
        least = run_record.get("time_least_s")
        if used > _LATE * run_record["time_budget_s"] and least is not None:
            yield f"the time budget was not kept: this run takes {least:.0f} s at least, on this machine as loaded"
        yield from _another_minute(run_record, trace)
    if run_record.get("memory_budget_mb"):
        yield f"memory budget of {run_record['memory_budget_mb'] / 1e3:g} GB: {_largest(run_record)}"


def error_after(seconds: Sequence[float], errors: Sequence[float], more: float) -> float | None:
    """Return the error after more time, if it goes on falling as in the latter half: exponentially, by least squares.

    Args:
        seconds, errors: Error against run time, in its order; what is not finite does not count.
        more: Time after the last of them [s].

    Returns:
        In the unit of the errors; None where it did not fall, or where there are too few to tell.
    """
    times, values = np.asarray(seconds, dtype=np.float64), np.asarray(errors, dtype=np.float64)
    known = np.isfinite(values) & (values > 0.0)
    times, values = times[known], values[known]
    if len(times) == 0:
        return None
    latter = times >= 0.5 * (times[0] + times[-1])
    if latter.sum() < _FEWEST:
        return None
    rate = float(np.polyfit(times[latter] - times[-1], np.log(values[latter]), 1)[0])
    return float(values[-1] * np.exp(rate * more)) if rate < 0.0 else None


def _ran(run_record: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    return [stage for stage in run_record["stages"] if stage["status"] == "ran"]


def _bought(run_record: Mapping[str, Any]) -> Iterator[str]:
    """Yield what each stage that ran took of a time budget, the longest first, and the error reached for it."""
    for stage in sorted(_ran(run_record), key=lambda one: -one["seconds"]):
        reached = ""
        if "settled" in stage["metrics"]:
            error = stage["metrics"]["error_mm"]
            reached = " (how much motion is left is unknown)" if error is None else f" ({error:.2g} mm of motion left)"
        level = stage.get("level") or {}
        chosen = f" ({in_words(level['settings'])}: {_times(level['error'])})" if level.get("settings") else ""
        yield f"{stage['name']} {stage['seconds']:.1f} s{chosen}{reached}"


def in_words(settings: Mapping[str, Any]) -> str:
    """Return settings as `key=value`, those within settings with a dot."""
    found = []
    for name, value in settings.items():
        inner = value.items() if isinstance(value, Mapping) else [("", value)]
        found += [f"{name}.{key}={one}" if key else f"{name}={one}" for key, one in inner]
    return ", ".join(found)


def _times(error: float) -> str:
    return f"{error:.2f} times the usual error"


def _another_minute(run_record: Mapping[str, Any], trace: Sequence[TraceRow]) -> Iterator[str]:
    """Yield what more time would buy: for the whole, shared out anew, and for the drape alone."""
    more = run_record.get("another_minute")
    if more is not None and more["levels"]:
        bought = "; ".join(f"{section} {in_words(chosen) or 'as usual'}" for section, chosen in more["levels"].items())
        yield f"another minute for the whole run: {bought}; about {more['error']:.2f} times this error"
    elif more is not None:
        yield "another minute for the whole run: nothing more"
    for stage in run_record["stages"]:
        settled, reached = (stage["metrics"].get(name) for name in ("settled", "error_mm"))
        if settled is None:
            continue
        said = f"another minute for {stage['name']}"
        rows = [row for row in trace if row.level == 0]
        left = error_after([row.seconds for row in rows], [row.error_mm for row in rows], _MORE)
        if settled:
            yield f"{said}: nothing more, it is at rest"
        elif reached is None:
            yield f"{said}: not known, as it has not moved for long enough to tell what is left"
        elif left is None:
            yield f"{said}: not known, as its error did not fall lately"
        else:
            yield f"{said}: about {left:.2g} mm instead of {reached:.2g}"


def _largest(run_record: Mapping[str, Any]) -> str:
    """Return the largest memory that a stage of this run took, and whether that is more than the budget, in words."""
    if not _ran(run_record):
        return "nothing ran"
    most = max(_ran(run_record), key=lambda stage: stage["peak_mb"])
    over = ", which is over it" if most["peak_mb"] > run_record["memory_budget_mb"] else ""
    return f"at most {most['peak_mb'] / 1e3:.2g} GB, in {most['name']}{over}"
