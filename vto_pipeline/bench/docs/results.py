"""Measured figures for pages, looked up in results files and recorded with their source."""

from __future__ import annotations

import fnmatch
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from vto_pipeline.bench.bench import Row, Value
from vto_pipeline.errors import InputError
from vto_pipeline.io.documents import read_json

_CHOSEN = ("scene", "method", "vertices", "threads")
_PLAIN_FROM, _PLAIN_TO = 1e-3, 1e5
"""Sizes between which a figure is written without an exponent."""


@dataclass(frozen=True)
class Quoted:
    """A figure that stands on a page.

    Args:
        text: As it is written there.
        what: The rows and the name of the figure.
        source: The results file.
        version: Day and commit of the code that it is a figure of.
        command: What measures it again.
    """

    text: str
    what: str
    source: str
    version: str
    command: str


@dataclass(frozen=True)
class Results:
    """The results files of a folder, and what was quoted from them.

    Args:
        folder: Where NAME.json are, as a bench or `python -m vto_pipeline.bench` writes them.
        quoted: Filled as figures are written.
    """

    folder: Path
    quoted: list[Quoted] = field(default_factory=list)
    _documents: dict[str, Mapping[str, Any]] = field(default_factory=dict)

    def names(self, pattern: str) -> list[str]:
        """Return the names of the results files that match, sorted; maybe none."""
        return sorted(path.stem for path in self.folder.glob(f"{pattern}.json"))

    def document(self, name: str) -> Mapping[str, Any]:
        """Return a results file.

        Raises:
            InputError: there is none of that name, or it does not say where it comes from.
        """
        if name not in self._documents:
            found = read_json(self.folder / f"{name}.json")
            missing = [key for key in ("command", "commit", "date", "machine", "rows", "fronts") if key not in found]
            if missing:
                raise InputError(f"results without {', '.join(missing)}", where=str(self.folder / f"{name}.json"))
            self._documents[name] = found
        return self._documents[name]

    def fronts(self, name: str) -> list[Mapping[str, Any]]:
        """Return where a bench's default stands against its fronts, see `report_card.fronts`; maybe nowhere."""
        found = self.document(name)["fronts"]
        return [self._noted(name, entry) for entry in found] if isinstance(found, list) else []

    def no_fronts(self) -> Iterator[tuple[str, str]]:
        """Yield the results files without fronts, and why."""
        for name in self.names("*"):
            if isinstance(why := self.document(name)["fronts"], str):
                yield name, why

    def _noted(self, name: str, entry: Mapping[str, Any]) -> Mapping[str, Any]:
        what = f"{entry['scene']}: the default against the front of {entry['error']}"
        self.note(name, what, entry["verdict"])
        return entry

    def note(self, name: str, what: str, text: str) -> None:
        """Record what is quoted from a results file."""
        document = self.document(name)
        version = f"{document['date']}, `{document['commit']}`"
        self.quoted.append(Quoted(text, what, f"{name}.json", version, str(document["command"])))

    def rows(self, name: str, **wanted: Value) -> Selection:
        """Return the rows that match.

        Args:
            name: The results file.
            wanted: scene, method, vertices, threads, or a setting; text may have the wildcards of `fnmatch`.

        Raises:
            InputError: no row matches.
        """
        rows = [Row.from_json(plain) for plain in self.document(name)["rows"]]
        found = [row for row in rows if all(_matches(row, key, value) for key, value in wanted.items())]
        if not found:
            asked = ", ".join(f"{key}={value!r}" for key, value in wanted.items())
            raise InputError(f"no row with {asked}", where=str(self.folder / f"{name}.json"))
        return Selection(self, name, found)

    def figure(
        self,
        name: str,
        key: str,
        *,
        places: int | None = None,
        significant: int = 2,
        scale: float = 1.0,
        **wanted: Value,
    ) -> str:
        """Return one figure of the one row that matches; see `Selection.figure`.

        Raises:
            InputError: no row matches, or several do.
        """
        return self.rows(name, **wanted).figure(key, places=places, significant=significant, scale=scale)

    def source(self, name: str) -> str:
        """Return the command, the day, the commit and the machine, and whether that was busy, in two sentences."""
        document = self.document(name)
        machine = document["machine"]
        load = machine.get("load_at_start") or 0.0
        beside = f" Other work ran beside it (load {load:.0f}), so it took longer." if load > machine["cores"] else ""
        what = f"`{document['command']}` on {document['date']}, commit `{document['commit']}`"
        where = f"{machine['cpu']}, {machine['threads']} of {machine['cores']} cores, {machine['memory_gb']:.0f} GB"
        return f"Measured with {what}: {where}.{beside}"


