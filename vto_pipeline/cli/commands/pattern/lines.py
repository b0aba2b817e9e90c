"""A sewing pattern in tables and as JSON: its panels and its seams."""

from __future__ import annotations

from typing import Any

import numpy as np

from vto_pipeline.cli.tables import table_lines
from vto_pipeline.garment.pattern.figures import SeamFigures, panel_figures, seam_figures
from vto_pipeline.io.patterns.loops import edges_length
from vto_pipeline.model.pattern import Pattern


def pattern_facts(pattern: Pattern) -> dict[str, Any]:
    """Return the figures of a pattern as JSON values; a length's key ends in its unit."""
    panels = [
        {
            "name": one.name,
            "size": one.size,
            "area_cm2": 1e4 * one.area,
            "outline_mm": 1e3 * one.outline,
            "edges": dict(one.edges),
            "grain_deg": None if one.grain is None else float(np.rad2deg(one.grain)),
            "seam_allowance_mm": None if one.allowance is None else 1e3 * one.allowance,
            "notches": one.notches,
        }
        for one in map(panel_figures, pattern.panels)
    ]
    seams = [
        {
            "size": size,
            "first": seam.first,
            "second": seam.second,
            "lengths_mm": [1e3 * length for length in seam.lengths],
            "mismatch_mm": 1e3 * seam.mismatch,
            "mismatch_share": seam.share,
        }
        for size, seam in _seams(pattern)
    ]
    return {"name": pattern.name, "unit": pattern.unit, "sizes": list(pattern.sizes), "panels": panels, "seams": seams}


def pattern_lines(pattern: Pattern) -> list[str]:
    """Return the tables of a pattern: one of panels, and one of seams if it has any."""
    rows = []
    for one in map(panel_figures, pattern.panels):
        edges = ", ".join(f"{count} {shape}" for shape, count in one.edges.items())
        grain = "unknown" if one.grain is None else f"{np.rad2deg(one.grain):.1f}°"
        allowance = "unknown" if one.allowance is None else f"{1e3 * one.allowance:.1f} mm"
        area, outline = f"{1e4 * one.area:.1f}", f"{1e3 * one.outline:.0f}"
        rows.append((one.name, one.size, area, outline, edges, grain, allowance, str(one.notches)))
    heads = ("panel", "size", "cm²", "outline mm", "edges", "grain", "seam allowance", "notches")
    lines = table_lines(heads, rows)
    seams = _seams(pattern)
    if not seams:
        return [*lines, "", "no stitches in the file; a plan names edges by these numbers:", "", *_edge_lines(pattern)]
    sewn = []
    for size, seam in seams:
        first, second = (f"{1e3 * length:.1f}" for length in seam.lengths)
        mismatch = f"{1e3 * seam.mismatch:+.1f} mm, {seam.share:.1%}"
        sewn.append((seam.first, seam.second, size, first, second, mismatch))
    return [*lines, "", *table_lines(("sewn", "to", "size", "mm", "mm", "mismatch"), sewn)]


def _seams(pattern: Pattern) -> list[tuple[str, SeamFigures]]:
    """Return each size and seam."""
    return [(size, seam) for size in pattern.sizes for seam in seam_figures(pattern.of_size(size))]


def _edge_lines(pattern: Pattern) -> list[str]:
    """Return the table of all edges: number, length, and where they begin and end."""
    rows = []
    for panel in pattern.of_size(pattern.sizes[0]).panels:
        for number, edge in enumerate(panel.edges):
            ends = [f"{1e3 * x:.0f}, {1e3 * y:.0f}" for x, y in edge.points[[0, -1]]]
            rows.append((panel.name, str(number), f"{1e3 * edges_length([edge]):.1f}", edge.shape, *ends))
    return table_lines(("panel", "edge", "mm", "shape", "from mm", "to mm"), rows)
