"""Time shared out over stages, against every combination tried by itself."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from vto_pipeline.pipeline.execution.sharing import share_out
from vto_pipeline.pipeline.levels import DEFAULT, Level, UsualTime


def a_table(seed: int) -> tuple[dict[str, float], dict[str, tuple[Level, ...]]]:
    """Random stages and levels: some levels make later stages quicker too, some make them slower."""
    rng = np.random.default_rng(seed)
    sections = [f"s{k}" for k in range(5)]
    seconds = {f"role.{name}" if k % 2 else name: float(rng.uniform(1, 50)) for k, name in enumerate(sections)}
    offers = {}
    for k, name in enumerate(sections[: rng.integers(1, 5)]):
        levels = [DEFAULT]
        for number in range(rng.integers(0, 4)):
            touched = {name: float(rng.uniform(0.1, 1.5))}
            if k + 1 < len(sections) and rng.random() < 0.5:
                touched[sections[k + 1]] = float(rng.uniform(0.2, 1.2))
            levels.append(Level({"n": number}, touched, float(rng.uniform(0.8, 3.0))))
        offers[name] = tuple(levels)
    return seconds, offers


def by_hand(seconds, offers, numbers) -> tuple[float, float]:
    """Time and error of one combination, stage by stage."""
    total, error = 0.0, 1.0
    chosen = [offers[name][number] for name, number in numbers.items()]
    for stage, taken in seconds.items():
        for level in chosen:
            taken = taken * level.seconds.get(stage.split(".")[-1], 1.0)
        total += taken
    for level in chosen:
        error *= level.error
    return total, error


@pytest.mark.parametrize("seed", range(40))
@pytest.mark.parametrize("share", [0.0, 0.3, 0.6, 0.9, 1.2])
def test_the_least_error_that_fits_is_found(seed, share):
    seconds, offers = a_table(seed)
    left = share * sum(seconds.values())
    found = share_out(seconds, offers, left)
    assert by_hand(seconds, offers, found.levels) == pytest.approx((found.seconds, found.error), rel=1e-12)
    every = [
        by_hand(seconds, offers, dict(zip(offers, numbers, strict=True)))
        for numbers in itertools.product(*(range(len(levels)) for levels in offers.values()))
    ]
    fitting = [error for taken, error in every if taken <= left]
    if fitting:
        assert found.seconds <= left
        assert found.error == pytest.approx(min(fitting), rel=1e-12)
    else:
        assert found.seconds == pytest.approx(min(taken for taken, _ in every), rel=1e-12)


@pytest.mark.parametrize("seed", range(40))
def test_more_time_never_buys_more_error(seed):
    seconds, offers = a_table(seed)
    least = share_out(seconds, offers, 0.0).seconds
    times = np.linspace(least + 1e-6, 2 * sum(seconds.values()), 30)
    errors = [share_out(seconds, offers, left).error for left in times]
    assert all(later <= earlier for earlier, later in itertools.pairwise(errors))


def test_of_equals_the_quickest():
    offers = {"a": (DEFAULT, Level({"n": 1}, {"a": 0.5}, 1.0), Level({"n": 2}, {"a": 0.7}, 1.0))}
    assert share_out({"a": 10.0}, offers, 20.0).levels == {"a": 1}


def test_nothing_to_choose():
    found = share_out({"a": 3.0, "role.b": 4.0}, {}, 1.0)
    assert (found.levels, found.seconds, found.error) == ({}, 7.0, 1.0)


def test_the_usual_time_goes_with_the_number_of_files():
    usual = UsualTime(5.0, per_file=2.0, kind="photos", power=2.0)
    assert usual.of({"photos": 10.0, "depth": 7.0}) == pytest.approx(205.0, rel=1e-12)
    assert usual.of({"depth": 7.0}) == usual.of({}) == 5.0
