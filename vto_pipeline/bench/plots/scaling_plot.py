"""How run time grows with size, how near kernels come to the machine's best, and what threads cost: one picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from vto_pipeline.bench.plots.figure import COLORS, ELSEWHERE, canvas, label_decades
from vto_pipeline.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Rows = Sequence[Mapping[str, Any]]

_BAR = 0.2  # inch per bar
_HALF = 0.5  # of the roof: a factor of two


def draw_scaling(bench: Mapping[str, Any]) -> bytes:
    """Draw the three kinds of rows of the bench: sizes with their exponent, kernels, and threads.

    Args:
        bench: {"bench", "rows"}: sizes with errors status "reached", one row with errors "exponent", kernels with
            errors "roofline_share", and threads with errors "overhead".

    Returns:
        A PNG.

    Raises:
        InputError: no row is of one of the kinds.
    """
    rows = bench["rows"]
    sizes = [row for row in rows if row["errors"].get("status") == "reached"]
    fits = [row for row in rows if "exponent" in row["errors"]]
    kernels = [row for row in rows if "roofline_share" in row["errors"]]
    threads = [row for row in rows if "overhead" in row["errors"]]
    if not (sizes or kernels or threads):
        raise InputError(f"bench {bench['bench']}: {len(rows)} rows, none of a size, a kernel or threads")
    with canvas(11.0, max(3.2, 0.9 + _BAR * len(kernels))) as drawn:
        left, middle, right = drawn.figure.subplots(1, 3, width_ratios=(1.2, 1.0, 0.8))
        _sizes(left, sizes, fits)
        _shares(middle, kernels)
        _overheads(right, threads)
    return drawn.png


def _sizes(axes: Axes, rows: Rows, fits: Rows) -> None:
    if not rows:
        axes.set_axis_off()
        return
    vertices = np.array([float(row["vertices"]) for row in rows])
    seconds = np.array([row["seconds"] for row in rows])
    axes.loglog(vertices, seconds, "o", color=COLORS[0])
    middle = np.exp(np.log(vertices).mean()), np.exp(np.log(seconds).mean())
    for exponent, line in ((1.0, ":"), (1.2, "--")):
        axes.loglog(
            vertices,
            middle[1] * (vertices / middle[0]) ** exponent,
            line,
            color=ELSEWHERE,
            linewidth=0.9,
            label=f"vertices$^{{{exponent:g}}}$",
        )
    for fit in fits:
        exponent, spread = fit["errors"]["exponent"], fit["errors"]["exponent_uncertainty"]
        known = f" ± {spread:.2f}" if isinstance(spread, float) else ""
        axes.loglog(
            vertices,
            middle[1] * (vertices / middle[0]) ** exponent,
            color=COLORS[0],
            label=f"exponent {exponent:.2f}{known}",
        )
    axes.set(title=rows[0]["scene"], xlabel="vertices", ylabel="run time [s]")
    label_decades(axes.xaxis)
    label_decades(axes.yaxis)
    axes.grid(visible=True)
    axes.legend(loc="upper left")


def _shares(axes: Axes, rows: Rows) -> None:
    """Draw the share of the roofline of each kernel, on a logarithmic axis, with a factor of two marked."""
    if not rows:
        axes.set_axis_off()
        return
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    places = np.arange(len(rows))
    shares = [row["errors"]["roofline_share"] for row in rows]
    colors = [COLORS[scenes.index(row["scene"]) % len(COLORS)] for row in rows]
    axes.barh(places, shares, color=colors, height=0.7)
    for place, share in enumerate(shares):
        axes.text(share, place, f" {share:.2g}", va="center", size=7)
    axes.axvline(1.0, color="#000000", linewidth=0.9)
    axes.axvline(_HALF, color=ELSEWHERE, linewidth=0.9, linestyle="--")
    labels = [f"{row['method']}, {row['settings']['use_threads']} thr, {row['scene'].split()[-1]}²" for row in rows]
    axes.set_yticks(places, labels, size=7)
    axes.set(title="share of the roofline", xscale="log", xlim=(5e-3, 2.0))
    axes.invert_yaxis()


def _overheads(axes: Axes, rows: Rows) -> None:
    """Draw the time on all threads against one thread, beside an idle and a busy core."""
    if not rows:
        axes.set_axis_off()
        return
    places = np.arange(len(rows))
    ratio = [1.0 + row["errors"]["overhead"] for row in rows]
    axes.bar(places, ratio, color=[COLORS[1] if "busy" in row["settings"].values() else COLORS[2] for row in rows])
    for place, value in enumerate(ratio):
        axes.text(place, value, f"{value:.2f}", ha="center", va="bottom", size=7)
    axes.axhline(1.0, color="#000000", linewidth=0.9)
    labels = [f"{row['scene'].split()[-1]}²\n{row['settings']['other_core']}" for row in rows]
    axes.set_xticks(places, labels, size=7)
    axes.set(title="threads against one thread", ylabel="ratio of run times")