@dataclass(frozen=True)
class Selection:
    """Some rows of a results file.

    Args:
        results: Where figures are noted down.
        name: The results file.
        found: The rows; at least one.
    """

    results: Results
    name: str
    found: Sequence[Row]

    def __iter__(self) -> Iterator[Selection]:
        """Go through the rows, one at a time."""
        return (Selection(self.results, self.name, [row]) for row in self.found)

    def having(self, key: str) -> Selection:
        """Return those that have an error of this name.

        Raises:
            InputError: none has.
        """
        found = [row for row in self.found if key in row.errors]
        if not found:
            raise InputError(f"no row has {key}", where=f"{self.name}.json")
        return Selection(self.results, self.name, found)

    def has(self, key: str) -> bool:
        """Return whether the one row has an error of this name."""
        return key in self._only().errors

    @property
    def scene(self) -> str:
        """Of the one row."""
        return self._only().scene

    @property
    def method(self) -> str:
        """Of the one row."""
        return self._only().method

    @property
    def settings(self) -> Mapping[str, Value]:
        """Of the one row."""
        return self._only().settings

    def figure(self, key: str, *, places: int | None = None, significant: int = 2, scale: float = 1.0) -> str:
        """Return a figure of the one row, written out.

        Args:
            key: seconds, runs, compile_s, vertices, threads, or the name of an error.
            places: Decimal places; in their absence `significant` counts.
            significant: Significant digits.
            scale: What it is multiplied with: 100 for a share in percent.

        Raises:
            InputError: there are several rows, or no such figure.
        """
        return self._note(key, _written(_value(self._only(), key), places, significant, scale))

    def least(self, key: str, **form: Any) -> str:
        """Return the smallest of the rows' figures."""
        return self._over(min, "least", key, **form)

    def most(self, key: str, **form: Any) -> str:
        """Return the largest of the rows' figures."""
        return self._over(max, "most", key, **form)

    def total(self, key: str, **form: Any) -> str:
        """Return the sum."""
        return self._over(sum, "total", key, **form)

    def count(self, key: str = "", value: Value = None) -> str:
        """Return how many rows there are, or how many of them have this value of a figure."""
        if not key:
            return self._note("rows", str(len(self.found)))
        return self._note(f"{key} = {value}", str(sum(_value(row, key) == value for row in self.found)))

    def _over(self, of: Callable[[Iterable[float]], float], how: str, key: str, **form: Any) -> str:
        values = [_number(_value(row, key), key) for row in self.found]
        return self._note(f"{how} {key}", _written(of(values), **form))

    def _only(self) -> Row:
        if len(self.found) != 1:
            scenes = "; ".join(f"{row.scene}, {row.method}, {dict(row.settings)}" for row in self.found[:4])
            raise InputError(f"{len(self.found)} rows where one was expected: {scenes}", where=self.name)
        return self.found[0]

    def _what(self) -> str:
        chosen = [f"{row.scene}, {row.method}" for row in self.found]
        return chosen[0] if len(chosen) == 1 else f"{len(chosen)} rows, {chosen[0]} ..."

    def _note(self, key: str, text: str) -> str:
        self.results.note(self.name, f"{self._what()}: {key}", text)
        return text


def _matches(row: Row, key: str, wanted: Value) -> bool:
    value = getattr(row, key) if key in _CHOSEN else row.settings.get(key)
    if isinstance(wanted, str) and isinstance(value, str):
        return fnmatch.fnmatchcase(value, wanted)
    return value == wanted


def _value(row: Row, key: str) -> Value:
    if key in ("seconds", "runs", "compile_s", "vertices", "threads"):
        found: Value = getattr(row, key)
        return found
    if key not in row.errors:
        raise InputError(f"no figure {key}; there are {', '.join(row.errors)}", where=f"{row.scene}, {row.method}")
    return row.errors[key]


def _number(value: Value, key: str) -> float:
    if isinstance(value, int | float):
        return float(value)
    raise InputError(f"{key} is {value!r}, which is not a number")


def _written(value: Value, places: int | None = None, significant: int = 2, scale: float = 1.0) -> str:
    """Return a figure as a page has it: 1,204; 0.62; 1.7e-5; yes; not reached."""
    if value is None or isinstance(value, bool):
        return {None: "-", True: "yes", False: "no"}[value]
    if isinstance(value, str):
        return value
    number = scale * value
    if isinstance(value, int) and scale == 1.0:
        return f"{value:,}"
    if places is not None:
        return f"{round(number, places) or 0.0:,.{places}f}"  # never "-0.0"
    if number == 0.0 or not math.isfinite(number):
        return "0" if number == 0.0 else str(number)
    if not _PLAIN_FROM <= abs(number) < _PLAIN_TO:
        mantissa, exponent = f"{number:.{significant - 1}e}".split("e")
        return f"{mantissa}e{int(exponent)}"
    return f"{number:,.{max(0, significant - 1 - math.floor(math.log10(abs(number))))}f}"
