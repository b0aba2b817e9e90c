"""One dress on finer and finer meshes: the figures of a fit engineer, compared with the finest."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, partial

import numpy as np

from vto_pipeline.assess.clearance import clearance
from vto_pipeline.assess.zones import ease_at_levels
from vto_pipeline.avatar.measuring.avatar_measurements import fit_levels
from vto_pipeline.avatar.template.regions import trunk_vertices
from vto_pipeline.bench.bench import Measured, Row, Value, Watch
from vto_pipeline.bench.drape.case import DrapeCase, findings
from vto_pipeline.bench.samples.garments.wearer import Wearer
from vto_pipeline.bench.timing import Timing, timed
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_loops, surface_area
from vto_pipeline.model.cloth import Draped
from vto_pipeline.model.mesh import TriangleMesh

VERTICES = (3_000, 6_000, 12_000, 25_000, 50_000)
"""How fine, about."""

_GARMENT = ("dress", "average", "cotton_poplin")
_BUDGET_S = 1500.0  # of a drape: cloth that fine goes on falling fold by fold, and says how far it still is from rest
_PROBE_MM = 30.0  # edges of the mesh whose area tells how long edges must be


def refinement_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """The same dress at each fineness, each against the finest."""
    wanted = (600, 1_200) if quick else VERTICES
    cases = [_case(count) for count in wanted]
    longest = {"settle_seconds": 1.0 if quick else 20.0, "time_budget_s": _BUDGET_S}
    settings: dict[str, Value] = {"target_error_mm": 0.5, **longest}
    for case in cases:
        yield watch.row(
            f"refinement: {case.name}",
            "drape",
            {**settings, "edge_mm": case.edge_mm},
            len(case.made().mesh.vertices),
            partial(_measure, case, cases[-1], tuple(settings.items())),
        )


def figures(garment: TriangleMesh, rest: TriangleMesh, wearer: Wearer) -> dict[str, float]:
    """Return what is read off a draped garment.

    Args:
        garment: At rest on the body [m].
        rest: Its rest shape, the same faces.
        wearer: Whose body it is on.

    Returns:
        hem_mm, the mean height of the lowest opening; girths of the garment where it goes around the trunk; and
        clearance_mm, the median distance to the body.
    """
    body = wearer.avatar.mesh
    hem = min((garment.vertices[loop, 1].mean() for loop in boundary_loops(garment)), default=np.nan)
    every, on_trunk = np.ones(len(garment.faces), np.bool_), np.all(trunk_vertices(wearer.avatar)[body.faces], axis=1)
    levels = ease_at_levels(garment, rest.vertices, body, fit_levels(wearer.avatar), every, on_trunk)
    girths = {f"{zone}_girth_mm": 1e3 * ease.garment_girth for zone, ease in levels.items() if ease is not None}
    gap = float(np.median(clearance(garment, body).distance))
    return {"hem_mm": 1e3 * float(hem), **girths, "clearance_mm": 1e3 * gap}


def _case(vertices: int) -> DrapeCase:
    """Return the garment with about this many vertices: V equilateral triangles' corners cover V √3/2 l²."""
    probe = DrapeCase(*_GARMENT, edge_mm=_PROBE_MM).made().mesh
    area = surface_area(probe)
    return DrapeCase(*_GARMENT, edge_mm=round(1e3 * float(np.sqrt(area / (vertices * np.sqrt(0.75)))), 2))


def _measure(case: DrapeCase, finest: DrapeCase, settings: tuple[tuple[str, Value], ...]) -> Measured:
    best, _ = _draped(finest, settings)
    found, timing = _draped(case, settings)
    rest, best_rest = (TriangleMesh(one.made().rest.positions, one.made().mesh.faces) for one in (case, finest))
    own, truth = figures(found.mesh, rest, case.wearer), figures(best.mesh, best_rest, case.wearer)
    off = {f"off_{name}": abs(own[name] - truth[name]) for name in own if name in truth}
    apart = SurfaceDistance(best.mesh).nearest(found.mesh.vertices).distance
    middle, high = 1e3 * np.percentile(apart, [50, 95])
    spread = {"from_finest_mm": float(middle), "from_finest_p95_mm": float(high)}
    return timing, {**spread, **own, **off, **findings(found)}


@cache
def _draped(case: DrapeCase, settings: tuple[tuple[str, Value], ...]) -> tuple[Draped, Timing]:
    return timed(partial(case.drape, dict(settings)), runs=1)
