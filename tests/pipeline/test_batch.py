"""Batches on the toy tables: the rows of a table, limits and retries of a row, results shared by runs."""

from __future__ import annotations

import json
import math
import shlex
import shutil
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest
from toy_tables import TOY

from vto_pipeline.errors import ConfigError, InputError
from vto_pipeline.io.files import check_inside
from vto_pipeline.pipeline.batch import ledger as ledger_module
from vto_pipeline.pipeline.batch.ledger import LEDGER, Ledger, read_ledger
from vto_pipeline.pipeline.batch.order import read_order
from vto_pipeline.pipeline.batch.roots import Roots
from vto_pipeline.pipeline.batch.row import RowResult, RowTask, run_row
from vto_pipeline.pipeline.execution.store import Store
from vto_pipeline.stages.entry import planning
from vto_pipeline.stages.entry.batches import plan_rows

RUN = "run: {schema: 1, given: {left: {number: left.txt}}, want: [total]}\n"


def order(folder: Path, text: str, **tables: str) -> list:
    """The rows of a batch document beside left.txt, right.txt and tables."""
    for name, number in (("left.txt", "3"), ("right.txt", "4")):
        (folder / name).write_text(number)
    for name, table in tables.items():
        (folder / f"{name}.csv").write_text(table)
    (folder / "batch.yaml").write_text(f"schema: 1\n{text}")
    return read_order(folder / "batch.yaml")


def test_a_table_changes_keys_and_leaves_the_rest(tmp_path: Path) -> None:
    table = "name,given.right.number,stages.add.offset,seed\na,right.txt,5,\nb,,,7\n"
    first, second = order(tmp_path, f"{RUN}rows: table.csv\n", table=table)
    left, right = (str((tmp_path / name).resolve()) for name in ("left.txt", "right.txt"))
    assert (first.name, second.name) == ("a", "b")
    assert first.data["given"] == {"left": {"number": left}, "right": {"number": right}}
    assert first.data["stages"] == {"add": {"offset": 5}}
    assert "seed" not in first.data
    assert second.data == {"schema": 1, "given": {"left": {"number": left}}, "want": ["total"], "seed": 7}
    assert second.where.endswith("table.csv, row 3")


def test_blank_rows_of_a_spreadsheet_are_no_rows(tmp_path: Path) -> None:
    rows = order(tmp_path, f"{RUN}rows: table.csv\n", table="name,seed\n\na,1\n,\n , \nb,2\n,\n")
    assert [(row.name, row.data["seed"]) for row in rows] == [("a", 1), ("b", 2)]
    assert [row.where.rsplit(" ", 1)[1] for row in rows] == ["3", "6"]  # as a spreadsheet numbers them


def test_a_name_stays_as_it_is_written(tmp_path: Path) -> None:
    names = ["1e3", "007", "1.50", "true", "18"]
    table = "name,seed\n" + "".join(f"{name},1\n" for name in names)
    assert [row.name for row in order(tmp_path, f"{RUN}rows: table.csv\n", table=table)] == names


def test_every_combination_becomes_a_row(tmp_path: Path) -> None:
    text = (
        RUN
        + "rows: [{name: a}, {name: b}]\nevery: {stages.add.offset: [1, 2], given.left.number: [left.txt, right.txt]}\n"
    )
    rows = order(tmp_path, text)
    assert [row.name for row in rows][:3] == ["a_1_left", "a_1_right", "a_2_left"]
    assert len(rows) == 8
    assert len(order(tmp_path, RUN + "every: {seed: [1, 2, 3]}\n")) == 3


