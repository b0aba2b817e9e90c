"""Lines of figures against run time, size, step or iterations: one panel per scene and figure, one look per method."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from vto_pipeline.bench.plots.figure import REFERENCE_LOOK, Look, axis_title, canvas, label_decades, look_of
from vto_pipeline.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Plain = Mapping[str, Any]

RUN_TIME, VERTICES = "seconds", "vertices"
REFERENCE = "reference"
"""The method whose rows show how far the truth itself is known."""

_COLUMNS = 4  # panels side by side where they have no common grid
_WIDEST = 7  # scenes side by side where they have
_SLOPE_POINTS = 3  # finest points that a slope is fitted to


@dataclass(frozen=True)
class Curves:
    """Figures over one abscissa.

    Args:
        x: RUN_TIME, VERTICES, or the name of a setting.
        x_title: Of the axis, with its unit.
        figures: Which errors; empty: all that occur as numbers.
        slopes: Write the exponent of each line's three finest points at its end.
        finer_right: Whether larger x is finer.
        split: A setting by whose values a method has several lines; empty: one line.
    """

    x: str = RUN_TIME
    x_title: str = "run time [s]"
    figures: Sequence[str] = ()
    slopes: bool = False
    finer_right: bool = False
    split: str = ""

    def label(self, row: Plain) -> str:
        """Return the name of the line on which a row lies."""
        part = row["settings"].get(self.split, "") if self.split else ""
        return f"{row['method']}, {part}" if part else str(row["method"])


@dataclass(frozen=True)
class _Panel:
    """What one panel shows: which rows, which of their figures, over what, and what stands above and beside it."""

    scene: str
    figure: str
    curves: Curves
    title: str
    y_title: str


def draw_curves(bench: Plain, *curves: Curves) -> bytes:
    """Plot figures of a bench on logarithmic axes.

    Args:
        bench: {"bench", "rows": [{"scene", "method", "settings", "vertices", "seconds", "errors": {name: value}}]}, and
            "peers" with rows of other programs, drawn in grey. Names end in their unit. Values that are not positive
            numbers cannot be drawn and are left out.
        curves: What to draw, from top to bottom.

    Returns:
        A PNG.

    Raises:
        InputError: nothing to draw.
    """
    own, peers = list(bench["rows"]), list(bench.get("peers", ()))
    scenes = list(dict.fromkeys(row["scene"] for row in own))
    rows = own + [row for row in peers if row["scene"] in scenes]
    panels = _lines([_panels(rows, scenes, one) for one in curves])
    if not panels:
        raise InputError(f"bench {bench['bench']}: {len(own)} rows, none with an error to plot")
    looks = _looks(own, peers, curves)
    columns = max(len(line) for line in panels)
    with canvas(2.2 + 2.9 * columns, 0.4 + 2.4 * len(panels)) as drawn:
        handles: dict[str, Any] = {}
        for axes, panel in _placed(drawn.figure.subplots(len(panels), columns, squeeze=False), panels):
            chosen = [row for row in rows if row["scene"] == panel.scene]
            told: set[tuple[str, int]] = set()
            for label, look in looks.items():
                on_line = [row for row in chosen if panel.curves.label(row) == label]
                points = _points(on_line, panel.figure, panel.curves.x)
                if points:
                    handles[label] = _line(axes, points, look, panel.curves, told)
            _dress(axes, panel)
        shown = [label for label in looks if label in handles]
        drawn.figure.legend([handles[label] for label in shown], shown, loc="outside right center")
    return drawn.png


def _placed(grid: Any, panels: Sequence[Sequence[_Panel | None]]) -> Iterator[tuple[Axes, _Panel]]:
    """Yield each panel with its axes, and switch the others off."""
    for line, axes_line in zip(panels, grid, strict=True):
        for k, axes in enumerate(axes_line):
            panel = line[k] if k < len(line) else None
            if panel is None:
                axes.set_axis_off()
            else:
                yield axes, panel


def _panels(rows: Sequence[Plain], scenes: Sequence[str], curves: Curves) -> list[list[_Panel | None]]:
    """Return the panels as a grid, figures down and scenes across, where both fit; else each as a line of its own."""
    names = list(curves.figures) or list(dict.fromkeys(name for row in rows for name in row["errors"]))
    filled = {
        (scene, name)
        for scene in scenes
        for name in names
        if _points([row for row in rows if row["scene"] == scene], name, curves.x)
    }
    names = [name for name in names if any((scene, name) in filled for scene in scenes)]
    scenes = [scene for scene in scenes if any((scene, name) in filled for name in names)]
    if len(names) > 1 and 1 < len(scenes) <= _WIDEST and 2 * len(filled) > len(scenes) * len(names):
        return [
            [
                _Panel(scene, name, curves, scene if i == 0 else "", axis_title(name) if j == 0 else "")
                if (scene, name) in filled
                else None
                for j, scene in enumerate(scenes)
            ]
            for i, name in enumerate(names)
        ]
    return [
        [_Panel(scene, name, curves, scene, axis_title(name))]
        for scene in scenes
        for name in names
        if (scene, name) in filled
    ]


def _lines(groups: Sequence[Sequence[list[_Panel | None]]]) -> list[list[_Panel | None]]:
    """Return all panels line by line: grids as they are, single panels side by side."""
    lines: list[list[_Panel | None]] = []
    room = 0  # on the last line
    for line in (line for group in groups for line in group):
        if len(line) == 1 and room > 0:
            lines[-1] += line
            room -= 1
        else:
            lines.append(list(line))
            room = _COLUMNS - 1 if len(line) == 1 else 0
    return lines


def _looks(own: Sequence[Plain], peers: Sequence[Plain], curves: Sequence[Curves]) -> dict[str, Look]:
    """Return the look of each line: in colour what was measured here, in grey what elsewhere."""
    ours, theirs = (dict.fromkeys(one.label(row) for one in curves for row in rows) for rows in (own, peers))
    ours.pop(REFERENCE, None)
    looks = {label: look_of(k) for k, label in enumerate(ours)}
    looks |= {label: look_of(k, elsewhere=True) for k, label in enumerate(theirs) if label not in ours}
    return looks | {REFERENCE: REFERENCE_LOOK}


def _points(rows: Sequence[Plain], figure: str, x: str) -> list[tuple[float, float]]:
    """Return what can be drawn on logarithmic axes, from left to right."""
    pairs = ((_number(_abscissa(row, x)), _number(row["errors"].get(figure))) for row in rows)
    return sorted(pair for pair in pairs if pair[0] > 0.0 and pair[1] > 0.0)


def _abscissa(row: Plain, x: str) -> object:
    return row[x] if x in (RUN_TIME, VERTICES) else row["settings"].get(x)


def _number(value: object) -> float:
    """Return a finite number as it is, everything else as NaN."""
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else math.nan


def _line(
    axes: Axes, points: Sequence[tuple[float, float]], look: Look, curves: Curves, told: set[tuple[str, int]]
) -> Any:
    """Draw the points of one method, and return the line that stands for it in the legend.

    `told` holds the exponents written so far and their decade: one text stands for all lines that coincide.
    """
    line = _best(points) if curves.x == RUN_TIME else points
    mark: Any = {"color": look.color, "marker": look.marker, "markeredgewidth": 0.0}
    axes.plot(*zip(*points, strict=True), linestyle="none", alpha=0.3, **mark)
    (handle,) = axes.plot(*zip(*line, strict=True), linestyle=look.line, **mark)
    end = line[-_SLOPE_POINTS:] if curves.finer_right else line[:_SLOPE_POINTS]
    if curves.slopes and len(end) == _SLOPE_POINTS:
        across, up = np.log(np.array(end)).T
        text, place = f"{np.polyfit(across, up, 1)[0]:.1f}", end[-1 if curves.finer_right else 0]
        label = text, round(math.log10(place[1]))
        if label not in told:
            told.add(label)
            beyond, side = ((4, -2), "left") if curves.finer_right else ((-4, -2), "right")
            axes.annotate(text, place, beyond, textcoords="offset points", ha=side, color=look.color, size=7)
    return handle


def _best(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the points than which no faster one is better, from left to right."""
    best: list[tuple[float, float]] = []
    for point in points:
        if not best or point[1] < best[-1][1]:
            best.append(point)
    return best


def _dress(axes: Axes, panel: _Panel) -> None:
    axes.margins(x=0.1)
    axes.set_xscale("log")
    axes.set_yscale("log")
    label_decades(axes.xaxis)
    label_decades(axes.yaxis)
    axes.grid(visible=True)
    axes.set_title(panel.title)
    axes.set_ylabel(panel.y_title)
    axes.set_xlabel(panel.curves.x_title)
