"""Result sheets of fabric-testing instruments, with the instrument's own names and units.

YAML:                                        or CSV:
    instrument: KES-FB                           instrument, KES-FB
    name: wool tropical                          name, wool tropical
    W: 16.29                                     parameter, warp, weft
    B: {warp: 0.071, weft: 0.063}                W, 16.29
    G [cN/(cm·deg)]: 0.62                        B, 0.071, 0.063

A unit in brackets replaces the instrument's own; one value stands for both directions. With a semicolon in its first
line, a CSV file has semicolons between its columns and decimal commas.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.documents import Document, Keys, suggest
from vto_pipeline.io.files import check_file
from vto_pipeline.io.text_numbers import read_lines

_KEY = re.compile(r"\s*([^\[\]]+?)\s*(?:\[([^\[\]]*)\]\s*)?")
_DIRECTIONS = ("warp", "weft")
_CSV_BYTES = 100_000
_SAME_UNIT = str.maketrans({"²": "2", "·": "", ".": "", "*": "", " ": "", "µ": "u", "μ": "u", "°": "deg"})


@dataclass(frozen=True)
class Parameter:
    """One line of a sheet.

    Args:
        about: For people.
        units: Unit -> factor to SI; the first is the instrument's own.
        low, high: What any cloth is within, in the instrument's own unit.
        directed: Whether warp and weft are measured apart.
    """

    about: str
    units: Mapping[str, float]
    low: float
    high: float
    directed: bool = True


@dataclass(frozen=True)
class FabricSheet:
    """A sheet read.

    Args:
        name, source: Its head.
        values: Parameter -> (warp, weft), in SI; equal where one value was given.
    """

    name: str
    source: str
    values: Mapping[str, tuple[float, float]]

    def mean(self, key: str) -> float | None:
        """The mean of both directions; None when it was not measured."""
        return sum(self.values[key]) / 2 if key in self.values else None

    def along(self, key: str, direction: int) -> float | None:
        """The value along the warp (0) or the weft (1); None when it was not measured."""
        return self.values[key][direction] if key in self.values else None


def read_sheet(document: Document, parameters: Mapping[str, Parameter]) -> FabricSheet:
    """Read a sheet's lines and convert them to SI.

    Raises:
        InputError: an unknown parameter or unit, a value that is not a number or that no cloth has, with the line.
    """
    head = {key: str(document.data.get(key, "")) for key in ("name", "source")}
    values: dict[str, tuple[float, float]] = {}
    for written, value in document.data.items():
        if written in ("instrument", "name", "source"):
            continue
        where = document.where((str(written),))
        match = _KEY.fullmatch(str(written))
        key, unit = match.groups() if match else (str(written), None)
        if key not in parameters:
            hint = suggest(key, [*parameters, *head])
            raise InputError(f"{key}: unknown parameter (got {value!r})", where=where, hint=hint)
        if key in values:
            raise InputError(f"{key}: given twice", where=where)
        values[key] = _to_si(key, unit, value, parameters[key], where)
    return FabricSheet(head["name"] or "fabric", head["source"], values)


def require(sheet: FabricSheet, key: str, parameters: Mapping[str, Parameter], path: Path) -> None:
    """Raise InputError if the sheet lacks an essential parameter."""
    if key not in sheet.values:
        unit = next(iter(parameters[key].units))
        raise InputError(f"{key}: missing ({parameters[key].about} [{unit}])", where=str(path))


def _to_si(key: str, unit: str | None, value: Any, parameter: Parameter, where: str) -> tuple[float, float]:
    own = next(iter(parameter.units))
    named = {_plain_unit(name): factor for name, factor in parameter.units.items()}
    plain = _plain_unit(own if unit is None else unit)
    if plain not in named:
        raise InputError(f"{key}: unit {unit!r}; expected one of {', '.join(parameter.units)}", where=where)
    if isinstance(value, Mapping):
        if not parameter.directed or set(value) != set(_DIRECTIONS):
            wanted = "warp and weft" if parameter.directed else "one number"
            raise InputError(f"{key}: expected {wanted} (got {', '.join(map(str, value)) or 'nothing'})", where=where)
        pair = [value[direction] for direction in _DIRECTIONS]
    else:
        pair = [value, value]
    converted = [_number(key, item, where) * named[plain] for item in pair]
    low, high = parameter.low * parameter.units[own], parameter.high * parameter.units[own]
    for item, si in zip(pair, converted, strict=True):
        if not low <= si <= high:
            allowed = f"{parameter.low:g} to {parameter.high:g} {own}".strip()
            raise InputError(f"{key}: {parameter.about} of {item} {unit or own}; expected {allowed}", where=where)
    return converted[0], converted[1]


def _number(key: str, value: Any, where: str) -> float:
    try:
        number = float("nan") if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = float("nan")
    if not isfinite(number):
        raise InputError(f"{key}: {str(value)[:40]!r} is not a number", where=where)
    return number


def _plain_unit(unit: str) -> str:
    return unit.replace("degree", "deg").translate(_SAME_UNIT)


def load_csv(path: Path) -> Document:
    """Read a CSV sheet into the same form as a YAML sheet.

    Raises:
        InputError: not such a file, with the line.
    """
    lines = read_lines(check_file(Path(path), {".csv"}, _CSV_BYTES)) or [""]
    lines[0] = lines[0].removeprefix("\ufeff")  # as spreadsheets write it
    european = ";" in lines[0]
    data: dict[str, Any] = {}
    at: dict[Keys, int] = {}
    for number, row in enumerate(_rows(lines, ";" if european else ",", path), start=1):
        cells = [cell.strip() for cell in row]
        while cells and not cells[-1]:
            cells.pop()
        if not cells or cells == ["parameter", *_DIRECTIONS]:
            continue
        key, *values = cells
        where = f"{path}, line {number}"
        if not key or not 1 <= len(values) <= 2 or "" in values:
            raise FormatError("expected a name and one value, or two: warp, weft", where=where)
        if key in data:
            raise FormatError(f"{key}: given twice (also in line {at[(key,)]})", where=where)
        if european and key not in ("instrument", "name", "source"):
            values = [value.replace(",", ".") for value in values]
        data[key] = values[0] if len(values) == 1 else dict(zip(_DIRECTIONS, values, strict=True))
        at[(key,)] = number
    return Document(data, path, at)


def _rows(lines: list[str], delimiter: str, path: Path) -> list[list[str]]:
    """The cells of each line; a quoted cell ends with its line."""
    try:
        return [next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), []) for line in lines]
    except csv.Error as e:
        raise FormatError(f"not a CSV file: {e}", where=str(path)) from None
