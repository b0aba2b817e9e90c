"""Shared scenes on the import path; threads as `vto` has them; one worker compiles while another needs no kernels."""

from __future__ import annotations

import os
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # its sums depend on the thread count

import numba
import pytest

import vto_pipeline.numerics  # noqa: F401  # Numba's thread pool must be loaded before Open3D brings an older one


def pytest_configure():
    """Share the cores among the workers of pytest-xdist, if there are any."""
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    numba.set_num_threads(max(1, numba.get_num_threads() // workers))


TESTS = Path(__file__).parent
COMPILES = "cloth/test_bad_starts.py"
"""Its drapes compile most kernels, which takes minutes; the others load them."""
NO_KERNELS = ("cli", "io", "pipeline", "report")
"""Rooms whose tests call few of them."""


def _rank(path: Path) -> int:
    """Place of a file's tests: whole drapes after what needs no kernels, and before what is short."""
    within = path.relative_to(TESTS)
    if within.as_posix() == COMPILES:
        return 0
    return 1 if within.parts[0] in NO_KERNELS else 2


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let one worker compile while another does what needs no kernels, so that neither compiles what the other does."""
    items.sort(key=lambda item: _rank(item.path))
