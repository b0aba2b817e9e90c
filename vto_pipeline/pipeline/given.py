"""Inputs from the user: files, folders, and small values in the document itself."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from vto_pipeline.errors import ConfigError, InputError, VtoError
from vto_pipeline.io.documents import Document
from vto_pipeline.io.files import resolved
from vto_pipeline.io.stalls import check_answers
from vto_pipeline.io.stores import is_address
from vto_pipeline.model.artifact import ArtifactKind
from vto_pipeline.model.job import Job
from vto_pipeline.pipeline.catalogue import Catalogue

_FILE = re.compile(r"\S*[/\\]\S*|\S+\.[A-Za-z]\w{0,4}")


@dataclass(frozen=True)
class Given:
    """One thing that was given.

    Args:
        key: As written in the document, such as "garment.photos".
        source: A path, or the value written in the document: a word or a mapping whose paths are resolved.
        read: Job -> value; reads the source once, and tells the first job what it had to guess or repair.
    """

    key: str
    source: Path | str | Mapping[str, Any]
    read: Callable[[Job], Any]

    @property
    def paths(self) -> list[Path]:
        """The files and folders it consists of."""
        return _paths(self.source)


def find_given(data: Mapping[str, Any], document: Document, base: Path, catalogue: Catalogue) -> dict[str, Given]:
    """Resolve the section `given` of a checked document.

    Args:
        data: The section.
        document: For the lines in messages.
        base: Folder that relative paths start from.
        catalogue: The tables.

    Returns:
        Artifact -> what was given for it.

    Raises:
        ConfigError: a value stands where only a path will do.
        InputError: a file does not exist, its folder does not answer, or a value in the document is not what it should
            be.
    """
    found: dict[str, Given] = {}
    for key, artifact in catalogue.given.items():
        parts = tuple(key.split("."))
        value: Any = data
        for part in parts:
            value = value.get(part) if isinstance(value, Mapping) else None
        if value is None:
            continue
        where = document.where(("given", *parts))
        if artifact in found:
            raise ConfigError(f"given.{key} and given.{found[artifact].key} are the same; keep one", where=where)
        found[artifact] = resolve(key, value, base, catalogue.kind(artifact), where)
    return found


def resolve(key: str, value: Any, base: Path, kind: ArtifactKind, where: str) -> Given:
    """Resolve one key of `given`.

    Raises:
        ConfigError, InputError: as `find_given`.
    """
    if isinstance(value, str):
        if is_address(value):
            hint = "`vto batch` copies from stores; elsewhere give files and folders"
            raise InputError(f"given.{key}: {value} lies in a store, not on a disk", where=where, hint=hint)
        value = str((kind.stands_for and kind.stands_for(value)) or value)
        check_answers(base / Path(value).expanduser())
        path = resolved(base / Path(value).expanduser())
        if path.is_dir() and not (kind.in_folder and kind.in_folder(path)):
            wanted = "a file was wanted" if kind.in_folder is None else f"it does not hold {kind.about}"
            raise InputError(f"given.{key}: {path} is a folder; {wanted}", where=where)
        if path.exists():
            return Given(key, path, _once(lambda job: kind.receive(path, job) if kind.receive else kind.read(path)))
        if kind.inline is None or _FILE.fullmatch(value):
            raise _missing(key, path, where)
    elif kind.inline is None:
        raise ConfigError(f"given.{key}: takes the path of a file or folder (got {value!r})", where=where)
    given = Given(key, _resolve_inside(key, value, base, where), _once(lambda _: _parse(kind, given.source, where)))
    if not given.paths:
        given.read(Job())  # at once: a misspelt preset is to stop the run before it starts
    return given


def _parse(kind: ArtifactKind, source: Any, where: str) -> Any:
    """A value written in the document."""
    if kind.inline is None:
        raise TypeError(f"{kind.name} has no inline form")
    try:
        return kind.inline(source)
    except VtoError as error:
        if not _paths(source):
            error.where = where  # no file to blame
        raise


def _once(read: Callable[[Job], Any]) -> Callable[[Job], Any]:
    """Return the reader with its result cached."""
    kept: list[Any] = []

    def remembering(job: Job) -> Any:
        if not kept:
            kept.append(read(job))
        return kept[0]

    return remembering


def _resolve_inside(key: str, value: Any, base: Path, where: str) -> Any:
    """Return the value with every string that names a file turned into a path."""
    if isinstance(value, Mapping):
        return {name: _resolve_inside(f"{key}.{name}", item, base, where) for name, item in value.items()}
    if isinstance(value, str):
        path = base / Path(value).expanduser()
        check_answers(path)
        if path.is_file():
            return resolved(path)
        if _FILE.fullmatch(value):
            raise _missing(key, path, where)
    return value


def _missing(key: str, path: Path, where: str) -> InputError:
    hint = f"the folder {path.parent} does not exist either; relative paths start from the document's own folder"
    if path.parent.is_dir():
        close = get_close_matches(path.name, [entry.name for entry in path.parent.iterdir()], n=1)
        hint = f"did you mean {path.parent / close[0]}?" if close else ""
    return InputError(f"given.{key}: no such file or folder: {path}", where=where, hint=hint)


def _paths(source: Any) -> list[Path]:
    if isinstance(source, Path):
        return [source]
    if isinstance(source, Mapping):
        return [path for item in source.values() for path in _paths(item)]
    return []
