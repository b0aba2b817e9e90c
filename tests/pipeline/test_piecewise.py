"""A stage that is made piece by piece goes on where it was interrupted, by a kill too."""

from __future__ import annotations

import os
import signal
from dataclasses import replace
from pathlib import Path

import pytest
from toy_tables import TOY

from vto_pipeline.io.documents import load_yaml
from vto_pipeline.pipeline.execution.run import run
from vto_pipeline.pipeline.execution.store import Store
from vto_pipeline.pipeline.plan import make_plan
from vto_pipeline.pipeline.request import read_request

PIECES = 5


class Stopped(Exception):
    pass


@pytest.fixture
def go(tmp_path):
    """Run `add`, made of five pieces, until it has `most` of them; return the total and the pieces made."""
    (tmp_path / "left.txt").write_text("3")
    (tmp_path / "toy.yaml").write_text("schema: 1\ngiven: {left: {number: left.txt}}\nwant: [total]\n")

    def go(most, how=None, overrides=(), afresh=None):
        made = []

        def add(inputs, settings, job):
            for k in range(PIECES):
                piece = job.kept / f"{k}.txt"
                if piece.exists():
                    continue
                if k == most:
                    how()
                piece.write_text("1")
                made.append(k)
            total = sum(int(p.read_text()) for p in job.kept.iterdir())
            return {"total": total + inputs["left_doubled"] + settings.offset}

        stages = tuple(replace(row, run=add, piecewise=True) if row.name == "add" else row for row in TOY.stages)
        tables = replace(TOY, stages=stages)
        request = read_request(load_yaml(tmp_path / "toy.yaml"), tmp_path, tables, overrides)
        run(request, make_plan(request, tables), tables, tmp_path / "run", afresh=afresh)
        return int((tmp_path / "run" / "out" / "total.txt").read_text()), made

    return go


def stop():
    raise Stopped


def kept(folder: Path) -> list[Path]:
    return sorted((folder / "run" / "cache" / "add").glob("*.kept"))


def test_pieces_outlive_an_interruption_and_go_with_the_result(go, tmp_path):
    with pytest.raises(Stopped):
        go(3, stop)
    assert len(kept(tmp_path)) == 1
    assert go(PIECES) == (11, [3, 4])
    assert kept(tmp_path) == []


def test_pieces_outlive_a_kill(go, tmp_path):
    if not (child := os.fork()):
        go(2, lambda: os.kill(os.getpid(), signal.SIGKILL))
    assert os.WTERMSIG(os.waitpid(child, 0)[1]) == signal.SIGKILL
    assert go(PIECES) == (11, [2, 3, 4])


def test_pieces_of_other_settings_are_not_taken(go):
    with pytest.raises(Stopped):
        go(3, stop)
    assert go(PIECES, overrides=["add.offset=2"]) == (13, [0, 1, 2, 3, 4])


def test_what_is_made_afresh_begins_at_its_first_piece(go):
    with pytest.raises(Stopped):
        go(3, stop)
    assert go(PIECES, afresh="add") == (11, [0, 1, 2, 3, 4])


def test_prune_removes_pieces_that_no_run_is_making(go, tmp_path):
    with pytest.raises(Stopped):
        go(3, stop)
    store = Store(tmp_path / "run" / "cache")
    key = kept(tmp_path)[0].stem
    with store.claimed("add", key):
        store.remove_others([])
        assert len(kept(tmp_path)) == 1
    assert store.remove_others([])[0] >= 1
    assert kept(tmp_path) == []
