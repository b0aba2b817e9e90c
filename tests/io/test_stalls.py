"""Work on a folder that may not answer."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import pytest
from stalled_folder import stalled_folder

from vto_pipeline.errors import InputError
from vto_pipeline.io import stalls
from vto_pipeline.io.stalls import answered, check_answers
from vto_pipeline.pipeline.execution.digest import digest_file, digest_path

FILES = {"left.txt": b"3", "large.bin": bytes(range(256)) * 12_000}


@pytest.fixture
def impatient(monkeypatch) -> None:
    """Wait for a second, and remember no folder of other tests."""
    monkeypatch.setattr(stalls, "_PATIENCE", 1.0)
    monkeypatch.setattr(stalls, "_ANSWERED", set())


@pytest.mark.usefixtures("impatient")
def test_work_that_goes_on_may_take_long_and_its_result_or_error_comes_through():
    def long(beat):
        for _ in range(8):
            time.sleep(0.25)
            beat()
        return 7

    def wrong(beat):
        raise FileNotFoundError("gone")

    assert answered(Path("a"), long) == 7
    with pytest.raises(FileNotFoundError, match="gone"):
        answered(Path("a"), wrong)


@pytest.mark.usefixtures("impatient")
def test_work_that_stops_is_refused_and_not_before():
    held = threading.Event()

    def stops(beat):
        time.sleep(0.5)
        beat()
        held.wait()

    began = time.monotonic()
    with pytest.raises(InputError, match="no answer has come for 1 s") as caught:
        answered(Path("nas/a"), stops)
    assert 1.4 < time.monotonic() - began < 30.0
    assert (caught.value.where, caught.value.hint) == ("nas/a", "is the disk or the network folder still there?")
    held.set()


@pytest.mark.usefixtures("impatient")
def test_a_folder_that_answers_is_read_and_one_that_does_not_is_refused(tmp_path):
    local = tmp_path / "local"
    local.mkdir()
    for name, data in FILES.items():
        (local / name).write_bytes(data)
    with stalled_folder(tmp_path / "nas", FILES) as far:
        for path in (far.path, far.path / "left.txt", far.path / "nothing.txt"):
            check_answers(path)
        for name in ("", *FILES):
            assert digest_path(far.path / name) == digest_path(local / name)
        far.stall()
        check_answers(far.path / "left.txt")  # it has answered this process before
        with pytest.raises(InputError, match="no answer has come for 1 s"):
            check_answers(far.path / "right.txt")


def test_each_block_of_a_file_counts_as_an_answer(tmp_path):
    (tmp_path / "large.bin").write_bytes(bytes(5 << 20))
    beats: list[None] = []
    digest_file(tmp_path / "large.bin", lambda: beats.append(None))
    assert len(beats) == 5  # of 1 MiB


@pytest.mark.usefixtures("impatient")
@pytest.mark.parametrize("name", ["", "large.bin"])
def test_a_file_of_which_a_part_never_comes_is_refused(tmp_path, name):
    with stalled_folder(tmp_path / "nas", FILES, stall_at=1 << 20) as far:
        assert digest_path(far.path / "left.txt")
        with pytest.raises(InputError, match="no answer has come for 1 s"):
            digest_path(far.path / name)
