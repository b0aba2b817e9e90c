"""What run.json says, and what a stage is measured to cost."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from vto_pipeline.pipeline.execution.cost import Meter, machine, thread_count
from vto_pipeline.pipeline.execution.record import plain


def test_metrics_become_plain_json():
    value = {"a": np.float64(0.5), "b": np.arange(3), "c": float("nan"), "d": [np.inf, (1, 2)], "e": Path("x/y")}
    assert plain(value) == {"a": 0.5, "b": [0, 1, 2], "c": None, "d": [None, [1, 2]], "e": "x/y"}
    with pytest.raises(TypeError, match="type set has no JSON form"):
        plain({"a": {1}})


@pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="elsewhere the peak is the whole process's")
def test_peak_memory_is_that_of_the_stage():
    meter = Meter()
    before = meter.peak_mb()
    block = np.ones(25_000_000)  # 200 MB, touched
    during = meter.peak_mb()
    assert 190 < during - before < 260  # 200 MB and what else the allocator does
    del block
    assert Meter().peak_mb() < during - 150  # the next stage does not pay for this one


def test_seconds_are_wall_time():
    began = time.monotonic()
    meter = Meter()
    inside = time.monotonic()
    time.sleep(0.05)
    least = time.monotonic() - inside
    assert least - 0.001 < meter.seconds() < time.monotonic() - began + 0.001  # 1 ms: what it is rounded to
    assert least > 0.04


def test_threads_follow_numbas_limit(monkeypatch):
    monkeypatch.setenv("NUMBA_NUM_THREADS", "1")
    assert thread_count() == 1
    monkeypatch.setenv("NUMBA_NUM_THREADS", "100000")
    assert 1 <= thread_count() <= int(str(machine()["cores"]))
