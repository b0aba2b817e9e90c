"""One `vto` command in a process of its own, with a time limit: what crashes or hangs costs no other."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

_PROGRAM = "import sys; from vto_pipeline.cli.main import main; sys.exit(main())"
_OUTCOMES = {0: "done", 1: "crashed", 2: "refused", 3: "refused", 4: "failed", 5: "refused"}
_LOOK = 0.1
"""Time between two looks at whether it has ended [s]."""


def last_error(log: Path) -> str:
    """Return what a command said last of what stopped it; nothing if it did not."""
    said = [line for line in log.read_text(errors="replace").splitlines() if line.startswith("error: ")]
    return said[-1].removeprefix("error: ") if said else ""


class Ended(NamedTuple):
    """How a command ended.

    Args:
        code: Its exit code; None when it ran out of time, negative when a signal ended it.
        seconds: Wall time [s].
        cpu_seconds: Of it and all that it started and waited for [s].
        peak_mb: Largest memory of it or of one of its children [MB].
    """

    code: int | None
    seconds: float
    cpu_seconds: float
    peak_mb: float

    @property
    def outcome(self) -> str:
        """What became of it, in a word."""
        return "unfinished" if self.code is None else _OUTCOMES.get(self.code, "killed")


def run_vto(arguments: Sequence[str], log: Path, limit: float) -> Ended:
    """Run `vto` with these arguments.

    Args:
        arguments: After `vto`.
        log: File for what it prints.
        limit: Wall time after which it is ended, with all that it has started [s].
    """
    began = time.perf_counter()
    log.parent.mkdir(parents=True, exist_ok=True)
    with log.open("wb") as said:
        process = subprocess.Popen(
            [sys.executable, "-c", _PROGRAM, *arguments], stdout=said, stderr=said, start_new_session=True
        )
        late = False
        while not (ended := os.wait4(process.pid, os.WNOHANG))[0]:  # which alone tells the memory of this one child
            if not late and time.perf_counter() - began > limit:
                late = True
                os.killpg(process.pid, signal.SIGKILL)
            time.sleep(_LOOK)
    _, status, usage = ended
    process.returncode = code = os.waitstatus_to_exitcode(status)
    spent, busy = time.perf_counter() - began, usage.ru_utime + usage.ru_stime
    return Ended(None if late else code, spent, busy, usage.ru_maxrss / 1000)
