"""The rows of a batch as tables and as a page: the same fields everywhere, failures of one kind together."""

from __future__ import annotations

import csv
import json
from html.parser import HTMLParser
from pathlib import Path

import pytest

from vto_pipeline.pipeline.batch.ledger import Ledger, read_ledger
from vto_pipeline.pipeline.batch.row import RowResult
from vto_pipeline.pipeline.batch.summary import COLUMNS, failure_kind, write_parquet
from vto_pipeline.report.batch.page import build_batch_page

PROBLEMS = {
    "b": ("failed", 4, "200 pairs of triangles of garment and body still cross, near (-0.17, 1.18)"),
    "c": ("failed", 4, "31 pairs of triangles of garment and body still cross, near (0.2, 1.3)"),
    "d": ("refused", 3, "vertex 0 is (nan, 0, 0): 1 of 3 vertices are not finite (/orders/d.ply)"),
    "e": ("too large", -15, "it needs more than 6000 MB of memory"),
}


@pytest.fixture
def entered(tmp_path: Path) -> Path:
    """The folder of a batch of six rows: one done, four failed in three ways, one waiting."""
    (tmp_path / "rows/a/out").mkdir(parents=True)
    (tmp_path / "rows/a/run.json").write_text("{}")
    ledger = Ledger(tmp_path, "abcdef")
    shown: dict = {"page": "rows/a/out/page.html", "picture": "pictures/1.png", "files": ["rows/a/run.json"]}
    shown["warnings"] = "drape: <i>not</i> at rest"
    ledger.enter(RowResult("a", "k", "done", 0, 2.5, 90.0, 1), "<b>fits</b>", shown)
    for name, (status, code, problem) in PROBLEMS.items():
        ledger.enter(RowResult(name, "k", status, code, 1.0, 5.0, 1, problem), "")
    ledger.save()
    return tmp_path


def test_failures_that_differ_in_numbers_only_are_of_one_kind(entered: Path) -> None:
    found = read_ledger(entered)["failures"]
    assert [(one["count"], one["rows"]) for one in found] == [(2, ["b", "c"]), (1, ["e"]), (1, ["d"])]
    assert found[0]["kind"] == "exit 4: # pairs of triangles of garment and body"
    assert found[2]["kind"] == "exit 3: vertex # is: # of # vertices"
    assert failure_kind({"status": "done", "problem": ""}) == ""
    unknown = {"status": "refused", "exit_code": 2, "problem": "unknown fabric 'silk': allowed: denim, wool"}
    assert failure_kind(unknown) == "exit 2: unknown fabric: allowed: denim, wool"
    assert failure_kind({"status": "lost", "exit_code": -9, "problem": ""}) == "exit -9: lost"


def test_every_format_has_the_same_fields(entered: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    rows = read_ledger(entered)["rows"]
    assert write_parquet(rows, entered / "batch.parquet")
    table = parquet.read_table(entered / "batch.parquet")
    assert table.column_names == list(COLUMNS)
    with (entered / "batch.csv").open(newline="") as stream:
        written = list(csv.DictReader(stream))
    assert list(written[0]) == list(COLUMNS)
    for row, line, columns in zip(rows, written, table.to_pylist(), strict=True):
        assert {name: row.get(name) for name in COLUMNS} == columns
        assert {name: "" if value is None else str(value) for name, value in columns.items()} == line
    assert json.loads((entered / "batch.json").read_text())["rows"][5]["status"] == "waiting"


def test_a_row_of_an_earlier_version_is_done_and_says_that_its_warnings_are_not_known(entered: Path) -> None:
    """A page without warnings would say that there were none."""
    record = json.loads((entered / "batch.json").read_text())
    known = read_ledger(entered)["counts"]
    del record["rows"][0]["warnings"]
    (entered / "batch.json").write_text(json.dumps(record))
    found = read_ledger(entered)
    assert found["counts"] == known
    assert found["rows"][0]["warnings"].startswith("not known")
    assert Ledger(entered, "abcdef").is_done("a", "k")


class Cells(HTMLParser):
    """The attributes of all elements, by tag."""

    def __init__(self) -> None:
        super().__init__()
        self.found: dict[str, list[dict[str, str | None]]] = {}

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.setdefault(tag, []).append(dict(attrs))


def test_the_page_shows_pictures_verdicts_and_kinds_of_failure(entered: Path) -> None:
    page = build_batch_page(read_ledger(entered))
    cells = Cells()
    cells.feed(page)
    assert [one["src"] for one in cells.found["img"]] == ["pictures/1.png"]
    assert "&lt;b&gt;fits&lt;/b&gt;" in page
    assert "drape: &lt;i&gt;not&lt;/i&gt; at rest" in page
    assert not {"b", "i"} & set(cells.found)  # what rows say is text
    ids = {one.get("id") for one in cells.found["tr"]}
    assert {f"row-{name}" for name in "abcdef"} <= ids
    targets = [str(one["href"]).removeprefix("#") for one in cells.found["a"] if str(one["href"]).startswith("#")]
    assert sorted(targets) == ["row-b", "row-c", "row-d", "row-e"]
    assert len(cells.found["button"]) == 7  # each sorts by its column
