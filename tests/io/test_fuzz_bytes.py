"""Bytes that nobody would write, in every reader: refused in words or read, and nothing else.

A finding of the fuzzer becomes a file in fuzz_seeds/, which is read each time from then on.
"""

from __future__ import annotations

import logging
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import fuzzing
import numpy as np
import pytest
from fuzz_targets import ROOMS, sound_file
from fuzzing import FOUND, LAST, fuzz_reader, fuzz_room

from vto_pipeline.errors import InputError, VtoError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.sandbox import run_limited

SEEDS = sorted((Path(__file__).parent / "fuzz_seeds").glob("*-*"))
QUICK, LONG = 30, int(os.environ.get("VTO_FUZZ", "2000"))  # executions for each reader, fewer for slow ones
SECONDS_EACH = 1.0  # s for one execution of every reader of a room, on a busy machine
KEYS = ("executions", "refused", "seconds")
MEMORY = Path("/dev/shm")  # a file written there takes 0.01 ms, on a disk 0.3 ms
log = logging.getLogger(__name__)


@pytest.fixture
def folder() -> Iterator[Path]:
    """Where damaged files are written: in memory if that can be."""
    with tempfile.TemporaryDirectory(dir=MEMORY if os.access(MEMORY, os.W_OK) else None) as name:
        yield Path(name)


def fuzzed(function: Callable[..., Arrays], *args: str | int, folder: Path, kept: Path, seconds: float) -> Arrays:
    """Fuzz in a child; fails with the bytes of all findings in a folder. They belong into fuzz_seeds/TARGET-WHAT."""
    try:
        said, problem = run_limited(function, *args, str(folder), seconds=seconds), ""
    except InputError as error:
        target = (folder / LAST).resolve().relative_to(folder.resolve()).parts[0]
        said, problem = {}, f"{target}: {error.problem}"
        kept.mkdir()
        (kept / f"{target}-end").write_bytes((folder / LAST).read_bytes())
    if (folder / FOUND).exists():
        shutil.copytree(folder / FOUND, kept, dirs_exist_ok=True)
    if kept.exists():
        pytest.fail(f"{problem or 'refused without a word'}: {sorted(path.name for path in kept.iterdir())} in {kept}")
    return said


@pytest.mark.parametrize("room", ROOMS)
def test_every_reader_quickly(room: str, folder: Path, tmp_path: Path) -> None:
    said = fuzzed(fuzz_room, room, QUICK, 1, folder=folder, kept=tmp_path / "found", seconds=600.0)
    assert 0.5 * said["executions"].sum() < said["refused"].sum() < said["executions"].sum()  # and not only damage


@pytest.mark.slow
@pytest.mark.parametrize("room", ROOMS)
def test_every_reader_at_length(room: str, folder: Path, tmp_path: Path) -> None:
    """`VTO_FUZZ=12000 pytest -m slow tests/io/test_fuzz_bytes.py --log-cli-level=INFO`: a million executions."""
    limit = 600.0 + SECONDS_EACH * LONG
    said = fuzzed(fuzz_room, room, LONG, LONG, folder=folder, kept=tmp_path / "found", seconds=limit)
    for target, count, refused, seconds in zip(ROOMS[room], *(said[key].tolist() for key in KEYS), strict=True):
        share = 100 * refused / count
        log.info("%-24s %7d  %7.3f ms each  %5.1f %% refused", target, count, 1e3 * seconds / count, share)
    log.info("%s: %d executions in %.0f s", room, said["executions"].sum(), said["seconds"].sum())
    assert (said["refused"] > 0.2 * said["executions"]).all()


def read_seeds() -> Arrays:
    """In the child: read every kept finding."""
    count = 0
    for kept in SEEDS:
        folder = Path(kept.name)
        folder.mkdir()
        path, read = sound_file(kept.name.split("-")[0], folder)
        path.write_bytes(kept.read_bytes())
        try:
            read(path)
        except VtoError:
            count += 1
    return {"refused": np.array(count)}


def test_what_was_found_once_is_refused() -> None:
    assert int(run_limited(read_seeds)["refused"]) == len(SEEDS) > 0


SOUND = b"a sound file, long enough for all edits to find their place in it. " * 8
WAYS: dict[str, tuple[Callable[[], Any], str]] = {
    "raises": (lambda: 1 / 0, "ZeroDivisionError"),
    "exits": (lambda: os._exit(0), "exit code 0"),
    "crashes": (os.abort, "signal 6"),
    "hangs": (lambda: time.sleep(120.0), "has not ended"),
}


def same_bytes(one: bytes, other: bytes) -> int:
    """How many bytes both begin with."""
    return next((k for k, (a, b) in enumerate(zip(one, other, strict=False)) if a != b), min(len(one), len(other)))


def fuzz_a_bad_reader(way: str, folder: str) -> Arrays:
    """In the child: fuzz a reader that does not bear a certain word."""
    fuzzing.SECONDS_EACH = 1.0
    path = Path(folder, "a.txt")
    path.write_bytes(SOUND)
    return fuzz_reader(path, lambda path: WAYS[way][0]() if b"nan" in path.read_bytes() else None, 1000, 1, folder)


@pytest.mark.parametrize("way", WAYS)
def test_the_bytes_are_kept_whatever_a_reader_does_wrong(way: str, folder: Path, tmp_path: Path) -> None:
    kept = tmp_path / "found"
    began = time.monotonic()
    with pytest.raises(pytest.fail.Exception, match=WAYS[way][1]):
        fuzzed(fuzz_a_bad_reader, way, folder=folder, kept=kept, seconds=300.0)
    assert time.monotonic() - began < 100.0  # s: the limit of one reading, not that of all
    (finding,) = kept.iterdir()
    found = finding.read_bytes()
    assert b"nan" in found
    if way == "raises":  # then there was time to find which of the edits did it
        assert same_bytes(found, SOUND) + same_bytes(found[::-1], SOUND[::-1]) >= len(SOUND) - len(b"nan")


def damaged_copies(folder: Path, seed: int) -> list[bytes]:
    """What a reader that bears all is given to read."""
    path = folder / "a.txt"
    path.write_bytes(SOUND)
    copies: list[bytes] = []
    fuzz_reader(path, lambda path: copies.append(path.read_bytes()), 300, seed, str(folder))
    return copies[1:]  # without the sound file


def test_a_seed_says_what_is_read(folder: Path) -> None:
    copies = damaged_copies(folder, 1)
    assert copies == damaged_copies(folder, 1)
    assert len(set(copies) - {SOUND}) > 250  # a cut at the same byte may come twice
    assert len(set(copies) & set(damaged_copies(folder, 2))) < 50
