"""A batch of drapes as a page with sliders."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.errors import ComputationError, InputError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import GlbPart
from vto_pipeline.pipeline.batch.grid import Axis, Grid, word
from vto_pipeline.render.dress import BODY
from vto_pipeline.report.layers import CLOTH, SKIN, PageLayer, skin_of, surface_of
from vto_pipeline.report.try_on.page import Choice, Fitted, Slider, TryOnPage, build_try_on_page
from vto_pipeline.report.wording import label
from vto_pipeline.stages.entry.outcome import Outcome, open_run
from vto_pipeline.stages.entry.shown import shown_artifacts

_TAPE = "given.body.measurements.measurements."


def try_on_page(grid: Grid, title: str, run_of: Callable[[str], Path], say: Callable[[str], None]) -> TryOnPage:
    """Return the page of a batch that is done.

    Args:
        grid: Its rows.
        title: For people.
        run_of: Name of a row -> folder of its run.
        say: Receives how it goes.

    Raises:
        InputError: a row has no drape with a body.
        ComputationError: what drapes should have in common differs, so there is nothing between them.
    """
    sliding = [axis for axis in grid.axes if axis.slides]
    named = [axis for axis in grid.axes if not axis.slides]
    count = prod(len(axis.values) for axis in sliding)
    fitted: list[Fitted] = []
    for number, _ in enumerate(product(*(axis.values for axis in named))):
        rows = grid.rows[count * number : count * (number + 1)]
        say(f"{len(fitted) + 1} of {len(grid.rows) // count}: {', '.join(row.name for row in rows)}")
        fitted.append(_fitted([open_run(run_of(row.name)) for row in rows]))
    unit = _tape_unit(grid.rows[0].data)
    sliders = [Slider(_name(axis), unit if axis.key.startswith(_TAPE) else "", axis.values) for axis in sliding]
    choices = [Choice(_name(axis), tuple(word(value) for value in axis.values)) for axis in named]
    return build_try_on_page(title, sliders, choices, fitted)


def _name(axis: Axis) -> str:
    parts = axis.key.split(".")
    return label(parts[1] if parts[0] == "given" and not axis.slides else parts[-1])


def _tape_unit(document: Mapping[str, Any]) -> str:
    try:
        return str(document["given"]["body"]["measurements"]["unit"])
    except (KeyError, TypeError):
        return ""


def _fitted(runs: Sequence[Outcome]) -> Fitted:
    """Return the drapes of some runs whose meshes are the same but for their places."""
    names = shown_artifacts(runs[0], detailed=True)
    if not names or not names[-1].endswith("collider"):
        hint = "`want: [draped, fit_report]`, with a body"
        raise InputError("this run has no drape on a body", where=str(runs[0].folder), hint=hint)
    layers = [_layer(name, runs) for name in names]
    return Fitted(tuple(layers[:-1]), layers[-1], tuple(map(_fit, runs)))


def _layer(name: str, runs: Sequence[Outcome]) -> PageLayer:
    values = [_shown(run.read(name)) for run in runs]
    meshes = [surface_of(value) for value in values]
    for run, mesh in zip(runs, meshes, strict=True):
        if not np.array_equal(mesh.faces, meshes[0].faces):
            problem = "its triangles are not those of the first drape, so nothing lies between the two"
            raise ComputationError(problem, where=f"{run.folder}, {name}")
    frames: FloatArray = np.stack([mesh.vertices for mesh in meshes])
    if name.endswith("collider"):
        return PageLayer("Body", meshes[0], "body", SKIN, frames=frames)
    paint = CLOTH if meshes[0].colors is None else meshes[0].colors
    return PageLayer("Garment", meshes[0], "garment", paint, skin=skin_of(values[0]), frames=frames)


def _shown(value: Any) -> TriangleMesh | list[GlbPart]:
    if isinstance(value, TriangleMesh):
        return value
    if isinstance(value, tuple):
        return [part for part in value if part.name != BODY]
    mesh: TriangleMesh = value.final
    return mesh


def _fit(run: Outcome) -> dict[str, Any]:
    """Return what the page says of a drape."""
    ease = {}
    for kind in run.tables.kinds:
        if not kind.name.endswith("fit_report") or not run.made(kind.name):
            continue
        garment = kind.name.removesuffix("fit_report").rstrip("_")
        for zone in run.read(kind.name)["zones"]:
            ease[f"{label(garment)}: {zone['zone']}" if garment else zone["zone"]] = 100.0 * zone["ease_m"]
    words = [text.removeprefix("fit: ") for text in run.verdicts] + [f"warning: {text}" for _, text in run.warnings]
    return {"verdict": "; ".join(words), "ease_cm": ease}