def test_a_table_in_parquet_is_the_same_as_in_csv(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    pyarrow = pytest.importorskip("pyarrow")
    columns = {"name": ["a", "b"], "stages.add.offset": [5, None]}
    parquet.write_table(pyarrow.table(columns), tmp_path / "table.parquet")
    rows = order(tmp_path, f"{RUN}rows: table.parquet\n")
    assert [row.data.get("stages") for row in rows] == [{"add": {"offset": 5}}, None]


@pytest.mark.parametrize(
    ("text", "table", "problem"),
    [
        (RUN, "", "the batch has no rows"),
        (f"{RUN}rows: []\n", "", "the batch has no rows"),
        (f"{RUN}rows: table.csv\n", "name\na\na\n", "the name 'a' is there 2 times"),
        (f"{RUN}rows: table.csv\n", "name\n../a\n", "'../a' is not a valid name"),
        (f"{RUN}rows: table.csv\n", "fabric\ndenim\n", "'fabric' is not a key of a pipeline document"),
        (f"{RUN}rows: table.csv\n", "name\na,b\n", "more cells than the head"),
        (f"{RUN}rows: table.csv\n", "name,seed,seed\na,1,2\n", "the column 'seed' is there 2 times"),
        (f"{RUN}rows: nowhere.csv\n", "", "no such file"),
        (f"{RUN}every: {{seed: {list(range(400))}, stages.add.offset: {list(range(400))}}}\n", "", "160000 rows"),
        (f"{RUN}cows: table.csv\n", "", "cows: unknown key"),
    ],
)
def test_a_wrong_batch_is_refused_with_its_place(tmp_path: Path, text: str, table: str, problem: str) -> None:
    with pytest.raises(ConfigError, match="^") as caught:
        order(tmp_path, text, table=table)
    assert problem in caught.value.problem


@pytest.fixture
def fenced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A batch in a folder of its own, read and planned so that it stays there; a file beside that folder."""
    monkeypatch.setattr(planning, "catalogue", lambda: TOY)
    (tmp_path / "secret.txt").write_text("7")
    home = tmp_path / "home"
    home.mkdir()

    def plan(text: str) -> list:
        order(home, text)
        rows = read_order(home / "batch.yaml", Roots((str(home),)))
        return plan_rows(rows, Store(tmp_path / "cache"), lambda *_: False, False, Roots((str(home),)))

    return plan


def test_a_batch_with_a_root_reads_what_is_in_it(fenced) -> None:
    assert len(fenced(f"{RUN}every: {{seed: [1, 2]}}\n")) == 2


def test_all_wrong_rows_are_told_at_once(fenced) -> None:
    """Whoever has a table of a hundred rows would otherwise mend one, wait, and read of the next."""
    wrong = [f"{{name: w{i}, given.left.number: none_{i}.txt}}" for i in range(23)]
    rows = ["{name: a}", "{name: b, given.left.number: gone.txt}", "{name: c, stages.add.offset: far}", *wrong]
    with pytest.raises(InputError, match="gone.txt") as caught:  # the first
        fenced(f"{RUN}rows: [{', '.join(rows)}]\n")
    assert "row b" in caught.value.where
    assert "25 rows are wrong" in caught.value.hint
    assert "row c: stages.add.offset: input should be a valid" in caught.value.hint
    assert "none_18.txt" in caught.value.hint
    assert "none_19.txt" not in caught.value.hint  # nobody reads a thousand lines
    assert caught.value.hint.endswith("and 4 more")


@pytest.mark.parametrize(
    "given",
    [
        "../secret.txt",
        "{home}/../secret.txt",
        "{outside}",
        "link.txt",
        "down/../../secret.txt",
    ],
)
def test_a_batch_with_a_root_reads_nothing_outside_it(fenced, tmp_path: Path, given: str) -> None:
    (tmp_path / "home" / "down").mkdir()
    (tmp_path / "home" / "link.txt").symlink_to(tmp_path / "secret.txt")
    outside = str(tmp_path / "secret.txt")
    given = given.format(home=tmp_path / "home", outside=outside)
    with pytest.raises(ConfigError, match=r"lies outside .*home"):
        fenced(f"{RUN}rows: [{{given.left.number: '{given}'}}]\n")


def test_what_is_not_in_the_folder_of_a_batch_is_not_looked_for_from_the_top(fenced, tmp_path: Path) -> None:
    given = str(tmp_path / "secret.txt").lstrip("/")
    with pytest.raises(InputError, match=f"no such file or folder: {tmp_path}/home/{given}"):
        fenced(f"{RUN}rows: [{{given.left.number: '{given}'}}]\n")


@pytest.mark.parametrize("text", ["run: ../run.yaml\nevery: {seed: [1]}\n", f"{RUN}rows: ../table.csv\n"])
def test_the_parts_of_a_batch_with_a_root_lie_in_it(fenced, tmp_path: Path, text: str) -> None:
    (tmp_path / "run.yaml").write_text("schema: 1\ngiven: {}\nwant: [total]\n")
    (tmp_path / "table.csv").write_text("name\na\n")
    (tmp_path / "home/batch.yaml").write_text(f"schema: 1\n{text}")
    with pytest.raises(ConfigError, match="lies outside"):
        read_order(tmp_path / "home/batch.yaml", Roots((str(tmp_path / "home"),)))


def test_links_in_a_folder_do_not_lead_out_of_a_root(tmp_path: Path) -> None:
    (tmp_path / "home/photos").mkdir(parents=True)
    (tmp_path / "home/a.png").write_bytes(b"1")
    (tmp_path / "b.png").write_bytes(b"2")
    (tmp_path / "home/photos/a.png").symlink_to(tmp_path / "home/a.png")
    check_inside(tmp_path / "home/photos", [tmp_path / "home"], "here")
    (tmp_path / "home/photos/b.png").symlink_to("../../b.png")
    with pytest.raises(ConfigError, match="lies outside"):
        check_inside(tmp_path / "home/photos", [tmp_path / "home"], "here")


def task(folder: Path, program: str, **limits: float) -> RowTask:
    values = {"seconds": 60.0, "memory_mb": 2000.0, "retries": 0} | limits
    command, run, log = (sys.executable, "-c", program), str(folder / "rows" / "a"), str(folder / "logs" / "a.log")
    return RowTask("a", "k", command, run, log, 1, **values)


def test_a_row_says_how_it_ended(tmp_path: Path) -> None:
    done = run_row(task(tmp_path, "import sys; print('{}'); print('heard', file=sys.stderr)"))
    assert (done.status, done.exit_code, done.problem, done.tries) == ("done", 0, "", 1)
    assert (tmp_path / "logs" / "a.log").read_text() == "heard\n"
    error = json.dumps({"error": {"problem": "no such file", "where": "b.yaml", "hint": ""}})
    refused = run_row(task(tmp_path, f"import sys; print({error!r}); sys.exit(3)"))
    assert (refused.status, refused.problem) == ("refused", "no such file (b.yaml)")
    assert run_row(task(tmp_path, "import sys; sys.exit(4)")).status == "failed"


def test_a_crash_is_tried_again_and_a_failure_is_not(tmp_path: Path) -> None:
    count = f"open({str(tmp_path / 'count')!r}, 'a').write('x')"
    crashed = run_row(task(tmp_path, f"{count}; import os; os.kill(os.getpid(), 11)", retries=2))
    assert (crashed.status, crashed.exit_code, crashed.tries) == ("crashed", -11, 3)
    assert len((tmp_path / "count").read_text()) == 3
    run_row(task(tmp_path, f"{count}; import sys; sys.exit(4)", retries=2))
    assert len((tmp_path / "count").read_text()) == 4


def has_ended(pid: int) -> bool:
    """Whether a process that was killed is gone within a minute, or waits only for somebody to take note of its end."""
    for _ in range(600):
        try:
            if Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z":
                return True
        except (FileNotFoundError, ProcessLookupError):
            return True
        time.sleep(0.1)
    return False


def test_limits_end_a_row_and_all_that_it_has_started(tmp_path: Path) -> None:
    pid = tmp_path / "pid"
    shell = ("sh", "-c", f"sleep 1000 & echo $! > {shlex.quote(str(pid))}; wait")  # it begins at once, on any machine
    late = run_row(replace(task(tmp_path, "", seconds=3.0), command=shell))
    assert (late.status, late.problem) == ("too long", "it takes longer than 3 s")
    assert 3.0 <= late.seconds < 500.0  # not the thousand of the child
    assert has_ended(int(pid.read_text()))
    large = run_row(task(tmp_path, "import time; x = bytearray(300_000_000); time.sleep(60)", memory_mb=150.0))
    assert (large.status, large.problem) == ("too large", "it needs more than 150 MB of memory")
    assert large.peak_mb > 150.0


@pytest.mark.skipif(shutil.which("setpriv") is None, reason="no setpriv (util-linux)")
def test_a_row_ends_with_the_worker_that_started_it(tmp_path: Path) -> None:
    pid = tmp_path / "pid"
    sleeper = f"import os, time; open({str(pid)!r}, 'w').write(f'{{os.getpid()}} '); time.sleep(100)"
    worker = f"from vto_pipeline.pipeline.batch.row import RowTask, run_row; run_row({task(tmp_path, sleeper)!r})"
    with subprocess.Popen([sys.executable, "-c", worker]) as process:
        while not (pid.is_file() and pid.read_text().endswith(" ")):
            time.sleep(0.05)
        process.kill()
    assert has_ended(int(pid.read_text()))


def test_a_row_waits_for_what_an_earlier_batch_has_left_at_work_there(tmp_path: Path) -> None:
    """The worker of a scheduler that died finishes its row; another process holds the folder meanwhile."""
    run = tmp_path / "rows" / "a"
    holder = (
        "import sys, time; from pathlib import Path; from vto_pipeline.pipeline.execution.folder import "
        f"locked_run_folder\nwith locked_run_folder(Path({str(run)!r})):\n    print(flush=True); sys.stdin.read()"
    )
    taken = (
        f"from pathlib import Path; from vto_pipeline.pipeline.execution.folder import locked_run_folder\n"
        f"with locked_run_folder(Path({str(run)!r})): pass"
    )
    with subprocess.Popen([sys.executable, "-c", holder], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        assert run_row(task(tmp_path, taken, seconds=1.0)).status != "done"  # no longer than a row may take
        ended: list[RowResult] = []
        row = threading.Thread(target=lambda: ended.append(run_row(task(tmp_path, taken))))
        row.start()
        row.join(1.0)
        assert row.is_alive()
        process.communicate()
        row.join()
    assert [one.status for one in ended] == ["done"]


def records(batch: Path, *names: str) -> None:
    """The records of runs in a batch's folder."""
    for name in names:
        (batch / "rows" / name).mkdir(parents=True)
        (batch / "rows" / name / "run.json").write_text("{}")


def test_the_ledger_knows_what_is_done(tmp_path: Path) -> None:
    records(tmp_path, "a")
    ledger = Ledger(tmp_path, ["a", "b"])
    ledger.enter(RowResult("a", "k", "done", 0, 2.5, 90.0, 1), "fits")
    again = Ledger(tmp_path, ["a", "b", "c"])
    assert [again.is_done(name, "k") for name in ("a", "b", "c")] == [True, False, False]
    assert not again.is_done("a", "another")
    assert [again.expected_seconds("a", key, None) for key in ("k", "another")] == [2.5, 2.5]
    assert [again.expected_seconds("a", key, 9.0) for key in ("k", "another")] == [2.5, 9.0]  # as early as before
    assert again.expected_seconds("a", "k", 1.0) == 1.0
    assert (again.expected_seconds("c", "k", None), again.expected_seconds("c", "k", 3.0)) == (math.inf, 3.0)
    again.enter(RowResult("b", "k", "lost", -9, 0.0, 0.0, 1), "")
    assert again.expected_seconds("b", "k", None) == math.inf  # 0 s would make it the last to begin
    assert read_ledger(tmp_path)["counts"] == {"done": 1, "lost": 1, "waiting": 1}
    shutil.rmtree(tmp_path / "rows" / "a")  # by hand
    assert read_ledger(tmp_path)["counts"] == {"lost": 1, "waiting": 2}
    assert not Ledger(tmp_path, ["a"]).is_done("a", "k")
    assert (tmp_path / "batch.csv").read_text().splitlines()[1] == "a,done,0,,2.5,90.0,1,fits,,,,"
    (tmp_path / LEDGER).write_text('{"rows": [{}]}')
    with pytest.raises(InputError, match="not the record of a batch"):
        Ledger(tmp_path, ["a"])


def test_what_ended_before_a_kill_is_in_the_ledger(tmp_path: Path) -> None:
    """A process enters rows and is killed by the system while it writes the next."""
    program = (
        "import os; from pathlib import Path\n"
        "from vto_pipeline.pipeline.batch.ledger import JOURNAL, Ledger\n"
        "from vto_pipeline.pipeline.batch.row import RowResult\n"
        "ledger = Ledger(Path('.'), [f'r{i}' for i in range(40)]); ledger.save()\n"
        "for i in range(30): ledger.enter(RowResult(f'r{i}', 'k', 'done', 0, 1.0, 1.0, 1), 'fits')\n"
        'with open(JOURNAL, \'a\') as journal: journal.write(\'{"name": "r30", "sta\')\n'
        "os.kill(os.getpid(), 9)"
    )
    killed = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, check=False)
    assert killed.returncode == -9
    records(tmp_path, *(f"r{i}" for i in range(30)))
    assert read_ledger(tmp_path)["counts"] == {"done": 30, "waiting": 10}
    names = [f"r{i}" for i in range(40)]
    again = Ledger(tmp_path, names)
    again.save()
    again.enter(RowResult("r30", "k", "failed", 4, 1.0, 1.0, 1, "sum diverged"), "")
    assert [name for name in names if Ledger(tmp_path, names).is_done(name, "k")] == names[:30]
    assert read_ledger(tmp_path)["rows"][30]["problem"] == "sum diverged"


