"""Skeletons one by one, from a camera that loses joints, sends rubbish, or is faster than who asks."""

from __future__ import annotations

import io
import json
import threading
import time

import numpy as np
import pytest
from motion_shapes import random_moves, tracked_places, tracked_text
from numpy.testing import assert_allclose

from vto_pipeline.errors import FormatError
from vto_pipeline.io.motion.tracked.feed import Feed
from vto_pipeline.io.motion.tracked.lines import read_lines
from vto_pipeline.io.motion.tracked.live import LiveJoints


def lines(count: int = 6) -> list[bytes]:
    return [line.encode() + b"\n" for line in tracked_text(random_moves(count)).splitlines()]


def changed(line: bytes, **joints: object) -> bytes:
    record = json.loads(line)
    record["joints"].update(joints)
    return json.dumps(record).encode() + b"\n"


def test_each_frame_is_as_a_file_of_them_has_it(tmp_path):
    (tmp_path / "a.jsonl").write_bytes(b"".join(lines()))
    whole = read_lines(tmp_path / "a.jsonl")
    joints = LiveJoints("camera")
    for number, line in enumerate(lines()):
        frame = joints.read(line)
        assert frame.seconds == pytest.approx(whole.times[number])
        for name, places in whole.places.items():
            assert_allclose(frame.places[name], places[number], rtol=0, atol=1e-12)  # the middle is added and taken


def test_a_joint_that_is_lost_stays_where_it_was_about_the_hips():
    truth = tracked_places(random_moves(6))
    hips = 0.5 * (truth["left_hip"] + truth["right_hip"])
    joints, feed = LiveJoints("camera"), lines()
    joints.read(feed[0])
    frame = joints.read(changed(feed[1], left_wrist=None))
    assert_allclose(frame.places["left_wrist"], truth["left_wrist"][0] + hips[1] - hips[0], rtol=0, atol=1e-9)
    assert_allclose(frame.places["right_wrist"], truth["right_wrist"][1], rtol=0, atol=1e-9)


def test_nothing_is_given_until_each_joint_that_is_needed_was_seen():
    joints, feed = LiveJoints("camera"), lines()
    assert joints.read(changed(feed[0], left_ankle=None, right_ankle=None)) is None
    assert joints.missing == ("left_ankle", "right_ankle")
    assert joints.read(changed(feed[1], right_ankle=None)) is None
    assert joints.read(feed[2]) is not None
    assert joints.read(b'{"joints": {}}\n') is None


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (b'{"joints": {"left_hip": [NaN, 0, 0]}}\n', "NaN is not a place"),
        (b'{"joints": {"left_hip": [0, -Infinity, 0]}}\n', "-Infinity is not a place"),
        (b'{"joints": {"left_hip": [0, 0]}}\n', "not a place of three numbers"),
        (b'{"joints": {"left_hip": [0, 0\n', "not a line of JSON"),
        (b"\xff\xfe\n", "not a line of JSON"),
        (b"[1, 2]\n", "not an object"),
        (b"{}\n", "without joints"),
    ],
)
def test_a_bad_line_is_refused_with_its_number_and_the_next_is_read(line, said):
    joints, feed = LiveJoints("camera"), lines()
    before = joints.read(feed[0])
    joints.read(b"\n")
    with pytest.raises(FormatError, match=said) as caught:
        joints.read(line)
    assert caught.value.where == "camera, line 3"
    after = joints.read(feed[0])
    assert_allclose(after.places["left_knee"], before.places["left_knee"], rtol=0, atol=1e-12)


def test_bones_without_length_are_refused_and_leave_nothing_behind():
    joints, feed = LiveJoints("camera"), lines()
    hip = json.loads(feed[1])["joints"]["left_hip"]
    first = joints.read(feed[0])
    with pytest.raises(FormatError, match="in one place") as caught:
        joints.read(changed(feed[1], left_knee=hip))
    assert caught.value.where == "camera, line 2"
    again = joints.read(changed(feed[0], left_knee=None))
    assert_allclose(again.places["left_knee"], first.places["left_knee"], rtol=0, atol=1e-12)


class Slow(io.RawIOBase):
    """Lines that come when they are let."""

    def __init__(self, feed: list[bytes]) -> None:
        self._feed = iter(feed)
        self.let = threading.Semaphore(0)

    def readline(self, size: int | None = -1, /) -> bytes:
        self.let.acquire()
        return next(self._feed, b"")


def until(condition) -> None:
    end = time.perf_counter() + 10.0
    while not condition():
        assert time.perf_counter() < end
        time.sleep(0.002)


def test_the_newest_frame_is_given_and_a_gap_gives_none():
    stream, said = Slow([*lines(4)[:3], b"rubbish\n", lines(4)[3]]), []
    feed = Feed(stream, "camera", said.append)
    assert feed.take() is None
    stream.let.release(3)
    until(lambda: feed.frames == 3)
    assert feed.take().seconds == pytest.approx(0.08)
    assert (feed.skipped, feed.take(), feed.over) == (2, None, False)
    stream.let.release(2)
    until(lambda: feed.frames == 4)
    assert (feed.take().seconds, feed.refusals) == (pytest.approx(0.12), 1)
    assert said[0].where == "camera, line 4"
    stream.let.release()
    until(lambda: feed.over)


def test_a_recording_keeps_to_its_times():
    began = time.perf_counter()
    feed = Feed(io.BytesIO(b"".join(lines(6))), "file", pytest.fail, replay=True)
    while not feed.over:
        time.sleep(0.002)
        feed.take()
    assert feed.frames == 6
    assert feed.skipped == 0
    assert 0.2 <= time.perf_counter() - began < 1.0  # five times 40 ms


def test_a_recording_without_its_times_is_skipped_through():
    feed = Feed(io.BytesIO(b"".join(lines(50))), "file", pytest.fail)
    until(lambda: feed.frames == 50)
    last = feed.take()
    assert last is not None
    assert feed.skipped == 49
    assert np.isfinite(last.places["left_hip"]).all()
