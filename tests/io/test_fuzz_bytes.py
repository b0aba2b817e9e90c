"""Bytes that nobody would write, in every reader: refused in words or read, and nothing else.

A finding of the fuzzer becomes a file in fuzz_seeds/, which is read each time from then on.
"""

from __future__ import annotations

import logging
import os
from pathlib import Path

import fuzz_targets
import numpy as np
import pytest
from fuzz_targets import TARGETS, fuzz

from vto_pipeline.errors import VtoError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.sandbox import run_limited

KEPT = sorted((Path(__file__).parent / "fuzz_seeds").glob("*-*"))
SECONDS_EACH = 0.5  # s of one execution on a busy machine, shrinking among them
QUICK, LONG = 10, int(os.environ.get("VTO_FUZZ", "2000"))  # executions for each reader


def counted(said: Arrays) -> int:
    """Return the number of executions, where nothing was found.

    Fails with the smallest bytes that were found, which belong into fuzz_seeds/TARGET-WHAT.
    """
    problem = bytes(said["problem"]).decode(errors="replace")
    assert not problem, f"{problem}; by {bytes(said['finding'])!r}"
    executions, refused = int(said["executions"]), int(said["refused"])
    assert 0.2 * executions < refused <= executions  # it does damage
    return executions


def fuzz_all(count: int, seed: int) -> Arrays:
    """In the child: fuzz every reader in turn, up to the first finding."""
    done = refused = 0
    for target in TARGETS:
        said = fuzz(target, count, seed)
        done, refused = done + int(said["executions"]), refused + int(said["refused"])
        if len(said["problem"]):
            return said
    return said | {"executions": np.array(done), "refused": np.array(refused)}


def test_every_reader_quickly() -> None:
    assert counted(run_limited(fuzz_all, QUICK, 1, seconds=600.0)) >= QUICK * len(TARGETS)


@pytest.mark.slow
def test_every_reader_at_length() -> None:
    """`VTO_FUZZ=35000 pytest -m slow tests/io/test_fuzz_bytes.py --log-cli-level=INFO`: a million executions."""
    limit = 60.0 + SECONDS_EACH * LONG
    done = sum(counted(run_limited(fuzz, target, LONG, LONG, seconds=limit)) for target in TARGETS)
    logging.getLogger(__name__).info("%d executions over %d readers", done, len(TARGETS))
    assert done >= LONG * len(TARGETS)


def read_seeds() -> Arrays:
    """In the child: read every kept finding."""
    count = 0
    for kept in KEPT:
        target = kept.name.split("-")[0]
        folder = Path(kept.name)
        folder.mkdir()
        path, read = fuzz_targets.sound_file(target, folder)
        path.write_bytes(kept.read_bytes())
        try:
            read(path)
        except VtoError:
            count += 1
    return {"refused": np.array(count)}


def test_what_was_found_once_is_refused() -> None:
    assert int(run_limited(read_seeds)["refused"]) == len(KEPT) > 0
