"""vto run, plan, report: what goes to stdout, what to stderr, and with which exit code."""

from __future__ import annotations

import errno
import json
from dataclasses import replace
from pathlib import Path

import pytest
from toy_tables import CALLS, STAGES, TOY

from vto_pipeline.cli.results import result_lines
from vto_pipeline.errors import DivergedError, MissingDependencyError
from vto_pipeline.model.body import Measurements
from vto_pipeline.stages import CATALOGUE
from vto_pipeline.stages.entry import planning
from vto_pipeline.stages.entry.outcome import Outcome


def test_run_says_where_things_are(vto):
    said = vto("run", "toy.yaml")
    assert said.code == 0
    assert said.out.splitlines()[0].endswith(" s; stages: 7 ran, 0 from the cache, 1 left out")
    assert "  squared  runs/toy/out/squared.txt" in said.out.splitlines()
    assert "warning from add: toy sum" in said.out
    lines = said.err.splitlines()
    assert "[1/7] left.double  twice the left" in lines
    assert "         note: left.txt: read as a decimal number" in lines
    assert any(line.startswith("[3/7] add  done in ") for line in lines)
    assert Path("runs/toy/out/squared.txt").read_text() == "196"


def test_a_second_run_comes_from_the_cache(vto):
    vto("run", "toy.yaml", "-o", "there")
    said = vto("run", "toy.yaml", "-o", "there")
    assert "stages: 1 ran, 6 from the cache, 1 left out" in said.out
    assert "[3/7] add  from the cache" in said.err


def test_a_result_that_takes_the_place_of_another_says_so(vto):
    """Where the folder was not named, that is: who names it again means it."""
    text, held = Path("toy.yaml").read_text(), "runs/toy held the result of another left.number; it holds this one now"
    Path("other.txt").write_text("5")
    assert held not in vto("run", "toy.yaml").err
    assert held not in vto("run", "toy.yaml").err
    Path("toy.yaml").write_text(text.replace("left.txt", "other.txt"))
    assert held not in vto("run", "toy.yaml", "-o", "runs/toy").err
    Path("toy.yaml").write_text(text)
    assert held in vto("run", "toy.yaml").err


def test_json_is_alone_on_stdout(vto):
    said = vto("run", "toy.yaml", "--json", "--set", "add.offset=1")
    assert said.code == 0
    assert said.data["run"] == "runs/toy"
    assert said.data | {"run": 0, "seconds": 0} == json.loads(Path("runs/toy/run.json").read_text()) | {
        "run": 0,
        "seconds": 0,
    }
    assert Path("runs/toy/out/total.txt").read_text() == "15"


def test_a_misspelt_setting_is_located(vto):
    Path("toy.yaml").write_text(Path("toy.yaml").read_text().replace("offset: 0", "ofset: 5000"))
    said = vto("run", "toy.yaml")
    assert said.code == 2
    assert said.out == ""
    assert said.err == (
        "error: stages.add.ofset: unknown key (got 5000)\n  in toy.yaml, line 7\n  hint: did you mean offset?\n"
    )
    assert not Path("runs").exists()


def test_errors_are_json_too_where_json_is_asked_for(vto):
    said = vto("run", "toy.yaml", "--json", "--set", "add.ofset=1")
    assert said.code == 2
    assert said.data == {
        "error": {
            "kind": "ConfigError",
            "problem": "stages.add.ofset: unknown key (got 1)",
            "where": "--set add.ofset=1",
            "hint": "did you mean offset?",
        },
        "exit_code": 2,
    }


def test_a_missing_document_and_a_missing_input(vto):
    said = vto("run", "tody.yaml")
    assert (said.code, "did you mean toy.yaml?" in said.err) == (2, True)
    Path("left.txt").unlink()
    said = vto("run", "toy.yaml")
    assert said.code == 3
    assert "given.left.number: no such file or folder" in said.err
    assert "toy.yaml, line 3" in said.err
    assert not CALLS


def test_a_failed_computation_keeps_the_partial_result(vto):
    said = vto("run", "toy.yaml", "--set", "add.fail=true")
    assert said.code == 4
    assert "error: sum diverged" in said.err
    assert "in stage add" in said.err
    assert "hint: use smaller numbers; the partial result is in runs/toy/out/partial" in said.err
    assert Path("runs/toy/out/partial/total.txt").read_text() == "-1"


