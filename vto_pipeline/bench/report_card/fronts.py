"""Error against run time: the points of a bench that nothing beats, and how far today's default is from them.

A point is on the Pareto front if no other is both faster and more exact. How far a point is from it is two numbers:
its error against the least in its time, and its time against the least at its error. Neither follows from the other:
where the error has stopped to fall, a point of four times the time errs as little. Times, and errors, less than 10 %
apart count as the same, since a clock and a last digit would otherwise decide which point beats which.

The truth's own row tells how far it is known, or what the cloth does in truth: at rest it is stretched by its weight.
An error below that is as good as that one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from vto_pipeline.bench.bench import Row

NEAR = 1.1
"""As near to the front as a default has to be, and as near as what counts as the same."""

Default = Callable[[Row], bool]
Entry = dict[str, Any]


@dataclass(frozen=True)
class Trade:
    """What a bench trades against run time. It is the attribute TRADE of the bench's module.

    Args:
        errors: Figures, the smaller the better.
        default: Whether the bench is quick -> what tells today's default from other rows.
        scene: Settings that belong to the scene.
        truth: Methods that are what the errors are taken against, and whose errors no other row's can be less than.
    """

    errors: Sequence[str]
    default: Callable[[bool], Default]
    scene: Sequence[str] = ()
    truth: Sequence[str] = ("reference",)


def fronts(module: str, rows: Iterable[Row], quick: bool) -> list[Entry] | str:
    """Return the fronts of a bench, or why it has none.

    Args:
        module: Of the bench; its TRADE is a `Trade`, or the reason why there is none.
        rows: As measured.
        quick: Whether the bench was.

    Returns:
        A front for each scene and error: {"scene", "error", "front" (labels, the fastest first), "default" (its label),
        "error_factor", "time_factor" and "verdict"}; None without a measured default, or where infinite.
    """
    trade: Trade | str = import_module(module).TRADE
    return trade if isinstance(trade, str) else list(_fronts(trade, list(rows), quick))


def distances(time: float, error: float, points: Iterable[tuple[float, float]]) -> tuple[float, float]:
    """Return by which factors the error of a point is above the least in its time, and its time the least at its error.

    Args:
        time, error: Of the point.
        points: Times and errors of all, itself among them.
    """
    every = list(points)
    least_error = min(e for t, e in every if t <= NEAR * time)
    least_time = min(t for t, e in every if e <= NEAR * error)
    return _ratio(error, least_error), _ratio(time, least_time)


def _fronts(trade: Trade, rows: Sequence[Row], quick: bool) -> Iterator[Entry]:
    is_default = trade.default(quick)
    for scene, every in _by_scene(trade, rows).items():
        for error in trade.errors:
            known = [_value(row, error) for row in every if row.method in trade.truth and _is_point(row, error)]
            those = [row for row in every if row.method not in trade.truth and _is_point(row, error)]
            points = [(row, max([_value(row, error), *known])) for row in those]
            if len(points) < 2:
                continue
            values = [(row.seconds, value) for row, value in points]
            front = [
                row
                for row, value in sorted(points, key=lambda one: one[0].seconds)
                if not any(_beats(other, (row.seconds, value)) for other in values)
            ]
            entry: Entry = {"scene": scene, "error": error, "front": [_label(trade, row) for row in front]}
            chosen = [(row, value) for row, value in points if is_default(row)]
            if not chosen:
                nothing = {"default": None, "error_factor": None, "time_factor": None}
                yield {**entry, **nothing, "verdict": "the default was not measured"}
                continue
            row, value = chosen[0]
            more_error, more_time = distances(row.seconds, value, values)
            yield {
                **entry,
                "default": _label(trade, row),
                "error_factor": _rounded(more_error),
                "time_factor": _rounded(more_time),
                "verdict": _verdict(row in front, more_error, more_time),
            }


def _verdict(on_front: bool, more_error: float, more_time: float) -> str:
    off = []
    if more_error > NEAR:
        off.append(f"{more_error:.2g} times the least error in its time")
    if more_time > NEAR:
        off.append(f"{more_time:.2g} times the least time at its error")
    near = "on the front" if on_front else f"within {100.0 * (NEAR - 1.0):.0f} % of the front"
    return ", ".join(off) or near


def _rounded(factor: float) -> float | None:
    """Return a factor for JSON, which has nothing for what is infinite."""
    return round(factor, 3) if math.isfinite(factor) else None


def _by_scene(trade: Trade, rows: Iterable[Row]) -> dict[str, list[Row]]:
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(_words(row.scene, {k: row.settings.get(k) for k in trade.scene}), []).append(row)
    return found


def _label(trade: Trade, row: Row) -> str:
    return _words(row.method, {k: v for k, v in row.settings.items() if k not in trade.scene})


def _words(name: str, settings: Mapping[str, Any]) -> str:
    known = sorted((k, v) for k, v in settings.items() if v is not None)  # a results file has them in this order
    return ", ".join([name, *(f"{k} {v:g}" if isinstance(v, float) else f"{k} {v}" for k, v in known)])


def _is_point(row: Row, error: str) -> bool:
    value = row.errors.get(error)
    return isinstance(value, float | int) and not isinstance(value, bool) and math.isfinite(value) and row.seconds > 0.0


def _value(row: Row, error: str) -> float:
    return float(row.errors[error])  # type: ignore[arg-type]


def _beats(one: tuple[float, float], other: tuple[float, float]) -> bool:
    return one[0] <= other[0] and one[1] <= other[1] and one != other


def _ratio(value: float, other: float) -> float:
    return 1.0 if value == other else value / other if other > 0.0 else math.inf
