"""The chart: every line that can be drawn is, at its place, with its name."""

import re

from vto_pipeline.model.cloth import TraceRow
from vto_pipeline.report.chart import log_chart
from vto_pipeline.report.page import build_page

RECORD = {"stages": []}


def points(svg, k):
    path = re.search(rf'class="line l{k}" d="M([^"]+)"', svg)
    return [tuple(map(float, pair.split(","))) for pair in path[1].split("L")]


def test_a_power_law_is_a_straight_line_from_corner_to_corner():
    svg = log_chart([1.0, 10.0, 100.0], {"one": [100.0, 10.0, 1.0]}, "time", "error")
    (x0, y0), (x1, y1), (x2, y2) = points(svg, 0)
    assert (x1 - x0, y1 - y0) == (x2 - x1, y2 - y1)
    assert x0 < x1
    assert y0 < y1  # downward
    assert ">one<" not in svg  # alone it needs no name


def test_lines_share_their_axes_and_have_names():
    svg = log_chart([1.0, 10.0], {"one": [100.0, 10.0], "none": [0.0, None], "two": [10.0, 1.0]}, "time", "error")
    assert points(svg, 0)[1] == (
        points(svg, 1)[0][0] + points(svg, 1)[1][0] - points(svg, 1)[0][0],
        points(svg, 1)[0][1],
    )
    assert ">one<" in svg
    assert ">two<" in svg
    assert ">none<" not in svg


def test_nothing_to_draw_is_no_chart():
    assert log_chart([1.0, 2.0], {"one": [float("nan"), float("inf")], "two": [1.0, -1.0]}, "time", "error") == ""


def test_the_page_says_when_the_shape_was_good_enough():
    trace = [TraceRow(10.0 * k, k, 3.0, 0.1, 0, 0, x / 2, x, 2 * x) for k, x in enumerate([20.0, 4.0, 0.8, 0.0], 1)]
    page = build_page(RECORD, {"trace": trace})
    assert "Good enough at 5 mm after 20.0 s." in page
    assert "Good enough at 1 mm after 30.0 s." in page
    assert "true, 95 % of the cloth" in page
    before = build_page(RECORD, {"trace": [TraceRow(1.0, 1, 3.0, 0.1), TraceRow(2.0, 2, 1.0, 0.1)]})
    assert "Good enough" not in before
    assert "true, 95" not in before
