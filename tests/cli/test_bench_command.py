"""vto bench."""

from __future__ import annotations

import json
from collections.abc import Iterator

import pytest

import vto_pipeline.bench as benches
from vto_pipeline.bench import sample_runs
from vto_pipeline.bench.bench import Bench, Row, Watch
from vto_pipeline.bench.sources import ROOT, contents_of
from vto_pipeline.bench.timing import Timing
from vto_pipeline.errors import MissingDependencyError


def toy_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    for k in range(1, 3):
        yield watch.row("hang 32", "reference" if k == 2 else "toy", {"substeps": k}, 1024, lambda k=k: _toy(k))


def _toy(k: int) -> tuple[Timing, dict]:
    return Timing(0.5 * k), {"rms_stretch": 10.0**-k, "mean_height_m": 0.5}


@pytest.fixture
def toy_bench(monkeypatch):
    monkeypatch.setattr(Bench, "rows", lambda self, quick, watch: toy_rows(quick, watch))


def test_unknown_name_lists_the_benches(vto):
    said = vto("bench", "solver")
    assert said.code == 2
    assert "solver" in said.err
    assert all(name in said.err for name in benches.BENCHES)


def test_a_name_is_needed(vto):
    assert vto("bench").code == 2


@pytest.mark.usefixtures("toy_bench")
def test_writes_both_files_and_speaks_on_stderr(vto, tmp_path):
    said = vto("bench", "solvers", "--out", tmp_path / "figures", "--json")
    assert said.code == 0
    (document,) = said.data["benches"]
    assert document["bench"] == "solvers"
    written = json.loads((tmp_path / "figures" / "solvers.json").read_text())
    assert written["rows"] == document["rows"]
    assert (tmp_path / "figures" / "solvers.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    assert "hang 32 toy substeps=1" in said.err


@pytest.mark.usefixtures("toy_bench")
def test_a_second_run_measures_nothing(vto, tmp_path):
    vto("bench", "solvers", "--out", tmp_path)
    again = vto("bench", "solvers", "--out", tmp_path)
    assert again.code == 0
    assert "substeps=1" not in again.err
    assert "substeps=1" in vto("bench", "solvers", "--out", tmp_path, "--force").err


@pytest.mark.usefixtures("toy_bench")
def test_against_other_programs(vto, tmp_path):
    peer = {"scene": "hang", "N": 32, "peer": "other", "params": {}, "seconds": 2.0, "rms_stretch": 0.2, "com_z": 0.5}
    (tmp_path / "peers.jsonl").write_text(json.dumps(peer))
    said = vto("bench", "solvers", "--out", tmp_path, "--against", tmp_path / "peers.jsonl")
    assert said.code == 0
    assert "other" in said.out
    assert "0.250" in said.out
    assert vto("bench", "scaling", "--out", tmp_path, "--against", tmp_path / "peers.jsonl").code == 2
    assert vto("bench", "solvers", "--out", tmp_path, "--against", tmp_path / "absent.jsonl").code == 3


@pytest.mark.usefixtures("toy_bench")
def test_all_stands_for_every_bench_and_sample_document(vto, tmp_path, monkeypatch):
    ran = []
    monkeypatch.setattr(
        sample_runs, "run_sample", lambda name, folder, **_: ran.append(name) or {"bench": name, "rows": []}
    )
    monkeypatch.setattr(benches, "BENCHES", {name: benches.BENCHES[name] for name in ("solvers", "peers")})
    said = vto("bench", "all", "--out", tmp_path, "--json")
    assert said.code == 0, said.err
    assert [document["bench"] for document in said.data["benches"]] == ["solvers", "peers", *sample_runs.SAMPLES]
    assert ran == list(sample_runs.SAMPLES)
    assert vto("bench", "all", "demo", "--out", tmp_path).code == 0


def test_all_leaves_out_what_is_not_installed_and_a_name_does_not(vto, tmp_path, monkeypatch):
    def absent(self, quick, watch):
        raise MissingDependencyError("none of the peers is installed")

    monkeypatch.setattr(Bench, "rows", absent)
    monkeypatch.setattr(sample_runs, "SAMPLES", ())
    said = vto("bench", "all", "--out", tmp_path)
    assert (said.code, said.out) == (0, "")
    assert "bench peers is left out: none of the peers is installed" in said.err
    assert vto("bench", "peers", "--out", tmp_path).code == 5


@pytest.mark.usefixtures("toy_bench")
def test_what_got_worse_is_listed(vto, tmp_path):
    vto("bench", "solvers", "--out", tmp_path / "old")
    vto("bench", "solvers", "--out", tmp_path / "new")
    same = vto("bench", "--compare", tmp_path / "old", "--out", tmp_path / "new")
    assert (same.code, same.out.splitlines()[-1]) == (0, "nothing changed")
    path = tmp_path / "new" / "solvers.json"
    path.write_text(path.read_text().replace('"rms_stretch": 0.1', '"rms_stretch": 0.3'))
    said = vto("bench", "solvers", "--compare", tmp_path / "old", "--out", tmp_path / "new")
    assert said.out.splitlines()[-1].split() == [
        "worse",
        "solvers",
        "hang",
        "32,",
        "toy,",
        "substeps=1",
        "rms_stretch",
        "0.1",
        "0.3",
    ]
    data = vto("bench", "--compare", tmp_path / "old", "--out", tmp_path / "new", "--json").data
    assert [change["verdict"] for change in data[0]["changes"]] == ["worse"]
    assert vto("bench", "--compare", tmp_path, "--out", tmp_path / "new").code == 3


def test_results_older_than_their_code_are_listed(vto, tmp_path):
    own = contents_of([ROOT / "vto_pipeline/errors.py"])
    rows = [{"method": "a", "seconds": 2.0, "runs": 3, "compile_s": 1.5}, {"method": "b", "seconds": 4.0}]
    rows.append({"method": "all stages", "seconds": 6.0})  # the others once more
    heads = {"fresh": own, "old": {**own, "vto_pipeline/units.py": "0" * 40}, "older": None}
    for name, sources in heads.items():
        kept = {} if sources is None else {"sources": sources}
        head = {"date": "2026-11-24", "commit": "abc", "rows": rows}
        (tmp_path / f"{name}.json").write_text(json.dumps({**head, **kept}))
    said = vto("bench", "--stale", "--out", tmp_path)
    assert (said.code, [line.split()[0] for line in said.out.splitlines()[2:]]) == (0, ["fresh", "old", "older"])
    fresh, old, older = said.out.splitlines()[2:]
    assert fresh.endswith("1, all as they were")
    assert old.endswith("1 of 2 changed: vto_pipeline/units.py")
    assert older.endswith("not kept: measured by an earlier version")
    data = vto("bench", "--stale", "--out", tmp_path, "--json").data
    assert [one["least_s"] for one in data] == [2.0 * 3 + 1.5 + 4.0] * 3
    assert [one["changed"] for one in data] == [[], ["vto_pipeline/units.py"], None]
    assert vto("bench", "--stale", "--out", tmp_path / "nowhere").code == 3
