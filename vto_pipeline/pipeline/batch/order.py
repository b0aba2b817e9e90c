"""A batch document: one pipeline document, and a table of what each row changes in it."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

from pydantic import Field

from vto_pipeline.errors import ConfigError
from vto_pipeline.io.documents import Document, check_schema, load_yaml
from vto_pipeline.io.stalls import check_answers
from vto_pipeline.io.stores import is_address
from vto_pipeline.model.settings import Config
from vto_pipeline.pipeline.batch.roots import ANYWHERE, Roots
from vto_pipeline.pipeline.batch.table import read_table

_NAME = re.compile(r"[^\W_][\w.-]{0,99}")
_NAME_BYTES = 200  # a file system allows 255 in the name of a file, with its suffix
_SECTIONS = ("given", "stages", "choose", "seed", "want")
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
    if isinstance(document.data, dict) and "want" in document.data and "run" not in document.data:
        raise ConfigError(
            "a document of one run, not of a batch", where=str(path), hint="`vto run` and `vto plan` take it"
        )
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
        name = _text(change.pop("name", None)) or f"row_{number:0{len(str(len(changes)))}d}"
        if not _NAME.fullmatch(name) or len(name.encode()) > _NAME_BYTES:
            hint = "letters, digits, dots, dashes and underscores; a letter or digit first; 100 at most"
            raise ConfigError(f"{name!r} is not a valid name of a row", where=where, hint=hint)
        rows.append(Row(name, _absolute(_changed(whole, change, where), base), where, base))
    if not rows:
        raise ConfigError("the batch has no rows", where=str(path), hint="give rows: or every:")
    _check_names(rows)
    return rows


def _text(name: Any) -> str:
    """Return a name as text, composed: some systems write one letter as two characters."""
    return "" if name is None else unicodedata.normalize("NFC", str(name))


def _check_names(rows: Sequence[Row]) -> None:
    """Refuse a name that is there twice."""
    times = Counter(row.name for row in rows)
    for row in rows:
        if times[row.name] > 1:
            raise ConfigError(f"the name {row.name!r} is there {times[row.name]} times", where=row.where)


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
        table = list(read_table(base / batch.rows))
    else:
        given = batch.rows if batch.rows is not None else [{}] if batch.every else []
        table = [(dict(row), document.where(("rows", index))) for index, row in enumerate(given)]
    count = len(table) * prod(map(len, batch.every.values()))
    if count > _MOST_ROWS:
        raise ConfigError(f"{count} rows; the most is {_MOST_ROWS}", where=str(document.path))
    words = [_words(values) for values in batch.every.values()]
    for row, where in table:
        name = _text(row.get("name"))
        for values, parts in zip(product(*batch.every.values()), product(*words), strict=True):
            change = {**row, **dict(zip(batch.every, values, strict=True))}
            yield {**change, **({"name": "_".join([name, *parts])} if name else {})}, where


def _words(values: Sequence[Any]) -> list[str]:
    """Return values as parts of names: of a path its last part without suffix, or all of it."""
    texts = [_text(value) for value in values]
    words = [Path(text).stem if isinstance(value, str) else text for value, text in zip(values, texts, strict=True)]
    distinct = len(set(words)) == len(set(texts))
    return [re.sub(r"[^\w.-]+", "_", word).strip("_") for word in (words if distinct else texts)]


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
