"""What goes wrong around a run: files that change, a clock set back, runs that begin while another cleans up."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import toy_tables
from toy_tables import CALLS, TOY

from vto_pipeline.errors import ComputationError, InputError
from vto_pipeline.io import stalls
from vto_pipeline.pipeline.catalogue import Catalogue
from vto_pipeline.pipeline.execution.listener import Listener
from vto_pipeline.pipeline.execution.run import run
from vto_pipeline.pipeline.execution.store import Store
from vto_pipeline.pipeline.plan import make_plan

DOCUMENT = "schema: 1\ngiven: {left: {number: left.txt}, right: {number: right.txt}}\nwant: [squared, page]\n"


@pytest.fixture
def meanwhile(ask, tmp_path):
    """Run the document while something happens inside the stage left.double, which has read left.txt (3)."""

    def meanwhile(happens: Callable[[], object]) -> dict:
        (row,) = (stage for stage in TOY.stages if stage.name == "left.double")

        def double(inputs, settings, job):
            happens()
            return row.run(inputs, settings, job)

        stages = tuple(replace(row, run=double) if stage is row else stage for stage in TOY.stages)
        tables = Catalogue(stages, toy_tables.KINDS, toy_tables.GIVEN)
        request = ask(DOCUMENT)
        return run(request, make_plan(request, tables), tables, tmp_path / "run")

    return meanwhile


def squared(tmp_path: Path) -> str:
    return (tmp_path / "run" / "out" / "squared.txt").read_text()


def test_what_was_made_of_a_file_that_changed_meanwhile_does_not_count(meanwhile, go, tmp_path):
    left = tmp_path / "left.txt"
    with pytest.raises(InputError, match="given.left.number has changed while it was read") as caught:
        meanwhile(lambda: left.write_text("5"))
    assert caught.value.where == str(left)
    assert not (tmp_path / "run" / "out" / "squared.txt").exists()
    left.write_text("3")  # the digest under which a result of 3 or 5 would lie
    go(DOCUMENT)
    assert CALLS[0] == "left.double"
    assert squared(tmp_path) == str((2 * 3 + 2 * 4) ** 2)


def test_a_failure_over_a_file_that_changed_is_told_as_such(meanwhile, tmp_path):
    def half_written() -> None:
        (tmp_path / "left.txt").write_text("")
        raise ComputationError("no number in it")

    with pytest.raises(InputError, match="has changed while it was read"):
        meanwhile(half_written)


def test_a_file_that_vanishes_is_named(meanwhile, tmp_path):
    with pytest.raises(InputError, match="the file was there before and has vanished") as caught:
        meanwhile((tmp_path / "left.txt").unlink)
    assert caught.value.where == str(tmp_path / "left.txt")


def test_a_folder_that_stalls_while_a_result_is_written_is_told_and_waited_for(ask, tmp_path, monkeypatch):
    """Nothing is written until it has been told; were it not, that would take too long."""
    monkeypatch.setattr(stalls, "_PATIENCE", 0.2)
    told, said = threading.Event(), []

    def stalled(path, value):
        assert told.wait(60.0)
        toy_tables.write_number(path, value)

    kinds = tuple(replace(kind, write=stalled) if kind.name == "total" else kind for kind in toy_tables.KINDS)
    tables = Catalogue(TOY.stages, kinds, toy_tables.GIVEN)
    listener = Listener()
    listener.warned = lambda text: (said.append(text), told.set())
    request = ask(DOCUMENT)
    run(request, make_plan(request, tables), tables, tmp_path / "run", listener=listener)
    assert squared(tmp_path) == "196"
    assert len(said) == 1
    assert str(tmp_path / "run" / "cache") in said[0]


def test_a_folder_that_answers_is_not_blamed(tmp_path, monkeypatch):
    monkeypatch.setattr(stalls, "_PATIENCE", 0.2)
    said = []
    with stalls.told_if_stalled(tmp_path, said.append):
        pass
    time.sleep(0.6)
    assert said == []


def test_a_change_of_nothing_but_dates_is_none(meanwhile, tmp_path):
    meanwhile(lambda: os.utime(tmp_path / "left.txt", (1, 1)))
    assert squared(tmp_path) == "196"


@pytest.mark.parametrize("date", [0, 2**31], ids=["long ago", "to come"])
def test_a_clock_set_back_or_forth_changes_nothing(go, tmp_path, date):
    """After it, files have dates that lie ahead or far behind."""
    go(DOCUMENT)
    for path in [*tmp_path.rglob("*"), tmp_path]:
        os.utime(path, (date, date))
    go(DOCUMENT)
    assert CALLS == ["page"]
    (tmp_path / "left.txt").write_text("5")
    os.utime(tmp_path / "left.txt", (date, date))  # the same date, the same size
    go(DOCUMENT)
    assert CALLS == ["left.double", "add", "square", "page"]
    assert squared(tmp_path) == str((2 * 5 + 2 * 4) ** 2)


def test_a_result_that_is_just_being_begun_is_not_swept_away(tmp_path, monkeypatch):
    """The other run sweeps between the making of the folder and its being held."""
    store, made = Store(tmp_path), []

    def making_and_sweeping(real):
        def mkdtemp(**options):
            made.append(real(**options))
            Store(tmp_path).sweep()
            return made[-1]

        return mkdtemp

    module = "vto_pipeline.pipeline.execution.store.tempfile.mkdtemp"
    monkeypatch.setattr(module, making_and_sweeping(__import__("tempfile").mkdtemp))
    with store.making("add") as folder:
        assert folder.is_dir()
    assert made == [str(folder)]
