"""A batch document: one pipeline document, and a table of what each row changes in it."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

from pydantic import Field

from vto_pipeline.errors import ConfigError, MissingDependencyError
from vto_pipeline.io.documents import Document, check_schema, load_yaml
from vto_pipeline.io.files import check_file
from vto_pipeline.io.stalls import check_answers
from vto_pipeline.io.stores import is_address
from vto_pipeline.model.settings import Config
from vto_pipeline.pipeline.batch.roots import ANYWHERE, Roots
from vto_pipeline.pipeline.request import number_or_word

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,99}")
_SECTIONS = ("given", "stages", "choose", "seed", "want")
_TABLE_BYTES = 100_000_000
_MOST_ROWS = 100_000


class BatchFile(Config):
    """batch.yaml."""

    version: int = Field(alias="schema", ge=1, le=1, description="Of the format")
    run: dict[str, Any] | str = Field(description="The pipeline document that each row changes, or its path")
    rows: list[dict[str, Any]] | str | None = Field(
        None,
        description="Changes by row, as a list, or the path of a CSV, YAML or Parquet table; keys such as given.fabric",
    )
    every: dict[str, list[Any]] = Field({}, description="Key -> values; every combination becomes a row")


@dataclass(frozen=True)
class Row:
    """One run of a batch.

    Args:
        name: Of its folder.
        data: Its pipeline document, with absolute paths.
        where: File and line it comes from, for messages.
        base: Folder that paths would start from of which there is nothing, for messages.
    """

    name: str
    data: Mapping[str, Any]
    where: str
    base: Path


def read_order(path: Path, roots: Roots = ANYWHERE) -> list[Row]:
    """Read a batch document and its table.

    Args:
        path: YAML; paths in it, in its pipeline document and in its table start from its own folder.
        roots: Where its pipeline document and its table must lie.

    Returns:
        The rows, in their order; `every` repeats each of them. Addresses in stores are as they were written.

    Raises:
        ConfigError: an unknown key, a name that is there twice, no row; with file and line.
        MissingDependencyError: a Parquet table, and no library for it.
    """
    document = load_yaml(path)
    batch: BatchFile = check_schema(document, BatchFile)
    base = path.resolve().parent
    for name in (batch.run, batch.rows):
        if isinstance(name, str):
            check_answers(base / name)
            roots.check_path(base / name, str(path))
    whole = _pipeline_document(batch.run, document, base)
    changes = list(_changes(batch, document, base))
    rows: list[Row] = []
    for number, (change, where) in enumerate(changes, start=1):
        name = str(change.pop("name", "") or f"row_{number:0{len(str(len(changes)))}d}")
        if not _NAME.fullmatch(name):
            hint = "letters, digits, dots, dashes and underscores; a letter or digit first; 100 at most"
            raise ConfigError(f"{name!r} is not a valid name of a row", where=where, hint=hint)
        rows.append(Row(name, _absolute(_changed(whole, change, where), base), where, base))
    if not rows:
        raise ConfigError("the batch has no rows", where=str(path), hint="give rows: or every:")
    times = Counter(row.name for row in rows)
    for row in rows:
        if times[row.name] > 1:
            raise ConfigError(f"the name {row.name!r} is there {times[row.name]} times", where=row.where)
    return rows


def _pipeline_document(run: dict[str, Any] | str, document: Document, base: Path) -> dict[str, Any]:
    """Return the pipeline document; paths in one of its own file start from that file's folder."""
    if isinstance(run, dict):
        return run
    path = base / run
    data = load_yaml(path).data
    if not isinstance(data, dict):
        raise ConfigError("a pipeline document is a mapping with schema, given and want", where=str(path))
    return _absolute(data, path.resolve().parent)


