"""Error against run time: the points of a bench that nothing beats, and how far today's default is from them.

A point is on the Pareto front if no other is both faster and more exact. How far a point is from it is one number: the
factor by which both its time and its error would have to shrink until nothing beats it (the multiplicative epsilon
indicator; Zitzler, Thiele, Laumanns, Fonseca & Grunert da Fonseca 2003).

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
"""As near to the front as a default has to be."""

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
        "factor" and "verdict"}; the last three are None, None and words where the default was not measured.
    """
    trade: Trade | str = import_module(module).TRADE
    return trade if isinstance(trade, str) else list(_fronts(trade, list(rows), quick))


def distance(time: float, error: float, points: Iterable[tuple[float, float]]) -> float:
    """Return the factor by which time and error of a point would have to shrink until no other point beats it; 1 on it.

    Args:
        time, error: Of the point.
        points: Times and errors of the others; it may be among them.
    """
    return max([1.0, *(min(_ratio(time, t), _ratio(error, e)) for t, e in points if t < time or e < error)])


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
                yield {**entry, "default": None, "factor": None, "verdict": "the default was not measured"}
                continue
            row, value = chosen[0]
            factor = 1.0 if row in front else distance(row.seconds, value, values)
            yield {
                **entry,
                "default": _label(trade, row),
                "factor": round(factor, 3),
                "verdict": _verdict(row in front, factor),
            }


def _verdict(on_front: bool, factor: float) -> str:
    if on_front:
        return "on the front"
    off = f"{100.0 * (factor - 1.0):.0f} % off"
    return f"within {100.0 * (NEAR - 1.0):.0f} % of the front: {off}" if factor <= NEAR else f"{off} the front"


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
    return value / other if other > 0.0 else math.inf
