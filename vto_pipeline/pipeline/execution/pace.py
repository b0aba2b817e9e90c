"""How slow this machine is just now, by a known piece of work: before any stage has run, nothing else tells."""

from __future__ import annotations

import time

import numpy as np

REFERENCE_S = 0.12
"""What the work takes on the machine that the table of stages was measured on, with nothing else running."""
_NUMBERS = 1_000_000
_PROBES = 2
_RANGE = (0.25, 16.0)


def machine_pace() -> float:
    """Return how many times as long as on that machine, quiet, work takes here and now, 0.25 to 16.

    Sorting, gathering and adding numbers: what a processor and its memory do, whatever library is installed. It takes a
    fifth of a second there.
    """
    numbers = np.random.default_rng(0).random(_NUMBERS)
    began = time.perf_counter()
    for _ in range(_PROBES):
        order = np.argsort(numbers, kind="stable")
        np.add.reduce(np.sqrt(numbers[order]))
    return float(np.clip((time.perf_counter() - began) / _PROBES / REFERENCE_S, *_RANGE))
