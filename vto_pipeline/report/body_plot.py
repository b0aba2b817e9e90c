"""Bodies in one picture: surface and girths against run time, the spread of repeats, people by tape and outline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from vto_pipeline.errors import InputError
from vto_pipeline.report.figure import COLORS, canvas, look_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Rows = Sequence[Mapping[str, Any]]


def draw_body(bench: Mapping[str, Any]) -> bytes:
    """Draw what there is of it.

    Args:
        bench: {"bench", "rows"}. Kinds are told by their errors: registrations by "surface_mean_mm" and "girth_mm",
            repeated scans by "spread_mm" (with "group_limit_mm"), people by figures that end in "mae_mm".

    Returns:
        A PNG.

    Raises:
        InputError: no row is of one of the kinds.
    """
    rows = bench["rows"]
    scans = [row for row in rows if "surface_mean_mm" in row["errors"]]
    repeats = [row for row in rows if "spread_mm" in row["errors"]]
    people = [row for row in rows if any(name.endswith("mae_mm") for name in row["errors"])]
    panels = (2 if scans else 0) + bool(repeats) + bool(people)
    if panels == 0:
        raise InputError(f"bench {bench['bench']}: {len(rows)} rows, none of a body")
    with canvas(11.0, 3.6 * ((panels + 1) // 2)) as drawn:
        axes = list(drawn.figure.subplots((panels + 1) // 2, 2, squeeze=False).ravel())
        if scans:
            _against_time(axes.pop(0), scans, "surface_mean_mm", "mean distance of the surfaces [mm]")
            _against_time(axes.pop(0), scans, "girth_mm", "largest error of a trunk girth [mm]")
        if repeats:
            _spread(axes.pop(0), repeats)
        if people:
            _people(axes.pop(0), people)
        for left in axes:
            left.set_axis_off()
    return drawn.png


def _against_time(axes: Axes, rows: Rows, figure: str, title: str) -> None:
    lines = list(dict.fromkeys((row["scene"], row["method"]) for row in rows))
    for place, (scene, method) in enumerate(lines):
        own = sorted((r["seconds"], r["errors"][figure]) for r in rows if (r["scene"], r["method"]) == (scene, method))
        look = look_of(place)
        label = f"{scene}: {method}"
        axes.plot(*zip(*own, strict=True), color=look.color, marker=look.marker, linestyle=look.line, label=label)
    axes.set(xlabel="run time [s]", title=title, xscale="log", ylim=(0.0, None))
    axes.grid(True)
    axes.legend(fontsize=6)


def _spread(axes: Axes, rows: Rows) -> None:
    at = np.arange(len(rows))
    axes.barh(at, [row["errors"]["spread_mm"] for row in rows], color=COLORS[0], height=0.5)
    limits = [row["errors"]["group_limit_mm"] for row in rows]
    axes.scatter(limits, at, color=COLORS[1], marker="|", s=160, label="ISO 20685: limit of a group's mean error")
    axes.set(yticks=at, yticklabels=[row["scene"] for row in rows], xlabel="[mm]", title="spread of repeated scans")
    axes.legend()


def _people(axes: Axes, rows: Rows) -> None:
    bars = [
        (f"{row['scene']}: {name.removesuffix('_mm').replace('_', ' ')}", value)
        for row in rows
        for name, value in row["errors"].items()
        if name.endswith("_mm") and not name.endswith("_bias_mm")
    ]
    at = np.arange(len(bars))[::-1]
    axes.barh(at, [value for _, value in bars], color=COLORS[2], height=0.6)
    axes.set(xlabel="[mm]", title="random people: mean error")
    axes.set_yticks(at, [label for label, _ in bars], fontsize=6)
