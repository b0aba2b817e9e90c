"""Where compiled kernels are kept, so that none is ever older than its source.

Numba keeps each kernel beside its file and compiles it again when that file changes, but not when a kernel changes that
it calls from another file: stale code would run, or the cache fail to load after an upgrade. So the folder carries a
digest of all kernels' sources.
"""

from __future__ import annotations

import hashlib
import shutil
from pathlib import Path

import numba


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
