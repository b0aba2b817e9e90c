"""What the cost model foretells against what runs took: on runs that follow a law."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from vto_pipeline.bench.scaling.forecasts import forecasts, main, table, taken_by_runs
from vto_pipeline.errors import InputError

SIZES = (1e3, 2e3, 4e3, 8e3, 16e3, 32e3, 64e3)


def law(size: float) -> float:
    return 2.0 * (size / 1e3) ** 0.8


def write(folder: Path, number: int, size: float, seconds: float, status: str = "ran", reason: str = "") -> None:
    figures = {"cloth bytes": math.log(size)}
    stages = [
        {"name": "cut", "status": status, "reason": reason, "seconds": seconds, "figures": figures},
        {"name": "sew", "status": "ran", "reason": "", "seconds": 1.0, "figures": {}},
    ]
    (folder / f"run_{number}").mkdir(parents=True)
    (folder / f"run_{number}" / "run.json").write_text(json.dumps({"stages": stages}))


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    for number, size in enumerate(SIZES):
        write(tmp_path, number, size, law(size))
    return tmp_path


def test_runs_that_follow_a_law_are_foretold(runs):
    found = forecasts(taken_by_runs(runs))
    for (took, foretold), size in zip(found["cut"], SIZES, strict=True):
        assert took == law(size)
        assert foretold == pytest.approx(took, rel=0.1)  # the prior draws the power to 0
    assert np.array(found["sew"]) == pytest.approx(1.0)
    assert np.array(found["whole runs"]) == pytest.approx(np.array(found["cut"]) + 1.0)
    whole, cut, sew = table(runs)
    assert (whole[0], cut[0], sew[0]) == ("whole runs", "cut", "sew")
    assert sew == ("sew", "7", "7", "1.00 of it", "0%", "0%", "100%")
    assert cut[2] == f"{sum(map(law, SIZES)):.0f}"


def test_a_run_is_foretold_by_the_others_alone(tmp_path):
    for number, size in enumerate(SIZES):
        write(tmp_path, number, 4e3, law(size))
    found = forecasts(taken_by_runs(tmp_path))["cut"]
    root = math.sqrt(2.0)  # the median of the other six lies between two of them
    assert found[0] == pytest.approx((law(1e3), law(8e3 * root)))
    assert found[-1] == pytest.approx((law(64e3), law(4e3 * root)))


def test_what_was_no_work_counts_on_neither_side(runs):
    write(runs, 7, 5e3, 0.01, status="cached")
    write(runs, 8, 5e3, 0.01, reason="no cloth")
    found = forecasts(taken_by_runs(runs))
    assert (len(found["cut"]), len(found["sew"]), len(found["whole runs"])) == (7, 9, 9)


def test_one_run_is_refused(tmp_path, monkeypatch, capsys):
    write(tmp_path, 0, 1e3, 1.0)
    with pytest.raises(InputError, match="1 runs"):
        taken_by_runs(tmp_path)
    monkeypatch.setattr("sys.argv", ["forecasts", str(tmp_path)])
    assert main() == 3
    assert "a forecast of one needs others" in capsys.readouterr().err
