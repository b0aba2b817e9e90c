"""Checks before a file is read, and atomic replacement when one is written."""

from __future__ import annotations

import atexit
import os
import tempfile
from collections.abc import Collection, Iterator
from contextlib import ExitStack, contextmanager
from difflib import get_close_matches
from pathlib import Path

from vto_pipeline.errors import ConfigError, FormatError, InputError, VtoError


def check_file(path: Path, suffixes: Collection[str], limit_bytes: int, *, error: type[VtoError] = InputError) -> Path:
    """Return the path if it is a non-empty file of an allowed type and size.

    Args:
        path: The file.
        suffixes: Allowed endings, lower case with the dot.
        limit_bytes: Largest size read.
        error: What to raise.

    Raises:
        VtoError: of the class `error`.
    """
    path = Path(path)
    if not path.exists():
        raise error("no such file", where=str(path), hint=_neighbour(path))
    if not path.is_file():
        raise error("expected a file, found something else", where=str(path))
    if path.suffix.lower() not in suffixes:
        allowed = ", ".join(sorted(suffixes))
        raise error(f"files of type {path.suffix or '(none)'} are not supported; expected {allowed}", where=str(path))
    size = path.stat().st_size
    if size == 0:
        raise error("the file is empty (0 bytes)", where=str(path))
    if size > limit_bytes:
        raise error(f"the file has {size} bytes; the limit is {limit_bytes}", where=str(path))
    return path


def check_folder(path: Path) -> Path:
    """Return the path if it is a folder.

    Raises:
        InputError: it is not.
    """
    path = Path(path)
    if not path.is_dir():
        problem = "expected a folder, found a file" if path.exists() else "no such folder"
        raise InputError(problem, where=str(path), hint=_neighbour(path))
    return path


def resolved(path: Path) -> Path:
    """Return the absolute path behind all links.

    Raises:
        InputError: links lead back to themselves, or the name is none that a file can have.
    """
    try:
        return Path(path).resolve()
    except (RuntimeError, ValueError) as e:
        raise InputError(f"not a path that can be opened: {e}", where=ascii(str(path))) from None


def check_inside(path: Path, roots: Collection[Path], where: str) -> None:
    """Refuse a file or folder that lies in none of some folders, or that links lead out of.

    Args:
        path: What is to be read; there need be nothing.
        roots: The folders.
        where: What names it, for the message.

    Raises:
        ConfigError: it does.
    """
    inside = [resolved(root) for root in roots]
    links = (entry for entry in path.rglob("*") if entry.is_symlink()) if path.is_dir() else ()
    for one in (path, *links):
        if not any(resolved(one).is_relative_to(root) for root in inside):
            named = ", ".join(map(str, inside)) or "what may be read"
            raise ConfigError(f"{one} lies outside {named}, or links lead there", where=where, hint="see --root")


def listed(folder: Path, suffixes: Collection[str]) -> tuple[Path, ...]:
    """The folder's visible files with one of the suffixes, sorted by name."""
    names = sorted(p.name for p in folder.iterdir() if p.suffix.lower() in suffixes and not p.name.startswith("."))
    return tuple(folder / name for name in names)


_PARTIAL = ".partial"
_FOLDERS = ExitStack()
atexit.register(_FOLDERS.close)


def process_folder() -> Path:
    """Return a new temporary folder that is removed when the process ends."""
    return Path(_FOLDERS.enter_context(tempfile.TemporaryDirectory(prefix="vto-")))


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path, renamed to `path` when the block succeeds: never half a file."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f".{path.stem}.{os.getpid()}{_PARTIAL}{path.suffix}")
    try:
        yield beside
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)


def remove_partial(folder: Path) -> None:
    """Remove what killed processes left of `replacing` in a folder that is locked."""
    for rest in folder.glob(f".*{_PARTIAL}*"):
        rest.unlink(missing_ok=True)


@contextmanager
def as_format_error(path: Path) -> Iterator[None]:
    """Turn whatever a library raises on a file into a FormatError."""
    try:
        yield
    except VtoError:
        raise
    except Exception as e:
        raise FormatError(f"{type(e).__name__}: {e}"[:200], where=str(path)) from e


def _neighbour(path: Path) -> str:
    """Name a similarly named file in the same folder, if there is one."""
    if not path.parent.is_dir():
        return f"the folder {path.parent} does not exist either"
    close = get_close_matches(path.name, [p.name for p in path.parent.iterdir()], n=1)
    return f"did you mean {close[0]}?" if close else ""