@pytest.mark.parametrize(
    ("raised", "code", "message"),
    [
        (KeyboardInterrupt(), 130, "interrupted; run the same command again to resume"),
        (ModuleNotFoundError("No module named 'open3d'", name="open3d"), 5, "hint: run `vto doctor`"),
        (MissingDependencyError("no open3d"), 5, "error: no open3d"),
        (DivergedError("blew up"), 4, "error: blew up"),
        (OSError(errno.ENOSPC, "No space left on device", "left"), 3, "error: the system refuses: No space left"),
    ],
)
def test_exit_codes(vto, monkeypatch, raised, code, message):
    def stop(*_):
        raise raised

    stages = [replace(stage, run=stop) if stage.name == "add" else stage for stage in STAGES]
    monkeypatch.setattr(planning, "catalogue", lambda: replace(TOY, stages=tuple(stages)))
    said = vto("run", "toy.yaml")
    assert said.code == code
    assert message in said.err
    monkeypatch.setattr(planning, "catalogue", lambda: TOY)
    assert vto("run", "toy.yaml").code == 0
    assert CALLS == ["add", "square", "parity", "label", "page"]  # what was done before is not done again


def test_our_own_bugs_keep_their_traceback(vto, monkeypatch):
    def stop(*_):
        raise ZeroDivisionError

    monkeypatch.setattr(planning, "catalogue", lambda: replace(TOY, stages=(replace(STAGES[0], run=stop), *STAGES[1:])))
    with pytest.raises(ZeroDivisionError):
        vto("run", "toy.yaml")


def test_plan_runs_nothing_and_reads_like_a_table(vto):
    said = vto("plan", "toy.yaml")
    assert said.code == 0
    assert not CALLS
    assert not Path("runs").exists()
    lines = said.out.splitlines()
    assert lines[0] == "given: left.number, right.number"
    assert any(line.split() == ["3", "add", "-", "-", "left_doubled,", "right_doubled", "total"] for line in lines)
    assert "and 1 stages that work on what is not given; -v lists them" in lines
    told = vto("plan", "toy.yaml", "-v").out.splitlines()
    assert any(line.split() == ["guess", "word", "not", "given"] for line in told)
    assert max(map(len, lines)) <= 100
    data = vto("plan", "toy.yaml", "--json").data
    assert [stage["name"] for stage in data["stages"]][2] == "add"
    assert data["stages"][2]["settings"] == {"offset": 0, "fail": False}
    assert data["left_out"] == [{"name": "guess", "reason": "word not given"}]


def test_plan_knows_what_is_stored_and_what_the_rest_took(vto):
    vto("run", "toy.yaml")
    costs = {stage["name"]: stage["expected"] for stage in vto("plan", "toy.yaml", "--json").data["stages"]}
    assert [name for name, cost in costs.items() if not cost["stored"]] == ["page"]  # written anew each time
    record = json.loads(Path("runs/toy/run.json").read_text())
    took = {stage["name"]: stage["seconds"] for stage in record["stages"]}
    assert costs["add"]["seconds"] == took["add"]
    changed = vto("plan", "toy.yaml", "--json", "--set", "add.offset=1").data["stages"]
    assert {stage["name"] for stage in changed if stage["expected"]["stored"]} == {"left.double", "right.double"}
    added = next(stage["expected"]["seconds"] for stage in changed if stage["name"] == "add")
    assert added == pytest.approx(max(took["add"], 1e-3))  # clocks tell milliseconds apart: none is forecast shorter
    forced = vto("plan", "toy.yaml", "--json", "--force-all").data["stages"]
    assert not any(stage["expected"]["stored"] for stage in forced)  # those results were made with work left out
    lines = vto("plan", "toy.yaml", "-o", "elsewhere").out
    assert "their time is not known" in lines
    Path("toy.yaml").write_text(Path("toy.yaml").read_text().replace(", label, page", ""))
    assert "nothing to run: all results are stored" in vto("plan", "toy.yaml").out
    assert not CALLS


def test_until_stops_after_a_stage(vto):
    said = vto("run", "toy.yaml", "--until", "add")
    assert said.code == 0
    assert Path("runs/toy/out/total.txt").is_file()
    assert not Path("runs/toy/out/squared.txt").exists()
    said = vto("run", "toy.yaml", "--until", "ad")
    assert (said.code, "did you mean add?" in said.err) == (2, True)
    said = vto("run", "toy.yaml", "--until", "guess")
    assert (said.code, "guess is left out: word not given" in said.err) == (2, True)


def test_from_makes_a_stage_and_what_depends_on_it_anew(vto):
    vto("run", "toy.yaml")
    first = Path("runs/toy/out/squared.txt").read_bytes()
    said = vto("run", "toy.yaml", "--from", "add", "--json")
    states = {stage["name"]: stage["status"] for stage in said.data["stages"]}
    assert (states["left.double"], states["add"], states["square"]) == ("cached", "ran", "ran")
    assert Path("runs/toy/out/squared.txt").read_bytes() == first
    assert vto("run", "toy.yaml", "--from", "nothing").code == 2


@pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="no peak of a stage elsewhere")
def test_a_memory_budget_stands_beside_the_peak_and_is_not_begun_where_earlier_runs_took_more(vto):
    said = vto("run", "toy.yaml", "--memory", "1MB")
    assert said.code == 0  # nothing is known of stages that never ran,
    (line,) = (line for line in said.out.splitlines() if "memory budget" in line)
    record = json.loads(Path("runs/toy/run.json").read_text())
    most = max(record["stages"], key=lambda stage: stage["peak_mb"])
    found = f"at most {most['peak_mb'] / 1e3:.2g} GB, in {most['name']}"
    assert line == f"  memory budget of 0.001 GB: {found}, which is over it"
    said = vto("run", "toy.yaml", "--memory", "1MB", "--set", "add.offset=1")
    assert (said.code, said.out, CALLS) == (2, "", [])  # and then it is
    assert "error: add takes about " in said.err
    said = vto("run", "toy.yaml", "--memory", "0.9 TB", "--set", "add.offset=1")
    assert said.code == 0
    (line,) = (line for line in said.out.splitlines() if "memory budget" in line)
    assert line.startswith("  memory budget of 900 GB: at most ")
    assert "over" not in line
    assert not any("memory budget" in line for line in vto("run", "toy.yaml").out.splitlines())
    for text in ("8", "8gb", "-1GB"):
        assert vto("run", "toy.yaml", "--memory", text).code == 2


def test_quiet_and_a_log(vto):
    said = vto("run", "toy.yaml", "-q", "--log", "log.jsonl")
    assert said.err == ""
    assert "squared" in said.out
    events = [json.loads(line) for line in Path("log.jsonl").read_text().splitlines()]
    assert next(event["stage"] for event in events if event["event"] == "started") == "left.double"
    ended = {event["name"]: event for event in events if event["event"] == "ended"}
    assert ended["add"]["status"] == "ran"
    assert events[-1]["event"] == "done"
    assert vto("run", "toy.yaml", "--set", "add.fail=true", "-q", "--log", "log.jsonl").code == 4
    last = json.loads(Path("log.jsonl").read_text().splitlines()[-1])
    assert (last["event"], last["exit_code"]) == ("error", 4)
    assert vto("run", "toy.yaml", "--log", "no/such/folder/log").code == 2


def test_report_makes_the_page_again(vto):
    vto("run", "toy.yaml")
    Path("runs/toy/out/page.json").unlink()
    said = vto("report", "runs/toy", "--json")
    assert said.data == {"written": ["runs/toy/out/page.json"]}
    assert vto("report", ".").code == 3


def test_stages_and_schema(vto):
    assert [stage["name"] for stage in vto("stages", "--json").data] == [stage.name for stage in STAGES]
    table = vto("stages", "-v").out
    assert "add.offset" in table
    assert "added to the sum" in table
    schema = vto("schema").data
    assert schema == vto("schema", "--json").data
    assert "offset" in json.dumps(schema)


def test_a_run_folder_that_cannot_be_made_is_bad_usage(vto):
    for folder in ("left.txt/run", "/proc/no/such/place"):
        said = vto("run", "toy.yaml", "-o", folder)
        assert said.code == 2
        assert "the run's folder cannot be made or written to" in said.err
        assert "give another folder with -o" in said.err


def test_results_are_told_in_words_and_json_stays_alone(tmp_path):
    body = Measurements({"stature": 1.72, "waist_girth": 0.813, "knee_height": 0.48}, {"waist_girth": 0.0051})
    (tmp_path / "out").mkdir()
    CATALOGUE.kind("measurements").write(tmp_path / "out" / "measurements.json", body)
    CATALOGUE.kind("fit_report").write(tmp_path / "out" / "fit_report.json", {"verdict": "Chest tight (+3.3 cm)."})
    lines = list(result_lines(Outcome(tmp_path, {"wanted": ["avatar", "measurements", "fit_report"]}, CATALOGUE)))
    assert [line.split() for line in lines if "waist" in line] == [["waist", "81.3", "1.0"]]  # 1.96 times 0.51 cm
    assert [line.split() for line in lines if "stature" in line] == [["stature", "172.0", "-"]]
    assert not any("knee" in line for line in lines)
    assert lines[-1] == "fit: Chest tight (+3.3 cm)."
    (tmp_path / "out" / "fit_report.json").unlink()  # as after an interrupted run
    lines = list(result_lines(Outcome(tmp_path, {"wanted": ["measurements", "fit_report"]}, CATALOGUE)))
    assert not any("fit:" in line for line in lines)
