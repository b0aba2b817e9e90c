"""When live frames begin: their rate in closed form, whatever each of them takes."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from vto_pipeline.stages.entry import live
from vto_pipeline.stages.entry.pace import Pace

PERIOD = 0.05


def beginnings(took: np.ndarray) -> tuple[np.ndarray, int]:
    """When frames begin that take so long each [s], and how many are left out."""
    now, missed, found = 7.0, 0, []
    pace = Pace(PERIOD, now)
    for seconds in took:
        found.append(now)
        missed += pace.made(now + seconds)
        now = max(now + seconds, pace.due)
    return np.array(found) - 7.0, missed


def test_quick_frames_begin_at_even_times():
    began, missed = beginnings(np.random.default_rng(1).uniform(0.0, 0.99 * PERIOD, 200))
    np.testing.assert_allclose(began, PERIOD * np.arange(200), rtol=0, atol=1e-9)
    assert missed == 0


def test_frames_that_are_slow_at_times_catch_up():
    took = np.where(np.arange(400) % 2 == 0, 1.3, 0.6) * PERIOD  # 0.95 on average
    began, missed = beginnings(took)
    assert missed == 0
    assert began[-1] == pytest.approx(399 * PERIOD, abs=PERIOD)
    assert (np.diff(began) >= took[:-1] - 1e-12).all()


@pytest.mark.parametrize("share", [1.04, 1.5, 2.5])
def test_frames_that_are_too_slow_follow_each_other_without_a_pause(share):
    began, missed = beginnings(np.full(1000, share * PERIOD))
    assert began[-1] == pytest.approx(999 * share * PERIOD, rel=2e-3)
    assert missed == pytest.approx(1000 * (share - 1.0), abs=2)  # as many as there was no time for


def test_after_a_pause_frames_come_at_even_times_again():
    took = np.full(50, 0.4 * PERIOD)
    took[20] = 8.2 * PERIOD
    began, missed = beginnings(took)
    assert missed == 7
    late = began / PERIOD % 1.0
    np.testing.assert_allclose(np.minimum(late, 1.0 - late)[25:], 0.0, rtol=0, atol=1e-6)
    assert np.diff(began)[24:] == pytest.approx(PERIOD)


class Feed:
    """So many skeletons, and then nobody."""

    def __init__(self, count: int) -> None:
        self.left = count

    @property
    def over(self) -> bool:
        return self.left == 0

    def take(self, wait: float = 0.0) -> SimpleNamespace | None:
        if self.over:
            return None
        self.left -= 1
        return SimpleNamespace(places={})


def test_the_cloth_goes_on_by_the_time_that_passes(monkeypatch):
    """Frames of 1.4 periods and 0.5 in turn: those that catch up are short, as the time between them is."""
    now, lengths = [0.0], []

    def advance(body, seconds):
        lengths.append(seconds)
        now[0] += (1.4 if len(lengths) % 2 else 0.5) * PERIOD

    def sleep(seconds):
        now[0] += seconds

    monkeypatch.setattr(live, "time", SimpleNamespace(perf_counter=lambda: now[0], sleep=sleep))
    monkeypatch.setattr(live, "posed_vertices", lambda avatar, *pose: np.zeros((1, 3)))
    dressed = SimpleNamespace(avatar=SimpleNamespace(vertices=np.zeros((1, 3))), shown=lambda cloth, body: body)
    cloth = SimpleNamespace(positions=np.zeros((1, 3)), advance=advance)
    pose = SimpleNamespace(at=lambda places, seconds: ())
    live.follow_live(dressed, cloth, pose, Feed(20), 1.0 / PERIOD, lambda frame: None, live.LiveReport())
    np.testing.assert_allclose(lengths[1:], np.tile([1.4, 0.6], 10)[:19] * PERIOD, rtol=1e-9)
