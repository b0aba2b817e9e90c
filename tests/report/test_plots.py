"""Plots: readable size, same bytes for same rows, honest refusal."""

from __future__ import annotations

from io import BytesIO

import pytest
from PIL import Image

from vto_pipeline.errors import InputError
from vto_pipeline.report.chart import log_chart
from vto_pipeline.report.plots import error_against_time


def bench(error: float = 1.0) -> dict:
    rows = [
        {"scene": scene, "method": method, "seconds": 10.0**k, "errors": {"rms_mm": error / 10.0**k}}
        for scene in ("hang", "shirt")
        for method in ("xpbd", "newton")
        for k in range(3)
    ]
    return {"bench": "solvers", "rows": rows}


def test_same_rows_same_bytes() -> None:
    assert error_against_time(bench()) == error_against_time(bench())
    assert error_against_time(bench()) != error_against_time(bench(error=7.0))


def test_one_panel_per_scene() -> None:
    two = Image.open(BytesIO(error_against_time(bench())))
    one = bench()
    one["rows"] = one["rows"][:6]
    assert two.width > 1.5 * Image.open(BytesIO(error_against_time(one))).width


def test_nothing_to_plot_is_an_error() -> None:
    with pytest.raises(InputError, match="none with an error"):
        error_against_time({"bench": "solvers", "rows": []})
    with pytest.raises(InputError, match="none with an error"):
        error_against_time(bench(), errors=["penetration_mm"])


def test_chart_places_powers_of_ten_evenly() -> None:
    svg = log_chart([1, 10, 100], [100, 10, 1], "x", "y")
    path = svg.split('class="line" d="M')[1].split('"')[0]
    points = [tuple(map(float, pair.split(","))) for pair in path.split("L")]
    (ax, ay), (bx, by), (cx, cy) = points
    assert bx - ax == pytest.approx(cx - bx, abs=0.11)  # written to a tenth of a unit
    assert by - ay == pytest.approx(cy - by, abs=0.11)
    assert cy > ay  # a smaller error is lower


def test_chart_leaves_out_what_has_no_logarithm() -> None:
    assert log_chart([1, 2, 3], [0.0, float("nan"), 1.0], "x", "y") == ""
