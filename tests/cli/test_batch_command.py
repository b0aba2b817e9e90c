"""`vto batch` on the toy tables, on a cluster of this machine."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from toy_tables import CALLS
from web_folder import served

from vto_pipeline.cli.commands import batch

TESTS = str(Path(__file__).parents[1])
TOY_PROGRAM = (
    f"import sys; sys.path.insert(0, {TESTS!r}); from toy_tables import TOY; "
    "from vto_pipeline.stages.entry import planning; planning.catalogue = lambda: TOY; "
    "from vto_pipeline.cli.main import main; sys.exit(main())"
)
TABLE = "name,given.left.number,stages.add.offset,stages.add.fail\na,left.txt,1,\nb,right.txt,2,\nc,left.txt,,true\n"
ORDER = """\
schema: 1
run:
  schema: 1
  given: {left: {number: left.txt}, right: {number: right.txt}}
  want: [squared, page]
rows: table.csv
"""


@pytest.fixture
def ordered(vto, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """`vto`, with a batch of three rows of which the third fails."""
    pytest.importorskip("distributed")
    monkeypatch.setattr(batch, "PROGRAM", (sys.executable, "-c", TOY_PROGRAM))
    (tmp_path / "order.yaml").write_text(ORDER)
    (tmp_path / "table.csv").write_text(TABLE)
    return vto


def squared(row: str) -> str:
    return Path("november", "rows", row, "out", "squared.txt").read_text()


def test_a_file_that_is_missing_is_missing_in_the_folder_of_the_batch(ordered, tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text(TABLE.replace("right.txt", "nowhere.txt"))
    said = ordered("batch", "order.yaml", "-o", "november")
    assert said.code == 3, said.err
    assert str(tmp_path / "nowhere.txt") in said.err.replace("\n", "")


@pytest.mark.filterwarnings("default")  # of dask and its worker processes
def test_a_batch_does_what_can_be_done_and_only_the_rest_again(ordered, tmp_path: Path) -> None:
    said = ordered("batch", "order.yaml", "-o", "november", "--workers", "2", "--memory", "2.5GB")
    assert said.code == 6, said.err
    budgets = [json.loads(path.read_text())["memory_budget_mb"] for path in Path("november/rows").glob("*/run.json")]
    assert budgets == [2500.0] * 3  # so that stages which can, fit themselves into the limit
    assert "1 of 3 rows are not done: 1 failed" in said.err
    assert squared("a") == str((2 * 3 + 2 * 4 + 1) ** 2)
    assert squared("b") == str((2 * 4 + 2 * 4 + 2) ** 2)
    record = json.loads(Path("november/batch.json").read_text())
    rows = {row["name"]: row for row in record["rows"]}
    assert {name: row["status"] for name, row in rows.items()} == {"a": "done", "b": "done", "c": "failed"}
    assert "sum diverged" in rows["c"]["problem"]
    assert record["failures"] == [{"kind": "exit 4: sum diverged", "count": 1, "rows": ["c"]}]
    assert "1 x exit 4: sum diverged (c)" in said.err
    assert [rows[name]["warnings"] for name in "abc"] == ["add: toy sum", "add: toy sum", ""]
    assert "warning: add: toy sum" in said.err  # at once: nobody opens the pages of a hundred rows
    page = Path("november/page.html").read_text()
    assert 'class="bad">failed' in page
    assert '<a href="#row-c">c</a>' in page
    made = len(list(Path("november/cache/right.double").glob("*/manifest.json")))
    assert made == 1  # three rows need it

    Path("table.csv").write_text(TABLE.replace("true", ""))
    again = ordered("batch", "order.yaml", "-o", "november", "--log", "log.jsonl")
    assert again.code == 0, again.err
    assert "2 of 3 rows are done and unchanged" in again.err
    assert "[1/1] c: done" in again.err
    row, done = (json.loads(line) for line in Path("log.jsonl").read_text().splitlines())
    assert (row["event"], row["name"], row["status"], row["done"], row["count"]) == ("row", "c", "done", 1, 1)
    assert row["warnings"] == "add: toy sum"
    assert again.out.startswith("3 rows are done, 3 of them with warnings")
    assert (done["event"], done["counts"]) == ("done", {"done": 3})
    assert squared("c") == str((2 * 3 + 2 * 4) ** 2)

    third = ordered("batch", "order.yaml", "-o", "november", "--json", "-q")
    assert (third.code, third.err) == (0, "")
    assert third.data["counts"] == {"done": 3}

    status = ordered("status", "november")
    assert status.code == 0
    assert status.out.startswith("3 rows: 3 done")
    assert status.out.count("warning: add: toy sum") == 3
    assert "at work" not in status.out


def test_documents_of_a_run_and_of_a_batch_are_told_apart(ordered) -> None:
    """Beginners mix them up, and "given: field required" helps nobody."""
    Path("one.yaml").write_text("schema: 1\ngiven: {left: {number: left.txt}}\nwant: [total]\n")
    for words, hint in ((("batch", "one.yaml"), "vto run"), (("run", "order.yaml"), "vto batch")):
        said = ordered(*words, "-o", "out")
        assert (said.code, Path("out").exists()) == (2, False)
        assert f"`{hint}`" in said.err


def test_a_status_tells_whether_anything_works_on_the_rows_that_wait(vto) -> None:
    program = (
        "from pathlib import Path; from vto_pipeline.pipeline.batch.ledger import Ledger\n"
        "from vto_pipeline.pipeline.execution.folder import locked_run_folder\n"
        "with locked_run_folder(Path('b')): Ledger(Path('b'), 'ab').save(); print('locked', flush=True); input()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout
        assert process.stdout.readline() == "locked\n"
        assert f"at work: process {process.pid} on " in vto("status", "b").out
        process.kill()
    assert "nothing is at work there" in vto("status", "b").out
    assert vto("status", "b", "--json").data["at_work"] == ""
    (Path("b") / "rows").mkdir()
    for command in ("report", "view"):  # which take one of its runs
        said = vto(command, "b")
        assert said.code == 3
        assert "rows" in said.err


@pytest.mark.filterwarnings("default")  # of dask and its worker processes
def test_a_setting_on_the_command_line_wins_in_every_row(ordered) -> None:
    Path("table.csv").write_text(TABLE.replace("true", ""))
    wrong = ordered("batch", "order.yaml", "-o", "november", "--set", "add.ofset=5")
    assert (wrong.code, Path("november").exists()) == (2, False)
    assert "offset" in wrong.err  # what is meant
    said = ordered("batch", "order.yaml", "-o", "november", "--set", "add.offset=5")
    assert said.code == 0, said.err
    left = {"a": 3, "b": 4, "c": 3}
    assert {row: squared(row) for row in left} == {row: str((2 * one + 2 * 4 + 5) ** 2) for row, one in left.items()}
    assert "3 of 3 rows are done" in ordered("batch", "order.yaml", "-o", "november", "--set", "add.offset=5").err
    assert "done and unchanged" not in ordered("batch", "order.yaml", "-o", "november", "--set", "add.offset=6").err


@pytest.mark.filterwarnings("default")  # of dask and its worker processes
def test_rows_whose_results_are_stored_start_no_process(ordered, monkeypatch: pytest.MonkeyPatch) -> None:
    Path("table.csv").write_text(TABLE.replace("true", ""))
    assert ordered("batch", "order.yaml", "-o", "november").code == 0
    Path("november/batch.json").unlink()
    Path("november/rows/a/out/squared.txt").unlink()
    Path("table.csv").write_text(TABLE.replace("true", "") + "d,left.txt,1,\n")  # as row a
    monkeypatch.setattr(batch, "PROGRAM", ("false",))
    again = ordered("batch", "order.yaml", "-o", "november", "--json")
    assert again.code == 0, again.err
    assert "4 rows had all their results stored" in again.err
    assert [row["tries"] for row in again.data["rows"]] == [0, 0, 0, 0]
    assert squared("a") == squared("d") == str((2 * 3 + 2 * 4 + 1) ** 2)
    assert CALLS == ["page"] * 4
    assert json.loads(Path("november/documents/d.json").read_text())["stages"] == {"add": {"offset": 1}}

    shutil.rmtree("november/rows/a")  # by hand
    Path("november/rows/b/out/squared.txt").unlink()
    rows = {row["name"]: row for row in ordered("status", "november", "--json").data["rows"]}
    assert [rows[name]["status"] for name in "abcd"] == ["waiting", "waiting", "done", "done"]
    assert rows["b"]["problem"] == "rows/b/out/squared.txt is gone"
    third = ordered("batch", "order.yaml", "-o", "november")
    assert third.code == 0, third.err
    assert "2 of 4 rows are done and unchanged" in third.err
    assert squared("a") == str((2 * 3 + 2 * 4 + 1) ** 2)
    assert squared("b") == str((2 * 4 + 2 * 4 + 2) ** 2)


def test_a_row_that_cannot_be_planned_stops_all_before_they_begin(ordered, tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text(TABLE + "d,nowhere.txt,,\n")
    said = ordered("batch", "order.yaml", "-o", "november")
    assert said.code == 3
    assert "row d" in said.err
    assert "nowhere.txt" in said.err
    assert not Path("november").exists()


def test_a_folder_without_a_batch_has_no_status(vto) -> None:
    said = vto("status", ".")
    assert said.code == 3
    assert "it has no batch.json" in said.err


@pytest.mark.filterwarnings("default")  # of dask and its worker processes
def test_what_lies_on_a_server_is_run_and_what_is_made_is_put_into_a_store(ordered, tmp_path: Path) -> None:
    pytest.importorskip("aiohttp")
    (tmp_path / "web").mkdir()
    for name, number in (("left.txt", "3"), ("right.txt", "4")):
        (tmp_path / "web" / name).write_text(number)
    with served(tmp_path / "web") as (address, fetched):
        (tmp_path / "order.yaml").write_text(ORDER.replace("right.txt", f"{address}/right.txt"))
        table = TABLE.replace("left.txt", f"{address}/left.txt").replace("right.txt", f"{address}/right.txt")
        (tmp_path / "table.csv").write_text(table.replace("true", ""))
        command = ("batch", "order.yaml", "-o", "november", "--publish", f"file://{tmp_path}/there", "--workers", "1")
        said = ordered(*command)
        assert said.code == 0, said.err
        assert sorted(fetched) == ["/left.txt", "/right.txt"]  # named by three rows each, or two
        for row, value in (("a", 2 * 3 + 2 * 4 + 1), ("b", 2 * 4 + 2 * 4 + 2), ("c", 2 * 3 + 2 * 4)):
            assert (tmp_path / "there/rows" / row / "out/squared.txt").read_text() == str(value**2)
        made = {path.relative_to(tmp_path / "november") for path in (tmp_path / "november").rglob("page.html")}
        there = {
            path.relative_to(tmp_path / "there"): path for path in (tmp_path / "there").rglob("*") if path.is_file()
        }
        assert made <= set(there)
        assert all((tmp_path / "november" / name).read_bytes() == path.read_bytes() for name, path in there.items())
        again = ordered(*command)
        assert "3 of 3 rows are done and unchanged" in again.err
        assert "0 files were copied" in again.err
        assert len(fetched) == 2
        (tmp_path / "there").rename(tmp_path / "elsewhere")
        (tmp_path / "there").write_text("no folder")
        refused = ordered(*command)
        assert refused.code == 3, refused.err
        (tmp_path / "table.csv").write_text(table.replace(f"{address}/right", f"{address}/nowhere"))
        missing = ordered(*command)
        assert missing.code == 3
        assert f"row b, {address}/nowhere.txt" in missing.err.replace("\n", "")
