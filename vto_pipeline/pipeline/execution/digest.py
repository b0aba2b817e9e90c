"""Content digests: of files, folders, values in a document, and the package's own source."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import vto_pipeline
from vto_pipeline.errors import InputError
from vto_pipeline.io.companions import companions
from vto_pipeline.io.stalls import Beat, answered
from vto_pipeline.pipeline.given import Given

SOURCE = {".py", ".yaml", ".html", ".js", ".css", ".csv", ".npz"}
"""Endings of the files of the package that decide what it computes."""


def digest_file(path: Path, beat: Beat = lambda: None) -> str:
    """SHA-256 of a file's bytes, in hex; `beat` is called for each block."""
    state = hashlib.sha256()
    with path.open("rb") as stream:
        while block := stream.read(1 << 20):
            state.update(block)
            beat()
    return state.hexdigest()


def digest_path(path: Path) -> str:
    """Digest of a file (its type and bytes, and those of files read with it) or a folder (of its visible files).

    Raises:
        InputError: a file is there no longer, or its folder does not answer.
    """
    try:
        return answered(path, lambda beat: _digest_path(path, beat))
    except FileNotFoundError as error:
        raise InputError("the file was there before and has vanished", where=str(error.filename)) from None


def _digest_path(path: Path, beat: Beat) -> str:
    if not path.is_dir():
        beside = {name: digest_file(file, beat) for name, file in companions(path).items()}
        return digest_value([path.suffix.lower(), digest_file(path, beat), *([beside] if beside else [])])
    digests = {}
    for file in path.rglob("*"):
        name = file.relative_to(path)
        if file.is_file() and not _hidden(name):
            digests[name.as_posix()] = digest_file(file, beat)
        beat()
    return digest_value(digests)


OfPath = Callable[[Path], str]
"""Digest of a file's or folder's content; `cache(digest_path)` for many rows that share files."""


def digest_value(value: Any, of_path: OfPath = digest_path) -> str:
    """Digest of plain data; a path inside it counts by its content, not its name."""
    text = json.dumps(_without_paths(value, of_path), sort_keys=True, ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()


def digest_given(one: Given, of_path: OfPath = digest_path) -> str:
    """Digest of what was given: the content of a file or folder, or the value in the document."""
    return of_path(one.source) if isinstance(one.source, Path) else digest_value(one.source, of_path)


@cache
def code_identity() -> str:
    """The package's version; in a development checkout a digest of its source, so that every edit counts."""
    package = Path(vto_pipeline.__file__).parent
    if not (package.parent / "pyproject.toml").is_file():
        return vto_pipeline.__version__
    files = sorted(p for p in package.rglob("*") if p.suffix in SOURCE)
    return digest_value({p.relative_to(package).as_posix(): digest_file(p) for p in files})


def _hidden(name: Path) -> bool:
    return any(part.startswith(".") for part in name.parts)


def _without_paths(value: Any, of_path: OfPath) -> Any:
    if isinstance(value, Path):
        return {"content": of_path(value)}
    if isinstance(value, Mapping):
        return {str(key): _without_paths(item, of_path) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_without_paths(item, of_path) for item in value]
    return value
