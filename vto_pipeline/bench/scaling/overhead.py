"""Overhead of threads: one sweep on one thread and on all, alone and beside a busy core.

Waiting threads that spin would make the threaded sweep many times slower on a machine with other work.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

from vto_pipeline.bench.bench import Measured, Row, Watch
from vto_pipeline.bench.scaling.throughput import projection_sweep, seconds_of
from vto_pipeline.bench.timing import threads_now


def overhead_rows(count: int, watch: Watch) -> Iterator[Row]:
    """Measure the sweep over a sheet of count x count vertices."""
    for neighbour in ("idle", "busy"):
        measure = partial(_measure, count, neighbour == "busy")
        yield watch.row(f"threads {count}", "projection sweep", {"other_core": neighbour}, count**2, measure)


def _measure(count: int, busy: bool) -> Measured:
    """Return the threaded sweep, and how much longer it takes than on one thread."""
    alone, shared = projection_sweep(count, threaded=False), projection_sweep(count, threaded=True)
    for kernel in (alone, shared):
        kernel.call()
    with _spinning(threads_now() - 1 if busy else 0):
        one, all_threads = seconds_of(alone.call), seconds_of(shared.call)
    return all_threads, {
        "one_thread_s": one.seconds,
        "threads_s": all_threads.seconds,
        "overhead": all_threads.seconds / one.seconds - 1.0,
    }


@contextmanager
def _spinning(count: int) -> Iterator[None]:
    """Keep this many cores busy inside the block."""
    others = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for other in others:
            other.kill()
            other.wait()
