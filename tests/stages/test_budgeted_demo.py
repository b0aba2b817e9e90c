"""The demo within budgets, from its photos to the page: it ends in time, and more time buys less error."""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
from pathlib import Path

import pytest

from vto_pipeline.bench.demo import measure_demo

LOG = logging.getLogger(__name__)
ROOT = Path(__file__).parents[2]
BUDGETS = (60.0, 120.0, 300.0)
LATE = 1.1
"""A budget is kept within a tenth."""


@pytest.mark.slow
def test_the_demo_ends_within_its_budget_and_its_error_falls_with_it(tmp_path):
    """Where this machine, as loaded, is too slow for a budget, the run says so, with about what it took."""
    errors = []
    for seconds in BUDGETS:
        run = tmp_path / f"within_{seconds:g}"
        command = "import sys; from vto_pipeline.cli.main import main; sys.exit(main())"
        words = ["run", "configs/demo.yaml", "--time-budget", f"{seconds:g}s", "-o", str(run), "--json"]
        done = subprocess.run(
            [sys.executable, "-c", command, *words], cwd=ROOT, capture_output=True, text=True, check=True
        )
        record = json.loads(done.stdout)
        LOG.info("%g s: %.1f s, load %.1f", seconds, record["time_spent_s"], os.getloadavg()[0])
        if record["time_spent_s"] > LATE * seconds:
            assert record["time_least_s"] == pytest.approx(record["time_spent_s"], rel=0.2)
            assert any("too short" in text for stage in record["stages"] for text in stage["warnings"])
        garment = measure_demo(run, ROOT / "sample_data")["garment"]
        errors.append(max(garment[side]["p95"] for side in ("to_truth_mm", "from_truth_mm")))
        assert garment["boundary_loops"] == 4
    LOG.info("95th percentile of the distance to the truth [mm]: %s", errors)
    assert errors == sorted(errors, reverse=True)
    assert errors[0] < 2.5  # a garment all the same: 1.5 when this was written
    assert errors[-1] < 0.85  # the bar of a run without a budget
