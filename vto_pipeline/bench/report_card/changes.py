"""What got better or worse between two results files of a bench, beyond the noise of repeats."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from math import isfinite
from pathlib import Path
from typing import Any

from vto_pipeline.bench.bench import Row, Value
from vto_pipeline.bench.machine import same_hardware
from vto_pipeline.errors import InputError
from vto_pipeline.io.documents import read_json

MEANT = 0.01
"""Share by which an error must change: pages show two digits. An error is the same in every repeat; it has no noise."""
_NOTHING = 1e-9  # an error below it, in whatever unit, is rounding
_LEAST_TIME = 0.05  # share by which a time must change besides the spread of its repeats

_LARGER = (
    *("*within_*", "*inside*_share", "*per_s", "*per_second", "*saved_share", "*_left_out_share"),
    *("holds_at", "breaks_at"),
)
_NEITHER = (
    *("predicted_*", "allowed_*", "reference_*", "group_limit_mm", "*_by_*", "moved_*", "slid_mm", "spread_mm"),
    *("hem_mm", "clearance_mm", "asked_mm", "*_interval_mm", "*_girth_mm", "drape_share", "measured_share"),
    *("proof_share", "bandwidth_share", "roofline_share"),
)
_SMALLER = (
    *("*crossings", "missed", "wrong_side", "*_left", "*_mm", "*_mm.median", "*_mm.p9?", "*_mm.mean"),
    *("girths_off_mm.*", "*_share", "*_error", "*_error_deg", "*residual", "*_stretch", "energy_drift", "energy_gain"),
)
"""Names of errors by what is good; the first list that has a name holds. Others are only said to have changed."""
_GOOD = ("reached", "passes", "ended", True)


@dataclass(frozen=True)
class Change:
    """A figure that changed beyond noise.

    Args:
        bench, row, figure: Which.
        old, new: Its values.
        verdict: "better", "worse", or "other" where neither can be said.
    """

    bench: str
    row: str
    figure: str
    old: Value
    new: Value
    verdict: str


@dataclass(frozen=True)
class Comparison:
    """Two results files, figure by figure.

    Args:
        bench: Their name.
        figures: How many errors both have.
        times: How many run times could be told from noise.
        changes: Those that changed.
        gone, added: Rows that only the old one has, and only the new one.
        untimed: Why run times are not compared, or only some; empty where all are.
    """

    bench: str
    figures: int
    times: int
    changes: tuple[Change, ...]
    gone: tuple[str, ...]
    added: int
    untimed: str


def compare_folders(old: Path, new: Path, names: tuple[str, ...] = ()) -> list[Comparison]:
    """Compare the results files that two folders both hold.

    Args:
        old, new: The folders.
        names: Of the benches; none: all.

    Raises:
        InputError: there is none, or not one of the names.
    """
    for folder in (old, new):
        absent = [name for name in names if not (folder / f"{name}.json").is_file()]
        if absent:
            raise InputError(f"no results of {', '.join(absent)}", where=str(folder))
    found = names or sorted(path.stem for path in new.glob("*.json") if (old / path.name).is_file())
    if not found:
        raise InputError(f"no results file that {new} holds too", where=str(old))
    return [compare_results(read_json(old / f"{name}.json"), read_json(new / f"{name}.json")) for name in found]


def compare_results(old: Mapping[str, Any], new: Mapping[str, Any]) -> Comparison:
    """Compare two results files of one bench.

    Errors are compared wherever they were measured, with however many threads. Run times are compared only on the same
    hardware with nothing else running, and count only where the repeats of both lie apart.
    """
    before, after = (
        {replace(row, threads=0).key: row for row in (Row.from_json(plain) for plain in document["rows"])}
        for document in (old, new)
    )
    pairs = [(before[key], after[key]) for key in before if key in after]
    untimed = _why_untimed(old["machine"], new["machine"])
    timed = [] if untimed else [(one, other) for one, other in pairs if _repeated(one) and _repeated(other)]
    if not untimed and len(timed) < len(pairs):
        untimed = f"{len(pairs) - len(timed)} of {len(pairs)} run times were measured once"
    changes = [change for one, other in pairs for change in _changed_errors(new["bench"], one, other)]
    changes += [change for one, other in timed for change in _changed_time(new["bench"], one, other)]
    return Comparison(
        new["bench"],
        sum(len(one.errors.keys() & other.errors.keys()) for one, other in pairs),
        len(timed),
        tuple(changes),
        tuple(_label(before[key]) for key in before if key not in after),
        sum(key not in before for key in after),
        untimed,
    )


def _why_untimed(old: Mapping[str, Any], new: Mapping[str, Any]) -> str:
    if not same_hardware(old, new):
        return "other hardware"
    busy = [
        name for name, machine in (("old", old), ("new", new)) if (machine["load_at_start"] or 0) >= machine["cores"]
    ]
    return f"other work ran beside the {' and the '.join(busy)} one" if busy else ""


def _repeated(row: Row) -> bool:
    return row.spread_s is not None


def _changed_time(bench: str, one: Row, other: Row) -> Iterator[Change]:
    noise = (one.spread_s or 0.0) + (other.spread_s or 0.0)
    change = other.seconds - one.seconds
    if abs(change) > max(noise, _LEAST_TIME * one.seconds):
        verdict = "worse" if change > 0 else "better"
        yield Change(bench, _label(one), "seconds", one.seconds, other.seconds, verdict)


def _changed_errors(bench: str, one: Row, other: Row) -> Iterator[Change]:
    for name, old in one.errors.items():
        if name in other.errors:
            verdict = _verdict(name, old, other.errors[name])
            if verdict:
                yield Change(bench, _label(one), name, old, other.errors[name], verdict)


def _verdict(name: str, old: Value, new: Value) -> str:
    """Return "better", "worse" or "other"; empty where nothing changed that is meant."""
    if old == new:
        return ""
    before, after = _number(old), _number(new)
    if before is None or after is None:
        return "other" if (old in _GOOD) == (new in _GOOD) else "better" if new in _GOOD else "worse"
    before, after = abs(before), abs(after)  # a bias, say, is bad on either side
    if isfinite(before) and isfinite(after) and abs(after - before) <= max(MEANT * before, _NOTHING):
        return ""
    if _is(name, _LARGER):
        return "better" if after > before else "worse"
    if _is(name, _SMALLER) and not _is(name, _NEITHER):
        return "better" if after < before else "worse"
    return "other"


def _is(name: str, patterns: tuple[str, ...]) -> bool:
    return any(fnmatchcase(name, pattern) for pattern in patterns)


def _number(value: Value) -> float | None:
    """Return a figure, also one that is not finite and therefore a word."""
    if isinstance(value, bool) or value is None:
        return None
    try:
        return float(value)
    except ValueError:
        return None


def _label(row: Row) -> str:
    settings = " ".join(f"{name}={value}" for name, value in row.settings.items())
    return ", ".join(filter(None, (row.scene, row.method, settings)))
