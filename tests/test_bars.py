"""The file of bars: each has two sides and a reason, and what misses one is told."""

import math
from pathlib import Path

import pytest
from bars import BARS, flattened, missed

CONFIGS = {path.stem for path in (Path(__file__).parents[1] / "configs").glob("*.yaml")}


@pytest.mark.parametrize("scene", BARS)
def test_every_bar_has_two_sides_and_a_reason(scene):
    for name, bar in BARS[scene].items():
        assert set(bar) == {"least", "most", "unit", "why"}, name
        assert bar["least"] <= bar["most"], name
        assert bar["why"], name


def test_bars_are_of_documents_that_exist():
    assert set(BARS) - CONFIGS == {"real_tshirt", "moving_arms", "promises"}


def figures(scene, value):
    return {name: value(bar) for name, bar in BARS[scene].items()}


@pytest.mark.parametrize("scene", BARS)
def test_each_bar_is_held_from_both_sides(scene):
    assert missed(scene, figures(scene, lambda bar: bar["least"])) == []
    assert missed(scene, figures(scene, lambda bar: bar["most"])) == []
    for wrong in (lambda bar: bar["least"] - 0.01, lambda bar: bar["most"] + 0.01, lambda bar: math.nan):
        assert len(missed(scene, figures(scene, wrong))) == len(BARS[scene])
    assert len(missed(scene, {})) == len(BARS[scene])


def test_figures_are_named_by_their_path():
    assert dict(flattened({"a": {"b": {"c": 1}, "d": True}, "e": 2.0})) == {"a.b.c": 1, "a.d": True, "e": 2.0}
