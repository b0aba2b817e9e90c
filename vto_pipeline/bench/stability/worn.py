"""Extreme fabrics when worn: stiffness, weight and friction far beyond real cloth; finite, clean or not."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial

from vto_pipeline.bench.bench import Measured, Row, Value, Watch
from vto_pipeline.bench.drape.case import DrapeCase, findings
from vto_pipeline.bench.timing import Timing, timed
from vto_pipeline.errors import ComputationError
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.model.fabric import Fabric

EXTREMES: Mapping[str, tuple[float, ...]] = {
    "stretch": (1e-3, 1e-2, 1e-1, 1e1, 1e2, 1e3, 1e4),
    "bending": (1e-4, 1e-2, 1e1, 1e2, 1e3),
    "density": (20.0, 50.0, 500.0, 2000.0),
    "friction": (0.0, 0.1, 1.0, 2.0),
}
"""Factors on the stiffnesses in the plane and on those of bending; weights [g/m²]; coefficients of friction."""

_BASE = "cotton_poplin"


def worn_rows(quick: bool, method: str, watch: Watch) -> Iterator[Row]:
    """A shirt of each fabric on a body of average size, with all contacts, by the method that a drape chooses."""
    case = DrapeCase("shirt", "average", _BASE, edge_mm=40.0 if quick else 25.0)
    base = read_fabric(_BASE)
    vertices = len(case.made().mesh.vertices)
    for what, values in EXTREMES.items():
        for value in values[-1:] if quick else values:
            settings: dict[str, Value] = {"target_error_mm": 2.0, "settle_seconds": 0.5 if quick else 20.0}
            yield watch.row(
                f"worn, {what} {value:g}",
                method,
                {**settings, "edge_mm": case.edge_mm},
                vertices,
                partial(_measure, case, extreme(base, what, value), settings),
            )


def extreme(base: Fabric, what: str, value: float) -> Fabric:
    """Return the fabric with one of EXTREMES: a weight or friction in place of its own, a factor on stiffnesses."""
    if what == "density":
        return replace(base, areal_density=1e-3 * value)
    if what == "friction":
        return replace(base, friction=value)
    if what == "bending":
        return replace(base, bending_warp=value * base.bending_warp, bending_weft=value * base.bending_weft)
    return replace(
        base,
        stretch_warp=value * base.stretch_warp,
        stretch_weft=value * base.stretch_weft,
        shear=value * base.shear,
    )


def _measure(case: DrapeCase, fabric: Fabric, settings: Mapping[str, Value]) -> Measured:
    try:
        found, timing = timed(partial(case.drape, settings, fabric), runs=1)
    except ComputationError as failure:
        return Timing(0.0), {"verdict": type(failure).__name__, "status": failure.problem}
    shown = findings(found)
    return timing, {"verdict": verdict(shown), **shown}


def verdict(shown: Mapping[str, Value]) -> str:
    """Return "passes", or what is wrong first: not finite, crossings, or still moving."""
    if not shown["finite"]:
        return "not finite"
    if shown["body_crossings"] or shown["self_crossings"]:
        return "crossings"
    return "passes" if shown["settled"] else "moves"
