"""Bodies in one picture: surface and girths against run time, the spread of repeats, errors and intervals of people."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from vto_pipeline.bench.plots.figure import COLORS, ELSEWHERE, MARKERS, label_decades
from vto_pipeline.bench.plots.panels import Rows, draw_panels, list_scenes, scenes
from vto_pipeline.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ROOM = 1.6  # times what is drawn: the legend stands above it
_BESIDE = 0.18  # of a line, between the girths of one scene
_PEOPLE = {
    "chest_girth": "chest girth",
    "waist_girth": "waist girth",
    "hip_girth": "hip girth",
    "girths": "all girths",
    "unasked": "what was not measured",
}
_MAE, _INSIDE = "_mae_mm", ("inside_share", "inside_interval_share")
_OTHERWISE = ("_by_stature_mm", "_by_weight_mm", "_mae_by_the_mean_mm")


def draw_body(bench: Mapping[str, Any]) -> bytes:
    """Draw a panel for each kind of rows that there is.

    Args:
        bench: {"bench", "rows"}. Kinds differ in their errors: registrations by "surface_mean_mm" and "girth_mm",
            repeated scans by "spread_mm" (with "group_limit_mm"), people by figures that end in "_mae_mm" (beside what
            stature, mass or the mean alone would give), intervals by figures that end in "inside_share" or are
            "inside_interval_share".

    Returns:
        A PNG.

    Raises:
        InputError: no row is of one of the kinds.
    """
    panels: list[tuple[tuple[str, ...], Callable[[Axes, Rows], None]]] = [
        (("surface_mean_mm",), partial(_against_time, figure="surface_mean_mm", title="mean distance of the surfaces")),
        (("surface_mean_mm",), partial(_against_time, figure="girth_mm", title="largest error of a trunk girth")),
        (("spread_mm",), _spread),
        ((_MAE,), _people),
        (_INSIDE, _intervals),
    ]
    chosen = [
        ([row for row in bench["rows"] if any(name.endswith(ends) for name in row["errors"])], paint)
        for ends, paint in panels
    ]
    filled = [(rows, paint) for rows, paint in chosen if rows]
    if not filled:
        raise InputError(f"bench {bench['bench']}: {len(bench['rows'])} rows, none of a body")
    return draw_panels(filled, scenes, 12.0, 3.4)


def _against_time(axes: Axes, rows: Rows, figure: str, title: str) -> None:
    """Draw a line for each scene, by its colour, and method, by its marker."""
    methods = list(dict.fromkeys(row["method"] for row in rows))
    for k, scene in enumerate(scenes(rows)):
        axes.plot([], [], color=COLORS[k], label=scene)
        for method, marker in zip(methods, MARKERS, strict=False):
            mine = [row for row in rows if (row["scene"], row["method"]) == (scene, method)]
            own = sorted((row["seconds"], row["errors"][figure]) for row in mine)
            if own:
                axes.plot(*zip(*own, strict=True), color=COLORS[k], marker=marker, linewidth=1.0)
    for method, marker in zip(methods, MARKERS, strict=False):
        axes.plot([], [], color=ELSEWHERE, marker=marker, linestyle="none", label=f"by {method}")
    highest = max(row["errors"][figure] for row in rows)
    axes.set(xlabel="run time [s]", ylabel="[mm]", title=title, xscale="log", ylim=(0.0, _ROOM * highest))
    label_decades(axes.xaxis)
    axes.grid(visible=True)
    axes.legend(fontsize=6, ncols=2, loc="upper left")


def _spread(axes: Axes, rows: Rows) -> None:
    places = list_scenes(axes, rows)
    at = [places[row["scene"]] for row in rows]
    axes.barh(at, [row["errors"]["spread_mm"] for row in rows], color=COLORS[0], height=0.5)
    limits = [row["errors"]["group_limit_mm"] for row in rows]
    axes.scatter(limits, at, color=COLORS[1], marker="|", s=160, label="ISO 20685: limit of a group's mean error")
    axes.set(xlabel="standard deviation [mm]", title="spread of repeated scans", ylim=(len(places) - 0.4, -1.4))
    axes.legend(loc="upper right")


def _people(axes: Axes, rows: Rows) -> None:
    """Draw the mean errors of each scene; joined to them, in grey, those of a guess without the fit."""
    places = list_scenes(axes, rows)
    for row in rows:
        errors = row["errors"]
        own = [name for name in _PEOPLE if name + _MAE in errors]
        for k, name in enumerate(own):
            at = places[row["scene"]] + _BESIDE * (k - (len(own) - 1) / 2)
            look, value = list(_PEOPLE).index(name), errors[name + _MAE]
            for guess in (errors[name + end] for end in _OTHERWISE if name + end in errors):
                axes.plot([value, guess], [at, at], color=ELSEWHERE, linewidth=0.6)
                axes.plot(guess, at, marker=MARKERS[look], color=ELSEWHERE)
            axes.plot(value, at, marker=MARKERS[look], color=COLORS[look])
    for look, label in enumerate(_PEOPLE.values()):
        axes.plot([], [], MARKERS[look], color=COLORS[look], label=label)
    axes.plot([], [], "o", color=ELSEWHERE, label="by stature, mass, mean alone")
    axes.set(xlabel="[mm]", title="people: mean error", xlim=(0.0, None))
    axes.legend(fontsize=7, loc="lower right")


def _intervals(axes: Axes, rows: Rows) -> None:
    """Draw which share of values lay inside their reported 95 % intervals; by kind, not by girth."""
    places = list_scenes(axes, rows)
    kinds: dict[str, int] = {}
    for row in rows:
        for name, value in row["errors"].items():
            if name.endswith(_INSIDE) and "_girth_" not in name:
                kind = name.removesuffix(_INSIDE[0]).removesuffix("_") or "all"
                look = kinds.setdefault("all" if name == _INSIDE[1] else kind, len(kinds))
                axes.plot(100.0 * value, places[row["scene"]], MARKERS[look], color=COLORS[look], alpha=0.8)
    for kind, look in kinds.items():
        axes.plot([], [], MARKERS[look], color=COLORS[look], label=kind)
    axes.axvline(95.0, color=ELSEWHERE, linewidth=0.8)
    axes.set(title="inside their 95 % intervals", xlabel="share of values [%]")
    axes.legend(fontsize=7, loc="upper left", bbox_to_anchor=(1.0, 1.0))
