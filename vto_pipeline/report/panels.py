"""A picture of several panels, two in a line, one for each kind of row that a bench has."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from vto_pipeline.report.figure import canvas

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