@pytest.mark.parametrize("rows", [100, 2000])
def test_a_row_costs_the_same_in_any_batch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rows: int) -> None:
    """A clock on which a row ends each second, and the files take a millisecond for each row they list."""
    now, listed = 0.0, 0

    def write(path: Path, value: dict[str, list]) -> None:
        nonlocal now, listed
        now += 1e-3 * len(value["rows"])
        listed += len(value["rows"])

    monkeypatch.setattr(ledger_module, "write_json", write)
    monkeypatch.setattr(ledger_module.time, "monotonic", lambda: now)
    ledger = Ledger(tmp_path, [f"r{i}" for i in range(rows)])
    ledger.save()
    for i in range(rows):
        now += 1.0
        ledger.enter(RowResult(f"r{i}", "k", "done", 0, 1.0, 1.0, 1), "fits")
    assert 15 < listed / rows < 25  # 1 s : 1 ms : 50; if written after each row, as many as there are rows


def test_what_one_run_makes_others_wait_for(tmp_path: Path) -> None:
    """Two threads claim one result through stores of their own, as two runs do; the second finds it made."""
    made: list[str] = []

    def work(name: str) -> None:
        store = Store(tmp_path)
        with store.claimed("add", "key"):
            if store.find("add", "key") is None:
                with store.making("add") as folder:
                    time.sleep(0.3)
                    (folder / "total.txt").write_text("7")
                    store.finish(folder, "add", "key", {"total": "total.txt"}, {})
                made.append(name)

    threads = [threading.Thread(target=work, args=(name,)) for name in "ab"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(made) == 1


def test_sweeping_leaves_what_a_run_is_making(tmp_path: Path) -> None:
    program = (
        "import os, sys, time; from pathlib import Path; from vto_pipeline.pipeline.execution.store import Store\n"
        f"with Store(Path({str(tmp_path)!r})).making('add') as folder: print(folder, flush=True); time.sleep(60)"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        folder = Path(process.stdout.readline().strip())
        Store(tmp_path).sweep()
        assert folder.is_dir()
        process.kill()
    Store(tmp_path).sweep()
    assert not folder.exists()
