"""Plots for paper and screen, as PNG bytes; the same rows give the same bytes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from io import BytesIO
from typing import TYPE_CHECKING, Any

from vto_pipeline.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#000000")  # Okabe and Ito 2008
_MARKERS = "osD^vPX"
_STYLE: Any = {  # Matplotlib's names
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "axes.titlesize": 10,
    "grid.linewidth": 0.4,
    "grid.color": "#d0d0d0",
    "legend.frameon": False,
    "legend.fontsize": 8,
    "lines.linewidth": 1.4,
    "lines.markersize": 4.5,
}


def error_against_time(bench: Mapping[str, Any], errors: Sequence[str] = ()) -> bytes:
    """Plot error against run time, one panel per scene and error, one line per method, both axes logarithmic.

    Args:
        bench: {"bench", "rows": [{"scene", "method", "seconds", "errors": {name: value}}]}; names end in their unit.
        errors: Which errors; default all that occur. Values that are not positive cannot be drawn and are left out.

    Returns:
        A PNG at 200 dots per inch.

    Raises:
        InputError: there are no rows, or none has one of the errors.
    """
    rows = bench["rows"]
    names = list(errors) or list(dict.fromkeys(name for row in rows for name in row["errors"]))
    if not any(name in row["errors"] for row in rows for name in names):
        raise InputError(f"bench {bench['bench']}: {len(rows)} rows, none with an error to plot")
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    methods = list(dict.fromkeys(row["method"] for row in rows))
    with rc_context(_STYLE):
        size = (0.6 + 3.2 * len(scenes), 0.7 + 2.5 * len(names))
        figure = Figure(figsize=size, layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(len(names), len(scenes), squeeze=False, sharex="col")
        for i, name in enumerate(names):
            for j, scene in enumerate(scenes):
                _panel(panels[i, j], [row for row in rows if row["scene"] == scene], name, methods)
                panels[i, j].set_title(scene if i == 0 else "", loc="left")
                panels[i, j].set_ylabel(_axis_title(name) if j == 0 else "")
        for panel in panels[-1]:
            panel.set_xlabel("run time [s]")
        handles = {
            label: line for panel in panels.flat for line, label in zip(*panel.get_legend_handles_labels(), strict=True)
        }
        figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=min(len(handles), 4))
        png = BytesIO()
        figure.savefig(png, format="png", dpi=200, metadata={"Software": None})
    return png.getvalue()


def _panel(axes: Axes, rows: Sequence[Mapping[str, Any]], error: str, methods: Sequence[str]) -> None:
    for k, method in enumerate(methods):
        points = sorted(
            (row["seconds"], row["errors"][error])
            for row in rows
            if row["method"] == method and row["seconds"] > 0 and row["errors"].get(error, 0) > 0
        )
        if points:
            seconds, values = zip(*points, strict=True)
            color, marker = _COLORS[k % len(_COLORS)], _MARKERS[k % len(_MARKERS)]
            axes.plot(seconds, values, label=method, color=color, marker=marker)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.grid(visible=True)


def _axis_title(name: str) -> str:
    head, _, unit = name.rpartition("_")
    return f"{head.replace('_', ' ')} [{unit}]" if unit in ("mm", "cm", "m", "s", "px") else name.replace("_", " ")
