"""The look of all plots, and a figure as PNG bytes; the same drawing gives the same bytes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#7a5c00")  # Okabe and Ito 2008
MARKERS = "osD^vPX<"  # one more than colours, so that 56 methods differ
LINES = ("-", "--", ":", "-.")
ELSEWHERE = "#8a8a8a"
"""Colour of what was measured with other programs."""

_SHORT = 60.0
"""A logarithmic axis that spans less than this factor is labelled between the powers of ten."""

_FLAT = 2.0
"""One that spans less than this is left to Matplotlib."""

_STYLE: Any = {  # Matplotlib's names
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "grid.linewidth": 0.4,
    "grid.color": "#d0d0d0",
    "legend.frameon": False,
    "legend.fontsize": 8,
    "lines.linewidth": 1.4,
    "lines.markersize": 4.5,
}


class Look(NamedTuple):
    """How a method is drawn, the same in all panels."""

    color: str
    marker: str
    line: str


REFERENCE_LOOK = Look("#000000", "*", "none")
"""Of the row that tells how far the truth is known."""


def look_of(place: int, *, elsewhere: bool = False) -> Look:
    """Return the look of the method at this place of the list."""
    if elsewhere:
        return Look(ELSEWHERE, MARKERS[place % len(MARKERS)], "--")
    return Look(COLORS[place % len(COLORS)], MARKERS[place % len(MARKERS)], LINES[place // len(COLORS) % len(LINES)])


class Canvas:
    """A figure being drawn, and its PNG once the block has ended."""

    def __init__(self, figure: Figure) -> None:
        self.figure = figure
        self.png = b""


@contextmanager
def canvas(width: float, height: float) -> Iterator[Canvas]:
    """Give an empty figure of this size [inch]; its PNG has 200 dots per inch."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with rc_context(_STYLE):
        drawn = Canvas(Figure(figsize=(width, height), layout="constrained"))
        FigureCanvasAgg(drawn.figure)
        yield drawn
        png = BytesIO()
        drawn.figure.savefig(png, format="png", dpi=200, metadata={"Software": None})
        drawn.png = png.getvalue()


def label_decades(axis: Axis) -> None:
    """Label a logarithmic axis at powers of ten, and between them where it spans less than two."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = sorted(axis.get_view_interval())
    if low <= 0.0 or high / low < _FLAT:
        return
    axis.set_minor_formatter(NullFormatter())
    if high / low < _SHORT:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def axis_title(name: str) -> str:
    """From `rms_error_mm` to "rms error [mm]"."""
    head, _, unit = name.rpartition("_")
    units = {"mm": "mm", "cm": "cm", "m": "m", "s": "s", "px": "px", "j": "J", "deg": "°"}
    return f"{head.replace('_', ' ')} [{units[unit]}]" if unit in units and head else name.replace("_", " ")
