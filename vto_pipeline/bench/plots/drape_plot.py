"""Drape results in one picture: error against run time, error prediction, refinement, rest shapes, work left out."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from vto_pipeline.bench.plots.figure import ELSEWHERE, label_decades, look_of
from vto_pipeline.bench.plots.panels import Rows, draw_panels, list_scenes, paint_left_out, scenes
from vto_pipeline.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LEAST = 1e-3  # mm, s: less is drawn here


def draw_drape(bench: Mapping[str, Any]) -> bytes:
    """Draw a panel for each kind of rows that there is.

    Args:
        bench: {"bench", "rows"}. Kinds differ in their errors: garments by "distance_mm" (with "predicted_mm" and
            "honest"), refinement by "from_finest_mm", rest shapes by "from_scan_mm", what is
            left out by "saved_share" (with "difference_mm").

    Returns:
        A PNG.

    Raises:
        InputError: no row is of one of the kinds.
    """
    panels: list[tuple[str, Callable[[Axes, Rows], None]]] = [
        ("distance_mm", _against_time),
        ("distance_mm", _honesty),
        ("from_finest_mm", _refinement),
        ("from_scan_mm", _rest_shapes),
        ("saved_share", paint_left_out),
    ]
    chosen = [([row for row in bench["rows"] if name in row["errors"]], paint) for name, paint in panels]
    filled = [(rows, paint) for rows, paint in chosen if rows]
    if not filled:
        raise InputError(f"bench {bench['bench']}: {len(bench['rows'])} rows, none with a figure of a drape")
    return draw_panels(filled, scenes, 12.0, 3.2)


def _figure(row: Mapping[str, Any], name: str) -> float:
    """Return a figure that can be drawn on a logarithmic axis; NaN where there is none."""
    value = row["errors"].get(name)
    return max(float(value), _LEAST) if isinstance(value, int | float) and math.isfinite(value) else math.nan


def _against_time(axes: Axes, rows: Rows) -> None:
    for k, scene in enumerate(scenes(rows)):
        look, mine = look_of(k), [row for row in rows if row["scene"] == scene]
        own = sorted((max(row["seconds"], _LEAST), _figure(row, "distance_mm")) for row in mine)
        axes.loglog(*zip(*own, strict=True), look.line, color=look.color, marker=look.marker, label=scene)
    axes.set(title="distance to the state of rest", xlabel="run time [s]", ylabel="rms over vertices [mm]")
    _finish(axes)


def _honesty(axes: Axes, rows: Rows) -> None:
    """Draw true over predicted error; above the dashed line the prediction was too low."""
    for k, scene in enumerate(scenes(rows)):
        own = [row for row in rows if row["scene"] == scene]
        predicted, true = ([_figure(row, name) for row in own] for name in ("predicted_mm", "distance_mm"))
        axes.loglog(predicted, true, linestyle="none", color=look_of(k).color, marker=look_of(k).marker)
    ends = axes.get_xlim()
    axes.plot(ends, ends, color=ELSEWHERE, linewidth=0.8)
    axes.plot(ends, [1.5 * end for end in ends], "--", color=ELSEWHERE, linewidth=0.8)
    judged = [row["errors"]["honest"] for row in rows if row["errors"]["honest"] is not None]
    title = f"within 1.5 of the predicted: {sum(judged)} of {len(judged)}"
    if len(judged) < len(rows):
        title += f"; reference not at rest: {len(rows) - len(judged)}"
    axes.set(title=title, xlabel="predicted [mm]", ylabel="true [mm]")
    label_decades(axes.xaxis)
    label_decades(axes.yaxis)
    axes.grid(visible=True)


def _refinement(axes: Axes, rows: Rows) -> None:
    every = dict.fromkeys(name for row in rows for name in row["errors"])
    names = ["from_finest_mm", *(name for name in every if name.startswith("off_"))]
    own = sorted(rows, key=lambda row: row["vertices"])
    for k, name in enumerate(names):
        look = look_of(k)
        label = "median distance" if k == 0 else name.removeprefix("off_").removesuffix("_mm").replace("_", " ")
        points = [(row["vertices"], _figure(row, name)) for row in own[:-1]]
        axes.loglog(*zip(*points, strict=True), look.line, color=look.color, marker=look.marker, label=label)
    axes.set(title=f"off the finest ({own[-1]['vertices']} vertices)", xlabel="vertices", ylabel="[mm]")
    _finish(axes)


def _rest_shapes(axes: Axes, rows: Rows) -> None:
    """Draw the distance of the simulated garment to the scan; beside it the median error of the rest lengths."""
    places, modes = list_scenes(axes, rows), list(dict.fromkeys(row["method"] for row in rows))
    for row in rows:
        look, far = look_of(modes.index(row["method"])), _figure(row, "from_scan_mm")
        axes.plot(far, places[row["scene"]], look.marker, color=look.color)
        text = f"{100.0 * row['errors']['length_error_median_share']:.2g} %"
        axes.annotate(text, (far, places[row["scene"]]), (0, 6), textcoords="offset points", size=7, ha="center")
    for k, mode in enumerate(modes):
        axes.plot([], [], look_of(k).marker, color=look_of(k).color, label=mode)
    axes.set(title="rest shape: simulated to scan, error of lengths", xlabel="mean distance [mm]", xscale="log")
    axes.legend(fontsize=7)


def _finish(axes: Axes) -> None:
    label_decades(axes.xaxis)
    label_decades(axes.yaxis)
    axes.grid(visible=True)
    axes.legend(fontsize=7)
