"""A table of verdicts: methods down, cases across, one colour and one sign per verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from vto_pipeline.bench.plots.figure import COLORS, canvas
from vto_pipeline.errors import InputError

NOT_ASKED = "does not apply"
_GOOD = ("passes", "refused")
_CALM = {
    "passes": ("✓", "#cfe8df"),
    "refused": ("r", "#cfe8df"),
    "limited": ("L", "#f6ecc9"),
    NOT_ASKED: ("", "#f2f2f2"),
}
"""Verdicts that are no failure: good input gone well, bad input turned away, a bound that theory gives, no case."""

_CELL = 0.24  # inch


def draw_verdicts(bench: Mapping[str, Any], figure: str = "verdict") -> bytes:
    """Draw one cell for each method and scene, with the methods that pass most on top.

    Args:
        bench: {"bench", "rows": [{"scene", "method", "errors": {"verdict": word}}]}.
        figure: Name of the verdict among the errors.

    Returns:
        A PNG.

    Raises:
        InputError: no row has a verdict.
    """
    found = {
        (row["method"], row["scene"]): str(row["errors"][figure]) for row in bench["rows"] if figure in row["errors"]
    }
    if not found:
        raise InputError(f"bench {bench['bench']}: {len(bench['rows'])} rows, none with a {figure}")
    scenes = list(dict.fromkeys(scene for _, scene in found))
    methods = sorted(
        dict.fromkeys(method for method, _ in found),
        key=lambda method: -sum(found.get((method, scene)) in _GOOD for scene in scenes),
    )
    signs = _signs(list(dict.fromkeys(found.values())))
    width, height = 3.4 + _CELL * len(scenes), 2.2 + _CELL * len(methods)
    with canvas(width, height) as drawn:
        axes = drawn.figure.subplots()
        for i, method in enumerate(methods):
            for j, scene in enumerate(scenes):
                sign, color = signs[found.get((method, scene), NOT_ASKED)]
                axes.add_patch(_square(j, i, color))
                ink = "#404040" if color in (calm for _, calm in _CALM.values()) else "white"
                axes.text(j, i, sign, ha="center", va="center", size=7, color=ink)
            given = [found[method, scene] for scene in scenes if (method, scene) in found]
            failed = sum(verdict not in _CALM for verdict in given)
            good = sum(verdict in _GOOD for verdict in given)
            axes.text(len(scenes) - 0.3, i, f"{good}/{good + failed}", va="center", size=7)
        axes.set(xlim=(-0.5, len(scenes) + 0.7), ylim=(len(methods) - 0.5, -0.5), aspect="equal")
        axes.set_xticks(range(len(scenes)), scenes, rotation=60, ha="left", rotation_mode="anchor", size=8)
        axes.set_yticks(range(len(methods)), methods, size=8)
        axes.tick_params(length=0, top=True, labeltop=True, bottom=False, labelbottom=False)
        axes.spines[:].set_visible(False)
        handles = [_square(0, 0, color) for _, color in signs.values()]
        labels = [f"{sign}  {verdict}" for verdict, (sign, _) in signs.items()]
        drawn.figure.legend(handles, labels, loc="outside lower center", ncols=min(len(labels), 4))
    return drawn.png


def _signs(verdicts: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Return sign and colour of each verdict; of failures, in the order in which they occur."""
    signs = {verdict: look for verdict, look in _CALM.items() if verdict in (*verdicts, NOT_ASKED)}
    taken = {sign for sign, _ in signs.values()}
    for k, verdict in enumerate(one for one in verdicts if one not in _CALM):
        letter = next((sign for sign in verdict.upper() if sign.isalpha() and sign not in taken), "?")
        taken.add(letter)
        signs[verdict] = (letter, COLORS[k % len(COLORS)])
    return signs


def _square(x: float, y: float, color: str) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle((x - 0.46, y - 0.46), 0.92, 0.92, facecolor=color, edgecolor="none")
