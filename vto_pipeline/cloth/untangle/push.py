"""Rows that resolve crossings: parts that passed through go back, and unresolved contours shorten."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.cloth.untangle.contours import Contours, Crossings
from vto_pipeline.cloth.untangle.flood import MeshGraph, flood_sides
from vto_pipeline.cloth.untangle.minimise import contour_shortening_shifts
from vto_pipeline.cloth.untangle.rows import SeparationRows, separation_rows
from vto_pipeline.model.arrays import FloatArray, IntArray

_HALF = 0.3  # metres a contour shortens per metre of shift, at which half the step is taken


def push_rows(
    crossing: Crossings, contour: Contours, sheet: MeshGraph, positions: FloatArray, thickness: float, step: float
) -> tuple[list[SeparationRows], NDArray[np.bool_]]:
    """Return the rows, and the vertices they push, shape (V,).

    Args:
        crossing, contour: Of the cloth with itself.
        sheet: The cloth.
        positions: [m], shape (V, 3).
        thickness: By which what goes back is to be free in the end [m].
        step: How far to go at once [m].
    """
    found = flood_sides(sheet, crossing, contour, positions)
    push, decided = found.push, found.decided | (np.diff(contour.first) == 1)
    for n in contour.order[contour.first[:-1][~found.decided & decided]]:  # a kink: the nearer end of the edge
        height = (positions[crossing.edge[n]] - crossing.point[n]) @ crossing.normal[n]
        push[n] = -np.sign(height[np.abs(height).argmin()]) * crossing.normal[n]
    unknown = contour.order[np.repeat(~decided, np.diff(contour.first))]
    pushed = np.zeros(len(positions), np.bool_)
    back, moved = _back(crossing, push, positions, thickness, step)
    pushed[moved] = True
    pushed[crossing.edge[unknown]] = True
    return [back, _shorter(crossing, unknown, positions, step)], pushed


def _back(
    crossing: Crossings, push: FloatArray, positions: FloatArray, thickness: float, step: float
) -> tuple[SeparationRows, IntArray]:
    """Return rows that take the hindmost end of each edge before the face, and these ends."""
    n = np.flatnonzero(push.any(axis=1))
    direction = push[n]
    height = np.einsum("nkd,nd->nk", positions[crossing.edge[n]] - crossing.point[n, None], direction)
    end = crossing.edge[n, height.argmin(axis=1)]
    made = separation_rows(
        np.column_stack([end, crossing.face[n]]),
        np.column_stack([np.ones(len(n)), -crossing.weights[n]]),
        direction,
        np.minimum(thickness, height.min(axis=1) + step),
        positions,
        len(positions),
    )
    return made, end


def _shorter(crossing: Crossings, chosen: IntArray, positions: FloatArray, step: float) -> SeparationRows:
    """Return rows that shift the chosen crossings' edges against their faces."""
    shift = contour_shortening_shifts(crossing, positions)[chosen]
    gain = np.linalg.norm(shift, axis=1)
    n, shift, gain = chosen[gain > 0.0], shift[gain > 0.0], gain[gain > 0.0]
    return separation_rows(
        np.column_stack([crossing.edge[n], crossing.face[n]]),
        np.column_stack([1.0 - crossing.share[n], crossing.share[n], -crossing.weights[n]]),
        shift / gain[:, None],
        step * gain / (gain + _HALF),
        positions,
        len(positions),
    )
