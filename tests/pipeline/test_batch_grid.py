"""The rows of a batch as a grid."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from vto_pipeline.errors import ConfigError
from vto_pipeline.pipeline.batch.grid import grid_of
from vto_pipeline.pipeline.batch.order import read_order

ORDER = """\
schema: 1
run:
  schema: 1
  given: {fabric: denim, body: {measurements: {sex: female, measurements: {stature: 170}}}}
  want: [page]
every:
  given.body.measurements.measurements.stature: [180, 160, 170.5]
  given.fabric: [silk_charmeuse, denim]
  stages.drape.friction: [0.3]
"""


def rows(tmp_path: Path, text: str = ORDER):
    (tmp_path / "order.yaml").write_text(text)
    return read_order(tmp_path / "order.yaml")


def test_numbers_slide_and_come_last_in_any_order_of_the_rows(tmp_path):
    given = rows(tmp_path)
    random.Random(1).shuffle(given)
    grid = grid_of(given, "order.yaml")
    assert [(axis.key, axis.slides) for axis in grid.axes] == [
        ("given.fabric", False),
        ("given.body.measurements.measurements.stature", True),
    ]
    assert grid.axes[1].values == (160, 170.5, 180)
    found = [(row.data["given"]["fabric"], _stature(row)) for row in grid.rows]
    assert found == [(fabric, stature) for fabric in grid.axes[0].values for stature in grid.axes[1].values]


def _stature(row):
    return row.data["given"]["body"]["measurements"]["measurements"]["stature"]


def test_a_missing_combination_is_named(tmp_path):
    given = rows(tmp_path)
    gone = given.pop(2)
    named = f"fabric {gone.data['given']['fabric']}, stature {_stature(gone)}"
    with pytest.raises(ConfigError, match=f"1 of 6 combinations are missing: {named}"):
        grid_of(given, "order.yaml")


def test_rows_that_are_alike_are_refused(tmp_path):
    given = rows(tmp_path)
    with pytest.raises(ConfigError, match="row_1 and row_1 are the same"):
        grid_of([*given, given[0]], "order.yaml")
    with pytest.raises(ConfigError, match="do not differ"):
        grid_of(given[:1], "order.yaml")


def test_yes_and_no_do_not_slide(tmp_path):
    text = ORDER.replace("stages.drape.friction: [0.3]", "stages.drape.self_collision: [true, false]")
    grid = grid_of(rows(tmp_path, text), "order.yaml")
    assert [axis.slides for axis in grid.axes] == [False, False, True]
