"""A run's folder: locked by one run at a time, and never a folder with other content."""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from errno import EDQUOT, ENOSPC
from pathlib import Path
from socket import gethostname

from vto_pipeline.errors import ConfigError, InputError
from vto_pipeline.io.files import remove_partial

_LOCK = ".lock"
_LOOK = 0.2  # s between looks at a lock that another holds
RECORD = "run.json"
ROWS = "rows"
"""Of a batch's folder: the folders of its runs."""


def is_run(folder: Path) -> bool:
    """Whether a folder was made by a run."""
    return (folder / _LOCK).is_file() or (folder / RECORD).is_file()


@contextmanager
def locked_run_folder(folder: Path, inputs: Iterable[Path] = ()) -> Iterator[None]:
    """Create a run's folder if needed, and lock it.

    The lock is the operating system's, so that a killed run leaves none. What such a run was writing there is removed.

    Args:
        folder: RUN.
        inputs: Files that must not lie in it.

    Raises:
        ConfigError: it cannot be made or written to, holds other things or an input, or another run works in it.
    """
    try:
        _check(folder, inputs)
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / _LOCK).open("a+", encoding="utf-8")
    except OSError as error:
        raise ConfigError(
            f"the run's folder cannot be made or written to: {error.strerror}",
            where=str(folder),
            hint="give another folder with -o",
        ) from None
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.seek(0)
            raise ConfigError(
                f"another run is using this folder (process {lock.read().strip().replace(' ', ' on ') or 'unknown'})",
                where=str(folder),
                hint="wait for it to end, or give another folder with -o",
            ) from None
        try:
            os.ftruncate(lock.fileno(), 0)
            os.write(lock.fileno(), f"{os.getpid()} {gethostname()}".encode())
            remove_partial(folder)
            yield
        except OSError as error:
            if error.errno in (ENOSPC, EDQUOT) and error.filename is None:
                error.filename = str(folder)  # what fails to be written has a name, what it is written to has none
            raise


def wait_until_free(folder: Path, seconds: float) -> None:
    """Wait until no process works in a run's folder, or until the time [s] is over; free is what is not there."""
    until = time.monotonic() + seconds
    with suppress(OSError), (folder / _LOCK).open(encoding="utf-8") as lock:
        while time.monotonic() < until:
            try:
                fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                time.sleep(_LOOK)
            else:
                return


def process_in(folder: Path) -> int | None:
    """Return the process of this machine that works in a run's or a batch's folder, or None.

    Raises:
        InputError: the folder was made by neither.
        ConfigError: the process is on another machine.
    """
    try:
        found = holder_of(folder)
    except (FileNotFoundError, NotADirectoryError):
        raise InputError("not the folder of a run or of a batch", where=str(folder)) from None
    if not found:
        return None
    process, _, host = found.partition(" ")
    if host != gethostname():
        raise ConfigError(f"the run is on another machine, {host or 'unknown'}", where=str(folder), hint="go there")
    return int(process)


def holder_of(folder: Path) -> str:
    """Return what works in a run's or a batch's folder as "PROCESS HOST"; empty where nothing does.

    Raises:
        OSError: the folder has no lock.
    """
    with (folder / _LOCK).open(encoding="utf-8") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return lock.read().strip() or "unknown"
    return ""


def existing_run(folder: Path) -> Path:
    """The folder, if it was made by a run that got as far as writing its record.

    Raises:
        InputError: it was not.
    """
    if not (folder / RECORD).is_file():
        hint = f"it holds many: the runs of a batch lie in {folder / ROWS}" if (folder / ROWS).is_dir() else ""
        raise InputError("not a run folder: it has no run.json", where=str(folder), hint=hint)
    return folder


def _check(folder: Path, inputs: Iterable[Path]) -> None:
    if folder.exists() and not folder.is_dir():
        raise ConfigError("the run's folder is a file", where=str(folder), hint="give another folder with -o")
    if folder.is_dir() and any(folder.iterdir()) and not is_run(folder):
        raise ConfigError(
            "the folder is not empty and holds no run",
            where=str(folder),
            hint="nothing was written; give a new folder with -o",
        )
    for path in inputs:
        if path.resolve().is_relative_to(folder.resolve()):
            raise ConfigError(
                f"the input {path} lies in the run's own folder, where it could be overwritten",
                where=str(folder),
                hint="give another folder with -o",
            )
