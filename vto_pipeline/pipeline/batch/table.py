"""The table of a batch: CSV as any spreadsheet saves it, YAML, or Parquet."""

from __future__ import annotations

import csv
import io
import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from vto_pipeline.errors import ConfigError, MissingDependencyError
from vto_pipeline.io.documents import load_yaml
from vto_pipeline.io.files import check_file
from vto_pipeline.pipeline.request import number_or_word

_BYTES = 100_000_000
_SEPARATORS = re.compile(r"[,;\t]")
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+")


def read_table(path: Path) -> Iterator[tuple[dict[str, Any], str]]:
    """Yield the rows of a table and where each stands; empty cells change nothing.

    Args:
        path: .csv with a head, .yaml with a list of mappings, or .parquet.

    Raises:
        ConfigError: not such a table; with file and row.
        MissingDependencyError: Parquet, and no library for it.
    """
    path = check_file(path, {".csv", ".yaml", ".yml", ".parquet"}, _BYTES, error=ConfigError)
    rows: Iterator[tuple[int, dict[str, Any]]]
    if path.suffix.lower() == ".csv":
        rows = _csv_rows(path)
    elif path.suffix.lower() == ".parquet":
        rows = enumerate(_parquet_rows(path), start=1)
    else:
        data = load_yaml(path).data
        if not isinstance(data, list) or not all(isinstance(row, dict) for row in data):
            raise ConfigError("a table in YAML is a list of mappings", where=str(path))
        rows = enumerate(data, start=1)
    for number, row in rows:
        yield {str(key): value for key, value in row.items() if value not in (None, "")}, f"{path}, row {number}"


def _csv_rows(path: Path) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yield the rows of a CSV file with a head, and their numbers in a spreadsheet; what is blank there is no row.

    Spreadsheets part cells by commas, semicolons or tabs, as their language has it. The head tells which, since no key
    holds one of them. A cell is a number, true, false, or a word; a name is a word. Spaces around a cell do not count.
    """
    try:
        text = _text(path)
        separator = (_SEPARATORS.findall(text.partition("\n")[0]) or [","])[0]
        lines = csv.reader(io.StringIO(text, newline=""), strict=True, delimiter=separator)
        head, *rows = [[cell.strip() for cell in row] for row in lines] or [[]]
    except (csv.Error, UnicodeDecodeError) as e:
        hint = "spreadsheets call it CSV UTF-8 where they save"
        raise ConfigError(f"not a CSV table in UTF-8: {e}", where=str(path), hint=hint) from None
    twice = [key for key, times in Counter(head).items() if times > 1 and key]
    if twice:
        raise ConfigError(f"the column {twice[0]!r} is there {head.count(twice[0])} times", where=f"{path}, row 1")
    for number, row in enumerate(rows, start=2):
        if any(row[len(head) :]):
            raise ConfigError("a row has more cells than the head", where=f"{path}, row {number}")
        cells = [(key, cell) for key, cell in zip(head, row, strict=False) if cell]
        if cells:
            yield number, {key: cell if key == "name" else _value(cell, separator) for key, cell in cells}


def _text(path: Path) -> str:
    """Return what a file says: UTF-8, or UTF-16 with the mark that spreadsheets write before it."""
    data = path.read_bytes()
    return data.decode("utf-16" if data.startswith((BOM_UTF16_LE, BOM_UTF16_BE)) else "utf-8-sig")


def _value(cell: str, separator: str) -> Any:
    """Return what a cell says; where no comma parts cells, one within a number stands before its decimals."""
    if separator != "," and _DECIMAL_COMMA.fullmatch(cell):
        return float(cell.replace(",", "."))
    return number_or_word(cell)


def _parquet_rows(path: Path) -> list[dict[str, Any]]:
    try:
        from pyarrow import ArrowException, parquet
    except ImportError:
        hint = "pip install pyarrow, or save the table as CSV"
        raise MissingDependencyError("a Parquet table needs pyarrow", where=str(path), hint=hint) from None
    try:
        return list(parquet.read_table(path).to_pylist())
    except (ArrowException, OSError) as e:
        raise ConfigError(f"not a Parquet table: {e}", where=str(path)) from None
