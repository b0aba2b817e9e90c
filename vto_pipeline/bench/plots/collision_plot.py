"""Collision results in one picture: queries, broad phase, scenes, work left out and friction."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from vto_pipeline.bench.plots.figure import COLORS, ELSEWHERE, label_decades, look_of
from vto_pipeline.bench.plots.panels import Rows, draw_panels, list_scenes, paint_left_out, scenes
from vto_pipeline.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FLOOR = 1e-7  # an error share below this is drawn here
_GOOD, _BAD = COLORS[2], COLORS[1]


def draw_collision(bench: Mapping[str, Any]) -> bytes:
    """Draw a panel for each kind of rows that there is.

    Args:
        bench: {"bench", "rows"}. Kinds differ in their errors: queries by "per_second" (with "missed" or
            "false_share"), the broad phase by "pairs", scenes by "crossings", bad starts by "pairs_left", work left
            out by "saved_share" (with "difference_mm"), friction by "error_share" (with "allowed_share").

    Returns:
        A PNG.

    Raises:
        InputError: no row is of one of the kinds.
    """
    panels: list[tuple[str, Callable[[Axes, Rows], None]]] = [
        ("per_second", _queries),
        ("pairs", _sizes),
        ("crossings", _scenes),
        ("pairs_left", _bad_starts),
        ("saved_share", paint_left_out),
        ("error_share", _friction),
    ]
    chosen = [(_with(bench["rows"], name), paint) for name, paint in panels]
    filled = [(rows, paint) for rows, paint in chosen if rows]
    if not filled:
        raise InputError(f"bench {bench['bench']}: {len(bench['rows'])} rows, none with a figure of collision")
    return draw_panels(filled, scenes, 11.0, 2.6)


def _with(rows: Rows, figure: str) -> list[Mapping[str, Any]]:
    """Return the rows that have this figure as a finite number."""
    return [row for row in rows if _finite(row["errors"].get(figure))]


def _finite(value: object) -> bool:
    return isinstance(value, int | float) and math.isfinite(value)


def _methods(rows: Rows) -> list[str]:
    return list(dict.fromkeys(row["method"] for row in rows))


def _queries(axes: Axes, rows: Rows) -> None:
    """Draw continuous tests a second as a list of families of queries; hollow where an answer was wrong."""
    places, methods = list_scenes(axes, rows), _methods(rows)
    for row in rows:
        errors, look = row["errors"], look_of(methods.index(row["method"]))
        wrong = errors.get("missed", 0) > 0 or errors.get("false_share", 0.0) > 0.0
        face = "none" if wrong else look.color
        axes.plot(errors["per_second"], places[row["scene"]], look.marker, color=look.color, markerfacecolor=face)
    for k, method in enumerate(methods):
        axes.plot([], [], look_of(k).marker, color=look_of(k).color, label=method)
    axes.plot([], [], "o", color=ELSEWHERE, markerfacecolor="none", label="some missed or false")
    axes.set(title="continuous tests", xlabel="queries a second", xscale="log")
    axes.legend(fontsize=7)


def _sizes(axes: Axes, rows: Rows) -> None:
    """Draw seconds against vertices, with the exponent of each method."""
    for k, (scene, method) in enumerate(dict.fromkeys((row["scene"], row["method"]) for row in rows)):
        own = [row for row in rows if (row["scene"], row["method"]) == (scene, method) and row["seconds"] > 0.0]
        points = sorted((row["vertices"], row["seconds"]) for row in own)
        if not points:
            continue
        across, up = np.log(np.array(points, dtype=np.float64)).T
        grows = f", exponent {np.polyfit(across, up, 1)[0]:.2f}" if len(set(across)) > 1 else ""
        look = look_of(k)
        axes.loglog(
            *np.exp([across, up]), look.line, color=look.color, marker=look.marker, label=f"{scene}: {method}{grows}"
        )
    axes.set(title="broad and narrow phase", xlabel="vertices", ylabel="seconds a step")
    label_decades(axes.xaxis)
    label_decades(axes.yaxis)
    axes.grid(visible=True)
    axes.legend(loc="upper left", fontsize=7)


def _scenes(axes: Axes, rows: Rows) -> None:
    _timed(axes, rows, "crossings", "scenes: pairs that cross at the end")


def _bad_starts(axes: Axes, rows: Rows) -> None:
    _timed(axes, rows, "pairs_left", "bad starts: pairs left")


def _timed(axes: Axes, rows: Rows, figure: str, title: str) -> None:
    """Draw run times as a list, in the colour and with the number of what is left."""
    places, methods = list_scenes(axes, rows), _methods(rows)
    for row in rows:
        left, place = row["errors"][figure], places[row["scene"]]
        color = _GOOD if left == 0 else _BAD
        axes.plot(max(row["seconds"], 1e-3), place, look_of(methods.index(row["method"])).marker, color=color)
        axes.annotate(f"{left:g}", (max(row["seconds"], 1e-3), place), (5, -2), textcoords="offset points", size=7)
    for k, method in enumerate(methods):
        axes.plot([], [], look_of(k).marker, color=ELSEWHERE, label=method)
    axes.set(title=title, xlabel="run time [s]", xscale="log")
    axes.margins(x=0.15)
    axes.legend(fontsize=7)


def _friction(axes: Axes, rows: Rows) -> None:
    """Draw relative errors as a list, with what is allowed as an upright stroke."""
    places, methods = list_scenes(axes, rows), _methods(rows)
    for row in rows:
        errors, place = row["errors"], places[row["scene"]]
        look = look_of(methods.index(row["method"]))
        axes.plot(max(abs(errors["error_share"]), _FLOOR), place, look.marker, color=look.color, alpha=0.8)
        if _finite(errors.get("allowed_share")):
            axes.plot([errors["allowed_share"]] * 2, [place - 0.4, place + 0.4], color="#000000", linewidth=1.2)
    for k, method in enumerate(methods):
        axes.plot([], [], look_of(k).marker, color=look_of(k).color, label=method)
    axes.set(title="friction: error and what is allowed", xlabel="relative error", xscale="log")
    axes.legend(fontsize=7, loc="lower left")
