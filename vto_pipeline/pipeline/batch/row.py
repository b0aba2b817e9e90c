"""One row of a batch: a process of its own, within limits of memory and time, tried again where it crashed."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import tempfile
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import vto_pipeline
from vto_pipeline.pipeline.execution.folder import wait_until_free

_LOOK = 0.2  # s between looks at a row's memory
_LIST = 1.0  # s between looks for its processes: all of the machine are asked, which would take a share of a core
_SIGTERM_SECONDS = 5.0  # for a row to end by itself
_PACKAGE = str(Path(vto_pipeline.__file__).parents[1])  # rows run the code of their worker


@dataclass(frozen=True)
class RowTask:
    """What a worker is to do for one row; plain values, so that it travels to another machine.

    Args:
        name: Of the row.
        key: Of its result.
        command: Program and arguments; it prints one JSON document.
        folder: RUN. A process of an earlier batch that still works there is waited for, as long as a row may take.
        log: File for what it says.
        threads: Of the numerical code.
        seconds: Limit of wall time [s].
        memory_mb: Limit of resident memory, of all its processes together [MB].
        retries: How often a row that crashed is tried again.
    """

    name: str
    key: str
    command: tuple[str, ...]
    folder: str
    log: str
    threads: int
    seconds: float
    memory_mb: float
    retries: int


@dataclass(frozen=True)
class RowResult:
    """What became of a row.

    Args:
        name, key: Of its task.
        status: "done", "refused" (bad input or document), "failed", "cancelled", "crashed", "too long", "too large", or
            "lost" with its worker.
        exit_code: Of its process; negative for a signal.
        seconds, peak_mb: Wall time of the last try [s], and largest resident memory seen [MB].
        tries: How many there were.
        problem: The error in words, empty where it is done.
    """

    name: str
    key: str
    status: str
    exit_code: int
    seconds: float
    peak_mb: float
    tries: int
    problem: str = ""


_STATUS = {0: "done", 2: "refused", 3: "refused", 4: "failed", 5: "refused", 130: "cancelled"}


def run_row(task: RowTask) -> RowResult:
    """Run a row to its end, or to its limits.

    Args:
        task: What to do.

    Returns:
        What became of it; never an exception for what the row itself does.
    """
    tries = 0
    wait_until_free(Path(task.folder), task.seconds)
    while True:
        tries += 1
        result = _try(task, tries)
        if result.status != "crashed" or tries > task.retries:
            return result


def _try(task: RowTask, tries: int) -> RowResult:
    threads, path = str(task.threads), filter(None, (_PACKAGE, os.environ.get("PYTHONPATH")))
    environment = {"NUMBA_NUM_THREADS": threads, "OMP_NUM_THREADS": threads, "PYTHONPATH": os.pathsep.join(path)}
    began, peak, stopped = time.monotonic(), 0.0, ""
    Path(task.log).parent.mkdir(parents=True, exist_ok=True)
    with open(task.log, "ab") as log, tempfile.TemporaryFile() as answer:
        process = subprocess.Popen(
            [*_dies_with_its_parent(), *task.command],
            stdin=subprocess.DEVNULL,
            stdout=answer,
            stderr=log,
            env={**os.environ, **environment},
            start_new_session=True,
        )
        group = _Group(process.pid)
        try:
            while not _has_ended(process, _LOOK):
                now = group.resident_mb()
                if now > task.memory_mb:  # a program that is just being started counts as a copy of who starts it
                    now = min(now, group.resident_mb())
                peak = max(peak, now)
                if peak > task.memory_mb:
                    stopped = "too large"
                elif time.monotonic() - began > task.seconds:
                    stopped = "too long"
                if stopped:
                    break
        finally:
            _end(process)
        seconds = round(time.monotonic() - began, 2)
        code = process.wait()
        status = stopped or _STATUS.get(code, "crashed")
        return RowResult(
            task.name, task.key, status, code, seconds, round(peak, 1), tries, _problem(task, status, code, answer)
        )


def _dies_with_its_parent() -> tuple[str, ...]:
    """Return the command that ends a process with the worker that started it, where there is one (util-linux)."""
    return ("setpriv", "--pdeathsig", "KILL") if shutil.which("setpriv") else ()


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a process and all that it has started."""
    for name, seconds in ((signal.SIGTERM, _SIGTERM_SECONDS), (signal.SIGKILL, None)):
        if process.poll() is not None:
            break
        with suppress(ProcessLookupError):
            os.killpg(process.pid, name)
        _has_ended(process, seconds)
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)  # what it has left behind


def _has_ended(process: subprocess.Popen[bytes], seconds: float | None) -> bool:
    """Wait for a process, at most so long [s]; return whether it has ended."""
    with suppress(subprocess.TimeoutExpired):
        process.wait(seconds)
    return process.returncode is not None


class _Group:
    """The processes of a process group.

    Args:
        number: Of the group.
    """

    def __init__(self, number: int) -> None:
        self._number = number
        self._listed, self._found = -_LIST, list[Path]()

    def resident_mb(self) -> float:
        """Return their resident memory [MB]; 0 where the system does not tell."""
        if time.monotonic() - self._listed >= _LIST:
            self._found = [folder for folder in Path("/proc").glob("[0-9]*") if self._pages(folder) is not None]
            self._listed = time.monotonic()
        pages = sum(self._pages(folder) or 0 for folder in self._found)
        return pages * os.sysconf("SC_PAGE_SIZE") / 1e6

    def _pages(self, process: Path) -> int | None:
        """Return how many pages of memory a process holds; None where it is not of the group, or has ended."""
        with suppress(OSError, IndexError, ValueError):
            fields = (process / "stat").read_text().rpartition(")")[2].split()
            if int(fields[2]) == self._number:
                return int(fields[21])
        return None


def _problem(task: RowTask, status: str, code: int, answer: IO[bytes]) -> str:
    if status == "done":
        return ""
    if status == "cancelled":
        return "it was cancelled"
    if status == "too large":
        return f"it needs more than {task.memory_mb:.0f} MB of memory"
    if status == "too long":
        return f"it takes longer than {task.seconds:.0f} s"
    answer.seek(0)
    with suppress(ValueError, KeyError, TypeError):
        said: Any = json.loads(answer.read())["error"]
        return f"{said['problem']} ({said['where']})" if said["where"] else str(said["problem"])
    return f"it crashed (signal {-code})" if code < 0 else f"it ended with exit code {code}; see its log"
