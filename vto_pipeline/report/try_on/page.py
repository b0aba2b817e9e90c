"""The page: a slider for each number that the drapes differ in, and buttons for what is not a number."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.report.document import asset, document
from vto_pipeline.report.layers import PageLayer
from vto_pipeline.report.scene import build_page_scene, script_json
from vto_pipeline.report.try_on.between import deepest_inside, left_out


@dataclass(frozen=True)
class Slider:
    """A number that drapes differ in.

    Args:
        name: For people.
        unit: Likewise, or empty.
        values: Where there are drapes, the smallest first.
    """

    name: str
    unit: str
    values: tuple[float, ...]


@dataclass(frozen=True)
class Choice:
    """Something else that they differ in.

    Args:
        name: For people.
        options: Likewise.
    """

    name: str
    options: tuple[str, ...]


@dataclass(frozen=True)
class Fitted:
    """The drapes of one option of each choice.

    Args:
        garments: What is worn, with its places in every drape as frames; the last slider turns fastest.
        body: Who wears it, likewise.
        fits: Of each drape, "verdict" in words and "ease_cm", by zone.
    """

    garments: tuple[PageLayer, ...]
    body: PageLayer
    fits: tuple[Mapping[str, Any], ...]


@dataclass(frozen=True)
class TryOnPage:
    """A page, and what is measured of it.

    Args:
        html: The page.
        left_out: How far a left out drape is missed [m]: "median", "p95" and "most"; None where none has neighbours.
        inside: How deep cloth gets into the body midway between drapes [m].
    """

    html: str
    left_out: Mapping[str, float] | None
    inside: float


def build_try_on_page(
    title: str, sliders: Sequence[Slider], choices: Sequence[Choice], fitted: Sequence[Fitted]
) -> TryOnPage:
    """Return the page as one HTML document without references to anything outside.

    Args:
        title: For people.
        sliders: At least one value each.
        choices: There may be none.
        fitted: For every combination of options, the last choice turning fastest.
    """
    counts = [len(one.values) for one in sliders]
    axes = [one.values for one in sliders]
    missed = [left_out(_on_grid(layer, counts), axes).ravel() for one in fitted for layer in one.garments]
    inside = [
        deepest_inside(_on_grid(layer, counts), _on_grid(one.body, counts), one.body.mesh.faces)
        for one in fitted
        for layer in one.garments
    ]
    layers = [layer for one in fitted for layer in (*one.garments, one.body)]
    scene = build_page_scene([replace(layer, name=f"{layer.name} {k}") for k, layer in enumerate(layers)])
    numbers = iter(range(len(layers)))
    grid = {
        "sliders": [{"name": one.name, "unit": one.unit, "values": one.values} for one in sliders],
        "choices": [{"name": one.name, "options": one.options} for one in choices],
        "fitted": [
            {"layers": [next(numbers) for _ in (*one.garments, one.body)], "fits": list(one.fits)} for one in fitted
        ],
    }
    measured = _measured(np.concatenate(missed))
    html = document(
        "try_on/try_on.html",
        title=title,
        count=sum(len(one.fits) for one in fitted),
        left_out=measured,
        inside=max(inside),
        scene=script_json(scene),
        grid=script_json(grid),
        script=asset("try_on/try_on.js"),
    )
    return TryOnPage(html, measured, max(inside))


def _on_grid(layer: PageLayer, counts: Sequence[int]) -> FloatArray:
    if layer.frames is None:
        raise TypeError(f"{layer.name} stands still")
    return layer.frames.reshape(*counts, *layer.frames.shape[1:])


def _measured(distances: FloatArray) -> dict[str, float] | None:
    if len(distances) == 0:
        return None
    median, p95, most = np.percentile(distances, [50, 95, 100])
    return {"median": float(median), "p95": float(p95), "most": float(most)}
