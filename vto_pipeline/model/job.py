"""Progress and findings of a long computation, independent of how they are shown."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path


def _silent(fraction: float, text: str) -> None:
    """Say nothing."""


@dataclass
class Job:
    """Progress, findings and circumstances of one running stage.

    Args:
        progress: Called with the finished share (0 to 1) and what is being done.
        scratch: A folder for temporary files, or None when there is none.
        kept: A folder that the next run with the same inputs and settings finds as it was left, or None: for what is
            made piece by piece.
        seed: For everything random.
        force_all: Leave nothing out, to compare.
        memory: Budget of the whole process's resident memory [B]. Stages that can, work in less of it at a time.
    """

    progress: Callable[[float, str], None] = _silent
    scratch: Path | None = None
    seed: int = 0
    force_all: bool = False
    memory: float = math.inf
    kept: Path | None = None
    metrics: dict[str, object] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    left_out: list[tuple[str, str]] = field(default_factory=list)

    def memory_left(self) -> float:
        """Return the memory that the stage may take besides what is in use [B]; without a budget, the machine's."""
        page = os.sysconf("SC_PAGE_SIZE")
        machine = float(page * os.sysconf("SC_PHYS_PAGES"))
        statm = Path("/proc/self/statm")
        if self.memory == math.inf or not statm.exists():
            return min(machine, self.memory)
        return min(machine, self.memory - page * int(statm.read_text().split()[1]))

    def measure(self, **values: object) -> None:
        """Record figures for run.json and the page; a length's name ends in its unit, as in `rms_mm=0.4`."""
        self.metrics.update(values)

    def note(self, text: str) -> None:
        """Record something the user should be able to read later, such as a guessed unit."""
        self.notes.append(text)

    def warn(self, text: str) -> None:
        """Record a verdict: the result stands, but it is poorer than it should be."""
        self.warnings.append(text)

    def leave_out(self, what: str, reason: str) -> None:
        """Record a piece of work this scene did not need."""
        self.left_out.append((what, reason))
