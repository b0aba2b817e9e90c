"""vto advise."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

CHART = {
    "schema": 1,
    "allowances": "shirt",
    "sizes": {size: {"flat_mm": {"chest": half}} for size, half in (("S", 460), ("M", 500), ("L", 542))},
}


def test_best_runner_up_reason_and_exit_code(vto):
    Path("chart.json").write_text(json.dumps(CHART))
    Path("tape.yaml").write_text("measurements: {chest_girth: 95, waist_girth: 80}\n")
    said = vto("advise", "chart.json", "--measurements", "tape.yaml", "--json")
    assert (said.code, said.data["best"], said.data["runner_up"], said.data["fits"]) == (0, "M", "L", True)
    assert said.data["reason"] == "M: chest +5.0 cm of ease (wanted: 3.8 to 7.6)"
    small = next(one for one in said.data["sizes"] if one["size"] == "S")
    assert (small["wearable"], small["zones"]["chest"]["ease_cm"]) == (False, pytest.approx(-3.0))
    words = vto("advise", "chart.json", "--measurements", "tape.yaml").out
    assert words.startswith("M; runner-up: L\n")
    assert "S: chest -3.0 cm of ease (wanted: 3.8 to 7.6), smaller than the body" in words
    mens = vto("advise", "chart.json", "--measurements", "tape.yaml", "--fit", "mens_shirt", "--json").data
    assert (mens["best"], mens["fits"]) == ("L", True)  # 13.4 cm of the 9 to 20 that such a shirt is cut with
    Path("tape.yaml").write_text("measurements: {chest_girth: 130}\n")
    none = vto("advise", "chart.json", "--measurements", "tape.yaml", "--json")
    assert (none.code, none.data["best"], none.data["runner_up"]) == (4, None, None)
    assert vto("advise", "chart.json", "--measurements", "tape.yaml").out.startswith("no size")
    Path("chart.json").write_text(json.dumps(CHART | {"kind": 1}))
    assert vto("advise", "chart.json", "--measurements", "tape.yaml").code == 3
    Path("chart.json").write_text(json.dumps(CHART | {"sizes": {}}))
    assert vto("advise", "chart.json", "--measurements", "tape.yaml").code == 3
