"""The rows of a batch as a grid: what changes from row to row, and every combination of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice, product
from pathlib import Path
from typing import Any

from vto_pipeline.errors import ConfigError
from vto_pipeline.pipeline.batch.order import Row

_SECTIONS = ("given", "stages", "choose", "seed")
_NAMED = 3  # combinations that a message names


@dataclass(frozen=True)
class Axis:
    """What rows differ in.

    Args:
        key: In their pipeline documents, such as "given.fabric".
        values: That it takes: numbers, the smallest first, or anything else in the rows' order.
        slides: Whether they are numbers, so that there is something between two of them.
    """

    key: str
    values: tuple[Any, ...]
    slides: bool


@dataclass(frozen=True)
class Grid:
    """A batch whose rows are every combination of its axes.

    Args:
        axes: Those that slide last.
        rows: In the order of the combinations, the last axis turning fastest.
    """

    axes: tuple[Axis, ...]
    rows: tuple[Row, ...]


def grid_of(rows: Sequence[Row], where: str) -> Grid:
    """Return the rows of a batch as a grid.

    Args:
        rows: All of it.
        where: Its document, for messages.

    Raises:
        ConfigError: the rows are alike, a combination is missing, or there twice.
    """
    documents = [dict(_leaves(row.data)) for row in rows]
    keys = dict.fromkeys(key for document in documents for key in document)
    axes = [axis for key in keys if len((axis := _axis(key, [one.get(key) for one in documents])).values) > 1]
    axes.sort(key=lambda axis: axis.slides)  # stable
    if not axes:
        raise ConfigError("its rows do not differ", where=where, hint="vary a key in `every:` or in a table")
    by_place: dict[tuple[Any, ...], Row] = {}
    for row, document in zip(rows, documents, strict=True):
        place = tuple(document.get(axis.key) for axis in axes)
        if place in by_place:
            raise ConfigError(f"the rows {by_place[place].name} and {row.name} are the same", where=where)
        by_place[place] = row
    wanted = list(product(*(axis.values for axis in axes)))
    missing = [place for place in wanted if place not in by_place]
    if missing:
        named = "; ".join(_described(axes, place) for place in islice(missing, _NAMED))
        hint = "`every:` makes all combinations"
        raise ConfigError(f"{len(missing)} of {len(wanted)} combinations are missing: {named}", where=where, hint=hint)
    return Grid(tuple(axes), tuple(by_place[place] for place in wanted))


def _leaves(data: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the dotted key and the value of whatever a document says, lists as they are written."""
    for key, value in data.items():
        if prefix == "" and key not in _SECTIONS:
            continue
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value if isinstance(value, str | int | float | None) else repr(value)


def _axis(key: str, values: Sequence[Any]) -> Axis:
    found = tuple(dict.fromkeys(values))
    slides = all(isinstance(value, int | float) and not isinstance(value, bool) for value in found)
    return Axis(key, tuple(sorted(found)) if slides else found, slides)


def _described(axes: Sequence[Axis], place: Sequence[Any]) -> str:
    return ", ".join(f"{axis.key.rpartition('.')[2]} {word(value)}" for axis, value in zip(axes, place, strict=True))


def word(value: Any) -> str:
    """Return a value for people: of a path, the last part without its suffix."""
    return Path(value).stem if isinstance(value, str) and "/" in value else str(value)
