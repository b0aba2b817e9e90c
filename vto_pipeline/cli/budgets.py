"""What a run bought with its budgets, and what another minute would buy."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from vto_pipeline.stages.entry.outcome import Outcome

_MORE = 60.0  # s


def budget_lines(outcome: Outcome) -> Iterator[str]:
    """Yield what each budget of a run went into."""
    record = outcome.record
    if record.get("time_budget_s"):
        yield f"  of the time budget of {record['time_budget_s']:g} s: {', '.join(_bought(record['stages']))}"
        yield from _another_minute(outcome)
    if record.get("memory_budget_mb"):
        yield f"  of the memory budget of {record['memory_budget_mb'] / 1e3:g} GB: {_largest(record)}"


def _bought(stages: Iterable[Mapping[str, Any]]) -> Iterator[str]:
    """Yield what each stage that ran took of a time budget, the longest first, and the error reached for it."""
    for stage in sorted((one for one in stages if one["status"] == "ran"), key=lambda one: -one["seconds"]):
        error = stage["metrics"].get("error_mm")
        reached = "" if error is None else f" ({error:.2g} mm of motion left)"
        yield f"{stage['name']} {stage['seconds']:.1f} s{reached}"


def _largest(record: Mapping[str, Any]) -> str:
    """Return the largest memory that a stage of this run took, and whether that is more than the budget, in words."""
    ran = [stage for stage in record["stages"] if stage["status"] == "ran"]
    if not ran:
        return "nothing ran"
    most = max(ran, key=lambda stage: stage["peak_mb"])
    over = ", which is over it" if most["peak_mb"] > record["memory_budget_mb"] else ""
    return f"at most {most['peak_mb'] / 1e3:.2g} GB, in {most['name']}{over}"


def _another_minute(outcome: Outcome) -> Iterator[str]:
    """Yield what more time would buy, where the drape is not at rest."""
    from vto_pipeline.pipeline.execution.budget import error_after

    for stage in outcome.record["stages"]:
        reached = stage["metrics"].get("error_mm")
        if reached is None or stage["metrics"].get("settled") is not False or not outcome.made("trace"):
            continue
        rows = [row for row in outcome.read("trace") if row.level == 0]
        left = error_after([row.seconds for row in rows], [row.error_mm for row in rows], _MORE)
        bought = f"about {left:.2g} mm instead of {reached:.2g}" if left is not None else "not known"
        why = "" if left is not None else ", as its error did not fall lately"
        yield f"  another minute for {stage['name']}: {bought}{why}"
