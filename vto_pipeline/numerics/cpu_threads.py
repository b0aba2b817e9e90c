"""The thread pool of the kernels; results do not depend on the number of threads."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numba


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
