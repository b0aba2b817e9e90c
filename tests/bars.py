"""The bars of `bars.yaml`, which of them some figures miss, and a table of both."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

BARS: dict[str, dict[str, dict[str, Any]]] = yaml.safe_load((Path(__file__).parent / "bars.yaml").read_text())


def missed(scene: str, figures: Mapping[str, Any]) -> list[str]:
    """Return the bars of a scene that its figures miss, in words; a figure that is absent or no number misses its bar.

    Args:
        scene: One of `BARS`.
        figures: Numbers and flags by name, nested or not: {"garment": {"pieces": 1}} has "garment.pieces".
    """
    return [
        f"{scene}: {name} is {value}; wanted {bar['least']} to {bar['most']} {bar['unit']}: {bar['why']}"
        for name, value, bar, met in _held(scene, figures)
        if not met
    ]


def judged(scene: str, figures: Mapping[str, Any]) -> list[str]:
    """Return a line for each bar of a scene: whether it is met, the figure, the bar, the unit."""
    return [
        f"{'met' if met else 'MISSED':<7} {scene}: {name:<36} {value!s:>10}"
        f"  of {bar['least']} to {bar['most']} {bar['unit']}"
        for name, value, bar, met in _held(scene, figures)
    ]


def _held(scene: str, figures: Mapping[str, Any]) -> Iterator[tuple[str, Any, dict[str, Any], bool]]:
    """Yield name, figure, bar, and whether it is met."""
    flat = dict(flattened(figures))
    for name, bar in BARS[scene].items():
        value = flat.get(name)
        yield name, value, bar, value is not None and bar["least"] <= value <= bar["most"]


def flattened(figures: Mapping[str, Any], above: str = "") -> list[tuple[str, Any]]:
    """Return the figures and their paths, joined by points."""
    found = []
    for name, value in figures.items():
        path = f"{above}{name}"
        found += flattened(value, f"{path}.") if isinstance(value, Mapping) else [(path, value)]
    return found
