"""A picture of several panels, two in a line, one for each kind of row that a bench has."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from vto_pipeline.bench.plots.figure import COLORS, canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Rows = Sequence[Mapping[str, Any]]

_LINE = 0.24  # inch per line of a list


def draw_panels(
    filled: Sequence[tuple[Rows, Callable[[Axes, Rows], None]]],
    names: Callable[[Rows], Sequence[str]],
    width: float,
    least: float,
) -> bytes:
    """Draw the panels.

    Args:
        filled: Rows of each, and what paints them.
        names: Of the lines that a list of rows takes; a panel is high enough for them.
        width, least: Of the picture, and of a line of panels at least [inch].

    Returns:
        A PNG.
    """
    lines = [filled[k : k + 2] for k in range(0, len(filled), 2)]
    heights = [max(least, 1.0 + _LINE * max(len(names(rows)) for rows, _ in line)) for line in lines]
    with canvas(width, sum(heights)) as drawn:
        grid = drawn.figure.subplots(len(lines), 2, squeeze=False, height_ratios=heights)
        for line, axes_line in zip(lines, grid, strict=True):
            for k, axes in enumerate(axes_line):
                if k < len(line):
                    line[k][1](axes, line[k][0])
                else:
                    axes.set_axis_off()
    return drawn.png


def scenes(rows: Rows) -> list[str]:
    """Return the scenes that rows are of, in order."""
    return list(dict.fromkeys(row["scene"] for row in rows))


def list_scenes(axes: Axes, rows: Rows) -> dict[str, int]:
    """Name the lines of a list, the first on top, and return the place of each."""
    names = scenes(rows)
    axes.set_yticks(range(len(names)), names, size=7)
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.grid(visible=True, axis="x")
    return {name: k for k, name in enumerate(names)}


def paint_left_out(axes: Axes, rows: Rows) -> None:
    """Draw the "saved_share" of time as a list; beside each bar the "difference_mm" that it makes."""
    places = list_scenes(axes, rows)
    for row in rows:
        saved, place = 100.0 * row["errors"]["saved_share"], places[row["scene"]]
        axes.barh(place, saved, color=COLORS[0], height=0.6)
        text = f" {row['errors']['difference_mm']:.2g} mm"
        axes.text(max(saved, 0.0), place, text, va="center", size=7)
    axes.set(title="left out: the difference it makes", xlabel="time saved [%]")
    axes.margins(x=0.2)