def _changes(batch: BatchFile, document: Document, base: Path) -> Iterator[tuple[dict[str, Any], str]]:
    """Yield the changes of each row, and where they are written."""
    if isinstance(batch.rows, str):
        table = list(_table(base / batch.rows))
    else:
        given = batch.rows if batch.rows is not None else [{}] if batch.every else []
        table = [(dict(row), document.where(("rows", index))) for index, row in enumerate(given)]
    count = len(table) * prod(map(len, batch.every.values()))
    if count > _MOST_ROWS:
        raise ConfigError(f"{count} rows; the most is {_MOST_ROWS}", where=str(document.path))
    for row, where in table:
        for values in product(*batch.every.values()):
            change = {**row, **dict(zip(batch.every, values, strict=True))}
            if row.get("name"):
                change["name"] = "_".join([str(row["name"]), *map(_word, values)])
            yield change, where


def _word(value: Any) -> str:
    """Return a value as part of a name: the last part of a path, without its suffix."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", Path(str(value)).stem)


def _table(path: Path) -> Iterator[tuple[dict[str, Any], str]]:
    """Yield the rows of a table and where each stands; empty cells change nothing."""
    path = check_file(path, {".csv", ".yaml", ".yml", ".parquet"}, _TABLE_BYTES, error=ConfigError)
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

    A cell is a number, true, false, or a word; a name is a word.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            head, *rows = list(csv.reader(stream, strict=True)) or [[]]
    except (csv.Error, UnicodeDecodeError) as e:
        raise ConfigError(f"not a CSV table in UTF-8: {e}", where=str(path)) from None
    twice = [key for key, times in Counter(head).items() if times > 1]
    if twice:
        raise ConfigError(f"the column {twice[0]!r} is there {head.count(twice[0])} times", where=f"{path}, row 1")
    for number, row in enumerate(rows, start=2):
        if len(row) > len(head):
            raise ConfigError("a row has more cells than the head", where=f"{path}, row {number}")
        if any(cell.strip() for cell in row):
            cells = dict(zip(head, row, strict=False))
            yield (
                number,
                {key: cell if key == "name" or not cell else number_or_word(cell) for key, cell in cells.items()},
            )


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


def _changed(document: Mapping[str, Any], change: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return a document with values put at keys such as `stages.drape.friction`; it shares what is as before."""
    changed = dict(document)
    for key, value in change.items():
        parts = key.split(".")
        if parts[0] not in _SECTIONS or not all(parts):
            hint = f"a column is `name` or a key that begins with {', '.join(_SECTIONS)}, as in given.fabric"
            raise ConfigError(f"{key!r} is not a key of a pipeline document", where=where, hint=hint)
        branch = changed
        for part in parts[:-1]:
            inner = branch.get(part, {})
            if not isinstance(inner, dict):
                raise ConfigError(f"{key}: {part} is not a mapping there", where=where)
            branch[part] = dict(inner)
            branch = branch[part]
        branch[parts[-1]] = value
    return changed


def _absolute(data: Mapping[str, Any], base: Path) -> dict[str, Any]:
    """Return a document whose given files and folders have absolute paths."""
    return {**data, "given": with_strings_changed(data.get("given", {}), lambda text: _path(text, base) or text)}


def strings_in(value: Any) -> Iterator[str]:
    """Yield every string that a document holds as a value."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping | Sequence):
        for item in value.values() if isinstance(value, Mapping) else value:
            yield from strings_in(item)


def with_strings_changed(value: Any, change: Callable[[str], str]) -> Any:
    """Return what a document holds with every string in it changed."""
    if isinstance(value, Mapping):
        return {key: with_strings_changed(item, change) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [with_strings_changed(item, change) for item in value]
    return change(value) if isinstance(value, str) else value


def _path(text: str, base: Path) -> str | None:
    """Return the absolute path of what is there under that name, or None."""
    if is_address(text):
        return None
    path = base / Path(text).expanduser()
    try:
        check_answers(path)
        return str(path.resolve()) if path.exists() else None
    except (OSError, ValueError, RuntimeError):
        return None
