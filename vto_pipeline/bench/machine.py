"""The machine a bench ran on, as far as it explains the figures."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import numba
import numpy as np

import vto_pipeline
from vto_pipeline.bench.timing import threads_now
from vto_pipeline.pipeline.execution.digest import code_identity

_HARDWARE = ("cpu", "cores", "threads", "memory_gb")
_STATE = ("load_at_start", "niceness")  # how the machine happened to be, not what it is
_CODE = "code"  # of the whole package: most benches drive only a part of it


def this_machine() -> dict[str, Any]:
    """Return CPU, cores, threads in use, memory, system, versions, the digest of the code; load and niceness now."""
    return {
        "cpu": _cpu(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1,
        "threads": threads_now(),
        "threading": numba.threading_layer(),
        "memory_gb": _memory_gb(),
        "os": platform.platform(),
        "python": platform.python_version(),
        "numba": metadata.version("numba"),
        "numpy": np.__version__,
        "vto_pipeline": vto_pipeline.__version__,
        "code": code_identity()[:16],
        "load_at_start": round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else None,
        "niceness": os.nice(0) if hasattr(os, "nice") else None,
    }


def same_machine(one: dict[str, Any], other: dict[str, Any]) -> bool:
    """Return whether rows measured on both may stand in one table, if the sources are the same, too."""
    return _identity(one) == _identity(other)


def same_hardware(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Return whether run times on both may be compared; software and code may differ."""
    return all(one.get(name) == other.get(name) for name in _HARDWARE)


def _identity(machine: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in machine.items() if name not in (*_STATE, _CODE)}


def _cpu() -> str:
    """Return the processor's name as the system gives it."""
    listed = Path("/proc/cpuinfo")
    if listed.is_file():
        for line in listed.read_text(encoding="utf-8", errors="replace").splitlines():
            name, _, value = line.partition(":")
            if name.strip() == "model name":
                return value.strip()
    return platform.processor() or platform.machine()


def _memory_gb() -> float | None:
    """Return the physical memory [GB]; None where the system does not tell."""
    try:
        return round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9, 1)
    except (AttributeError, ValueError, OSError):
        return None
