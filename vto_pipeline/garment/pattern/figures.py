"""Figures of a pattern: areas and lengths of panels, and how well the two sides of each seam match."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from vto_pipeline.io.patterns.loops import edges_area, edges_length, edges_points
from vto_pipeline.model.pattern import Panel, Pattern, Side

_FLAT_M = 1e-4


@dataclass(frozen=True)
class PanelFigures:
    """What is measured on a panel.

    Args:
        name, size: Of the panel.
        area: [m²].
        outline: Length [m].
        edges: Shape -> how many.
        grain: Angle of the grain line from the y axis, anticlockwise [rad], within a quarter turn; None: unknown.
        allowance: Median distance of the cut line from the outline [m]; None: unknown.
        notches: How many.
    """

    name: str
    size: str
    area: float
    outline: float
    edges: Mapping[str, int]
    grain: float | None
    allowance: float | None
    notches: int


@dataclass(frozen=True)
class SeamFigures:
    """What is measured on a seam.

    Args:
        first, second: Panels and edges of each side, for messages.
        lengths: Of both sides [m].
    """

    first: str
    second: str
    lengths: tuple[float, float]

    @property
    def mismatch(self) -> float:
        """Length of the second side over that of the first [m]."""
        return self.lengths[1] - self.lengths[0]

    @property
    def share(self) -> float:
        """The mismatch over the longer side, without sign."""
        return abs(self.mismatch) / max(self.lengths)


def panel_figures(panel: Panel) -> PanelFigures:
    """Return the figures of a panel."""
    shapes = [edge.shape for edge in panel.edges]
    allowance = None
    if panel.cut:
        outline = _dense(edges_points(panel.edges, _FLAT_M))
        allowance = float(np.median(cKDTree(outline).query(_dense(edges_points(panel.cut, _FLAT_M)))[0]))
    grain = None
    if panel.grain is not None:
        x, y = panel.grain[1] - panel.grain[0]
        grain = float((np.arctan2(-x, y) + np.pi / 2.0) % np.pi - np.pi / 2.0)
    counts = {shape: shapes.count(shape) for shape in dict.fromkeys(shapes)}
    area, outline_m = edges_area(panel.edges), edges_length(panel.edges)
    return PanelFigures(panel.name, panel.size, area, outline_m, counts, grain, allowance, len(panel.notches))


def seam_figures(pattern: Pattern) -> list[SeamFigures]:
    """Return the figures of each seam of a pattern of one size."""
    panels = {panel.name: panel for panel in pattern.panels}
    return [
        SeamFigures(
            _named(stitch.first),
            _named(stitch.second),
            (_chain_length(stitch.first, panels), _chain_length(stitch.second, panels)),
        )
        for stitch in pattern.stitches
    ]


def _chain_length(chain: Sequence[Side], panels: Mapping[str, Panel]) -> float:
    return sum(edges_length([panels[side.panel].edges[side.edge]]) for side in chain)


def _named(chain: Sequence[Side]) -> str:
    return " + ".join(f"{side.panel} {side.edge}" for side in chain)


def _dense(points: np.ndarray) -> np.ndarray:
    """Return a polyline with a point at every millimetre or so."""
    parts = [
        a + np.linspace(0.0, 1.0, max(1, int(np.linalg.norm(b - a) / 1e-3)), endpoint=False)[:, None] * (b - a)
        for a, b in pairwise(points)
    ]
    return np.concatenate(parts)
