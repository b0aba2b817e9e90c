"""Disks that are full or read-only: a message, an exit code, nothing broken, and the same command again goes on."""

from __future__ import annotations

import ctypes
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh
from toy_tables import CALLS

from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.sandbox import run_limited

BLOCK = 4096
_READ_ONLY, _REMOUNT, _DETACH = 1, 32, 2


def mount(folder: Path, flags: int = 0, options: str = "") -> None:
    """Mount a small disk in memory."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mount(b"tmpfs", os.fsencode(folder), b"tmpfs", flags, options.encode()) != 0:
        pytest.skip(f"a disk cannot be mounted here: {os.strerror(ctypes.get_errno())}")


@pytest.fixture
def disk(tmp_path) -> Iterator[Path]:
    """A disk of 100 blocks."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount(folder, options=f"size={100 * BLOCK}")
    yield folder
    ctypes.CDLL(None).umount2(os.fsencode(folder), _DETACH)


def fill(disk: Path, leave: int) -> Path:
    """Fill a disk but for some blocks."""
    path = disk / "filler"
    free = os.statvfs(disk).f_bavail
    path.write_bytes(bytes(BLOCK * max(0, free - leave)))
    return path


def artifacts(run: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in sorted((run / "out").glob("*.txt"))}


def test_a_disk_that_fills_up_at_any_moment_stops_the_run_and_no_more(vto, disk):
    vto("run", "toy.yaml")
    whole = artifacts(Path("runs/toy"))
    stopped = []
    for leave in range(0, 60, 3):
        run = disk / f"run{leave}"
        filler = fill(disk, leave)
        said = vto("run", "toy.yaml", "-o", run)
        if said.code != 0:
            assert said.code == (2 if "cannot be made" in said.err else 3)
            assert "No space left on device" in said.err
            assert str(run) in said.err
            assert artifacts(run).items() <= whole.items()
            stopped.append(len(list((run / "cache").glob("*/*/manifest.json"))))
        filler.unlink()
        again = vto("run", "toy.yaml", "-o", run)
        assert again.code == 0
        assert len(CALLS) == 7 - (stopped[-1] if said.code else 6)  # nothing that was finished is done again
        assert artifacts(run) == whole
        assert not list(run.rglob(".*partial*"))
        subprocess.run(["rm", "-r", str(run)], check=True)
    assert len(set(stopped)) > 3  # it really was full at different moments,
    assert said.code == 0  # and in the end it was not


def test_a_full_disk_is_told_with_what_to_do(vto, disk):
    fill(disk, 8)
    said = vto("run", "toy.yaml", "-o", disk / "run", "--json")
    assert (said.code, said.data["exit_code"]) == (3, 3)
    assert said.data["error"]["hint"] == "make room; the same command again resumes where this one stopped"


def test_a_read_only_disk_takes_no_run_and_shows_one(vto, disk):
    assert vto("run", "toy.yaml", "-o", disk / "run").code == 0
    before = sorted(disk.rglob("*"))
    mount(disk, _REMOUNT | _READ_ONLY)
    for command in (
        ("run", "toy.yaml", "-o", disk / "run"),
        ("run", "toy.yaml", "-o", disk / "other"),
        ("report", disk / "run"),
        ("prune", disk / "run"),
    ):
        said = vto(*command)
        assert said.code == 2, said.err
        assert "cannot be made or written to: Read-only file system" in said.err
    trimesh.creation.box().export("box.ply")
    said = vto("render", "box.ply", "--views", "front", "--size", "64", "-o", disk / "pictures")
    assert (said.code, "-o gives another folder" in said.err) == (3, True), said.err
    assert vto("plan", "toy.yaml", "-o", disk / "run").code == 0
    assert vto("info", disk / "run").code == 0
    assert sorted(disk.rglob("*")) == before


def much() -> Arrays:
    return {"values": np.zeros(200 * BLOCK, np.uint8)}


def test_an_answer_for_which_there_is_no_room_does_not_blame_the_file(disk, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(disk))
    with pytest.raises(OSError, match="No space left on device") as caught:
        run_limited(much)
    assert caught.value.filename == str(disk)
