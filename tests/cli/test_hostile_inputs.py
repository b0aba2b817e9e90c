"""Every hostile input ends soon, in words, with the exit code of bad usage, bad input or a failed computation."""

from __future__ import annotations

import os
import time

import pytest
from hostile_inputs import CASES, write_inputs

from vto_pipeline.cli.main import main

SECONDS = 20.0
"""Of one processor, so that a busy machine fails nothing; of the clock, what waits for ever is caught by LONGEST."""
LONGEST = 120.0


pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """A folder that holds them all."""
    folder = tmp_path_factory.mktemp("hostile")
    write_inputs(folder)
    return folder


def processor_time():
    """Return what this process and its children have used [s]."""
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system


def test_there_are_many_of_every_command():
    commands = [arguments[0] for arguments in CASES.values()]
    assert len(CASES) > 120
    assert {command: commands.count(command) >= 5 for command in commands} == dict.fromkeys(
        ("scan", "fit", "drape", "run", "plan", "report"), True
    )


@pytest.mark.bad_file
@pytest.mark.parametrize("name", CASES)
def test_it_is_refused_in_words(name, inputs, monkeypatch, capfd):
    monkeypatch.chdir(inputs)
    began, spent = time.perf_counter(), processor_time()
    code = main(CASES[name])
    waited, spent = time.perf_counter() - began, processor_time() - spent
    out, err = capfd.readouterr()
    assert code in (2, 3, 4), f"{out}\n{err}"
    assert spent < SECONDS
    assert waited < LONGEST
    assert "Traceback" not in out + err
    assert "error: " in err.lower()
    assert out == ""
