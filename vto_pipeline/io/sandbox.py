"""Parse untrusted bytes in a child process with limits on time, memory and file size.

The child is a fresh interpreter, not a fork: it shares nothing with a parent that may hold threads and open files. It
answers with an .npz archive of plain arrays or a JSON error, never with a pickle, so that a parser taken over by a
hostile file cannot run code in the parent. A child that dies, for whatever reason, is one FormatError.
"""

from __future__ import annotations

import importlib
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from errno import ENOSPC
from pathlib import Path
from typing import Any

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.arrays import Arrays, read_arrays, write_arrays

SECONDS = 60.0
MEMORY_BYTES = 4 * 1024**3
_PATIENCE = 10.0  # wall time in units of the limit: on a busy machine, others have most of the processor
_FILE_BYTES = 4 * 1024**3
_REFUSED, _OUT_OF_MEMORY, _OUT_OF_SPACE = 3, 4, 5  # exit codes of the child


def run_limited(
    function: Callable[..., Mapping[str, Any]],
    *args: str | int | float | bool,
    where: str = "",
    seconds: float = SECONDS,
    memory_bytes: int = MEMORY_BYTES,
    file_bytes: int = _FILE_BYTES,
) -> Arrays:
    """Call a module-level function in a limited child process.

    Args:
        function: Importable by name; returns named arrays.
        *args: Plain JSON values.
        where: The file, for messages.
        seconds: Limit of processor time; ten times that, of wall time [s].
        memory_bytes: Limit of the address space.
        file_bytes: Limit of anything the child writes.

    Returns:
        What the function returned.

    Raises:
        InputError: what the function raised; FormatError: it crashed, or ran into a limit.
        OSError: no space is left for the answer.
    """
    with tempfile.TemporaryDirectory(prefix="vto-read-") as folder:
        task = {
            "module": function.__module__,
            "function": function.__qualname__,
            "args": args,
            "seconds": seconds,
            "memory_bytes": memory_bytes,
            "file_bytes": file_bytes,
        }
        command = [sys.executable, "-m", "vto_pipeline.io.sandbox", json.dumps(task)]
        with open(Path(folder) / "stderr", "w+b") as stderr:
            try:
                code = subprocess.run(
                    command,
                    cwd=folder,
                    env=_environment(),
                    stdin=subprocess.DEVNULL,
                    stdout=stderr,
                    stderr=stderr,
                    timeout=_PATIENCE * seconds + 5.0,  # the child's own limit speaks first
                    check=False,
                ).returncode
            except subprocess.TimeoutExpired:
                code = -signal.SIGALRM
            stderr.seek(0)
            last_words = stderr.read(1_000_000).decode(errors="replace").strip().splitlines()
        answer = Path(folder) / "answer.npz"
        if code == 0 and answer.exists():  # a library may end the process, and call it a success
            return read_arrays(answer)
        if code == _REFUSED:
            refusal = json.loads((Path(folder) / "refusal.json").read_text(encoding="utf-8"))
            kind = FormatError if refusal["format"] else InputError
            raise kind(refusal["problem"], where=refusal["where"] or where, hint=refusal["hint"])
        if code == _OUT_OF_SPACE:
            raise OSError(ENOSPC, os.strerror(ENOSPC), tempfile.gettempdir())
        raise FormatError(
            _exit_reason(code, last_words, seconds, memory_bytes), where=where, hint="is the file damaged?"
        )


def _exit_reason(code: int, last_words: list[str], seconds: float, memory_bytes: int) -> str:
    """Return why the child ended without an answer."""
    if code == _OUT_OF_MEMORY:
        return f"reading it needs more than {memory_bytes // 1024**2} MB of memory"
    if code in (-signal.SIGPROF, -signal.SIGXCPU):
        return f"reading it takes longer than {seconds:g} s of processor time"
    if code == -signal.SIGALRM:
        return f"reading it has not ended after {_PATIENCE * seconds:g} s"
    if code < 0:
        return f"the reader crashed (signal {-code})"
    return f"the reader failed: {last_words[-1] if last_words else f'exit code {code}'}"


def _environment() -> dict[str, str]:
    """Return the parent's import path and one thread, as every BLAS thread reserves address space."""
    return {
        "PATH": os.environ.get("PATH", ""),
        "PYTHONPATH": os.pathsep.join(p for p in sys.path if p),
        "PYTHONWARNINGS": "ignore",
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }


def _limit(seconds: float, memory_bytes: int, file_bytes: int) -> None:
    """Apply the limits to this process."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (memory_bytes, memory_bytes))
    resource.setrlimit(resource.RLIMIT_FSIZE, (file_bytes, file_bytes))
    whole = int(seconds) + 1
    resource.setrlimit(resource.RLIMIT_CPU, (whole, whole + 1))
    signal.setitimer(signal.ITIMER_PROF, seconds)
    signal.setitimer(signal.ITIMER_REAL, _PATIENCE * seconds)  # processor time does not pass in a child that waits


def _main(task: Mapping[str, Any]) -> int:
    """The child."""
    _limit(task["seconds"], task["memory_bytes"], task["file_bytes"])
    try:
        function = getattr(importlib.import_module(task["module"]), task["function"])
        write_arrays(Path("answer.npz"), function(*task["args"]))
    except InputError as e:
        refusal = {"format": isinstance(e, FormatError), "problem": e.problem, "where": e.where, "hint": e.hint}
        Path("refusal.json").write_text(json.dumps(refusal), encoding="utf-8")
        return _REFUSED
    except MemoryError:
        return _OUT_OF_MEMORY
    except OSError as e:
        if e.errno != ENOSPC:
            raise
        return _OUT_OF_SPACE
    return 0


if __name__ == "__main__":
    sys.exit(_main(json.loads(sys.argv[1])))
