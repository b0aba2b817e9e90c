"""Threads of the kernels, and of work done side by side; results do not depend on their number."""

from __future__ import annotations

import ctypes
import os
import sys
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TypeVar

import numba

T = TypeVar("T")


def load_tbb() -> None:
    """Let Numba find the thread pool of the `tbb` package, which must happen before its first parallel loop.

    The package puts its library into the environment's lib folder, where the loader does not look; Numba would then
    take OpenMP, whose waiting threads spin: on a machine with other work, a thousand times slower.
    """
    library = Path(sys.prefix) / "lib" / "libtbb.so.12"
    if library.exists():
        with suppress(OSError):  # a library of another platform: Numba's own choice will do
            ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)


@contextmanager
def limited_threads(count: int | None) -> Iterator[None]:
    """Use at most `count` threads inside the block; all when None."""
    if count is None:
        yield
        return
    before = numba.get_num_threads()
    numba.set_num_threads(min(count, before))
    try:
        yield
    finally:
        numba.set_num_threads(before)


def in_order(work: Callable[[int], T], count: int) -> Iterator[T]:
    """Yield work(0), work(1), ... work(count - 1); what one raises is raised in its turn.

    Only a few results are in memory: no more are made ahead than there are threads. What runs for long must let go of
    the interpreter's lock, as kernels with `nogil`, NumPy and OpenCV do; kernels with threads of their own may not run
    side by side.

    Args:
        work: Of an index; called in threads.
        count: Of indices.
    """
    threads = os.cpu_count() or 1
    coming: deque[Future[T]] = deque()
    with ThreadPoolExecutor(threads) as pool:
        for index in range(count):
            coming.append(pool.submit(work, index))
            if len(coming) > threads:
                yield coming.popleft().result()
        while coming:
            yield coming.popleft().result()
