"""The cost of a stage: wall time and peak memory."""

from __future__ import annotations

import os
import platform
import resource
import time
from contextlib import suppress
from pathlib import Path

_STATUS = Path("/proc/self/status")
_CLEAR = Path("/proc/self/clear_refs")


class Meter:
    """Measures wall time and peak memory from its creation."""

    def __init__(self) -> None:
        self._start = time.perf_counter()
        with suppress(OSError):  # elsewhere than on Linux the peak is that of the whole process so far
            _CLEAR.write_text("5")  # forget the peak so far

    def seconds(self) -> float:
        """Wall time since the start [s]."""
        return round(time.perf_counter() - self._start, 3)

    def peak_mb(self) -> float:
        """Largest resident memory since the start [MB]."""
        if _STATUS.exists():
            for line in _STATUS.read_text().splitlines():
                if line.startswith("VmHWM:"):
                    return round(int(line.split()[1]) * 1024 / 1e6, 1)
        return round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6, 1)


def thread_count() -> int:
    """Cores this process may use, or fewer where NUMBA_NUM_THREADS says so."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    limit = os.environ.get("NUMBA_NUM_THREADS", "")
    return min(cores, int(limit)) if limit.isdecimal() else cores


def machine() -> dict[str, object]:
    """The machine, for the record beside every time."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return {
        "system": platform.platform(),
        "python": platform.python_version(),
        "processor": _processor(),
        "cores": os.cpu_count(),
        "memory_mb": round(memory / 1e6),
    }


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()
