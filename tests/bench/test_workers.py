"""A batch with one worker and with two: what it counts, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import pytest

from vto_pipeline.bench.scaling.workers import order, rows
from vto_pipeline.errors import ComputationError
from vto_pipeline.pipeline.batch.order import read_order

TAPE = "unit: cm\nsex: female\nmeasurements: {{stature: {}, bust_girth: 93, waist_girth: 78, hip_girth: 101}}\n"


@pytest.fixture
def tapes(tmp_path) -> list[Path]:
    paths = [tmp_path / f"tape_{stature}.yaml" for stature in (165, 175)]
    for path in paths:
        path.write_text(TAPE.format(path.stem.removeprefix("tape_")))
    return paths


def test_every_garment_is_worn_by_every_customer(tmp_path, tapes):
    garments = [tmp_path / f"garment_{k}.ply" for k in range(3)]
    for path in (*garments, tmp_path / "body.ply"):
        path.write_text("ply\n")
    for document, count in ((order(garments, [], tapes), 6), (order(garments, [tmp_path / "body.ply"], []), 3)):
        (tmp_path / "order.yaml").write_text(str(document).replace("'", '"'))
        found = read_order(tmp_path / "order.yaml")
        given = {(str(row.data["given"]["garment"]["mesh"]), str(row.data["given"]["body"])) for row in found}
        assert len(found) == len(given) == count


@pytest.mark.slow
def test_rows_results_and_seconds_are_counted(tmp_path, tapes):
    (one, two) = rows(order([], [], [*tapes, tapes[0]]), [1, 2], tmp_path / "out")
    for found in (one, two):
        assert (found["rows"], found["done"], found["failed"]) == (3, 3, 0)
        assert "fit_measurements 2" in found["made"]  # the third customer is the first once more
    assert one["share_of_first"] == 1.0
    for found in (one, two):  # two avatars and the start of each of three rows, in children of children
        assert 3.0 < found["cpu_seconds"] < found["workers"] * 4 * found["seconds"]
        assert found["busy"] == pytest.approx(found["cpu_seconds"] / found["workers"] / found["seconds"], rel=1e-12)
    assert two["share_of_first"] == pytest.approx(two["seconds"] / one["seconds"], rel=1e-12)
    with pytest.raises(ComputationError, match="was run before"):
        next(rows(order([], [], tapes), [1], tmp_path / "out"))
