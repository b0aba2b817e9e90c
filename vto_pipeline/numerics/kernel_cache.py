"""The cache of compiled kernels, never older than their sources.

Numba keeps each kernel beside its file and compiles it again when that file changes, but not when a kernel changes that
it calls from another file: stale code would run, or the cache fail to load after an upgrade. So the folder carries a
digest of all kernels' sources.

Nor does Numba keep two processes from choosing the same file for two kernels that they compile at the same time. Either
could later load the other's machine code. So one process saves at a time. And one that needs what another compiles just
now waits for it.

Numba's entries for C, which are never called, are not compiled.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import wraps
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import IndexDataCacheFile
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher
from numba.core.lowering import Lower

_WITHOUT_C_ENTRIES = {__name__.split(".")[0], "numba"}  # the latter for what our kernels use of NumPy
_PATIENCE = 300.0  # s; by far more than any kernel takes, so whoever has its turn for longer hangs
_POLL = 0.05  # s
_turns: set[str] = set()  # of this process


def use_kernel_cache() -> None:
    """Set Numba's folder, unless the user has (NUMBA_CACHE_DIR). Must come before the first kernel is defined."""
    if numba.config.CACHE_DIR:  # type: ignore[attr-defined]  # settings are made from the environment
        return
    package = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(package.rglob("*.py")):
        text = source.read_bytes()
        if b"njit" in text or b"overload" in text:
            digest.update(str(source.relative_to(package)).encode() + text)
    home = package / "__pycache__"
    folder = home / f"kernels-{digest.hexdigest()[:16]}"
    numba.config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]
    for old in home.glob("kernels-*"):
        if old != folder:
            shutil.rmtree(old, ignore_errors=True)


def serialise_cache_writes() -> None:
    """Let one process at a time look for the name of a free file and take it. Once."""
    save = IndexDataCacheFile.save

    @wraps(save)
    def alone(self: IndexDataCacheFile, key: Any, data: Any) -> None:
        with open(f"{self._index_path}.lock", "w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            save(self, key, data)

    IndexDataCacheFile.save = alone  # type: ignore[method-assign]


def take_turns_compiling() -> None:
    """Let one process at a time compile a kernel; those that waited for it load what it has saved. Once.

    A turn lasts while the kernels that it calls are compiled. No two wait for each other: no kernel calls its caller.
    """
    compile_kernel = Dispatcher.compile

    @wraps(compile_kernel)
    def in_turn(self: Any, signature: Any) -> Any:
        if signature in self.overloads:
            return compile_kernel(self, signature)
        with global_compiler_lock, _turn(self):  # in this order, as threads that compile already have the former
            return compile_kernel(self, signature)

    Dispatcher.compile = in_turn  # type: ignore[assignment]


@contextmanager
def _turn(kernel: Any) -> Iterator[None]:
    """Wait until no other process compiles this kernel. Where that cannot be known, go on."""
    kept = getattr(kernel._cache, "_cache_file", None)
    path = f"{kept._index_path}.turn" if kept else ""
    if not path or path in _turns:  # a kernel may call itself, with other types
        yield
        return
    try:
        lock = os.open(path, os.O_CREAT | os.O_WRONLY)
    except OSError:  # whoever cannot write here cannot save either
        yield
        return
    try:
        _wait_for(lock)
        _turns.add(path)
        yield
    finally:
        _turns.discard(path)
        with suppress(OSError):  # closing it, or the end of the process, would not do if a child has inherited it
            fcntl.flock(lock, fcntl.LOCK_UN)
        os.close(lock)


def _wait_for(lock: int) -> None:
    until = time.monotonic() + _PATIENCE
    while time.monotonic() < until:
        try:
            return fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            time.sleep(_POLL)  # rather than wait in the system, which a signal would not end
        except OSError:  # a file system without locks
            return None


def leave_out_c_entries() -> None:
    """Compile no entry for callers in C, which takes a tenth of the time and is used by none of these kernels. Once.

    Numba needs it only where a kernel is passed by its address, so kernels of other packages keep theirs.
    """
    create = Lower.create_cfunc_wrapper

    @wraps(create)
    def for_others(self: Lower) -> None:
        if self.fndesc.modname.split(".")[0] not in _WITHOUT_C_ENTRIES:
            create(self)

    Lower.create_cfunc_wrapper = for_others  # type: ignore[assignment]
