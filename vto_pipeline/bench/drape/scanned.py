"""Rest shapes from a scan: a shirt of known rest shape is hung on its form, "scanned" and recovered."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, partial
from typing import Literal, get_args

import numpy as np

from vto_pipeline.bench.bench import Measured, Row, Value, Watch
from vto_pipeline.bench.cloth.scenes import shirt_on_form
from vto_pipeline.bench.drape.case import STAND
from vto_pipeline.bench.measures import edge_strain
from vto_pipeline.bench.timing import timed
from vto_pipeline.cloth.drape import drape
from vto_pipeline.cloth.rest_shape.from_hanging import RestShapeConfig, rest_shape
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.garment import Garment, RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

Mode = Literal["as_scanned", "gravity_removed", "inverse"]
MODES: tuple[Mode, ...] = get_args(Mode)

_FABRICS = ("jersey", "cotton_poplin", "silk_charmeuse")
_ERROR_MM = 0.2  # to which each garment is brought to rest


def scanned_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """Each mode on each fabric."""
    edge_mm, seconds = (40.0, 1.0) if quick else (20.0, 20.0)
    vertices = len(shirt_on_form(edge_mm)[0].vertices)
    for fabric in _FABRICS[:1] if quick else _FABRICS:
        for mode in ("as_scanned", "inverse") if quick else MODES:
            settings: dict[str, Value] = {"edge_mm": edge_mm, "target_error_mm": _ERROR_MM, "settle_seconds": seconds}
            measure = partial(_measure, mode, fabric, edge_mm, seconds)
            yield watch.row(f"rest shape: shirt, form, {fabric}", mode, settings, vertices, measure)


def _measure(mode: Mode, fabric: str, edge_mm: float, seconds: float) -> Measured:
    """Return the errors of the rest lengths, and how far the garment then is from the scan, and from elsewhere."""
    cloth = read_fabric(fabric)
    mesh, body = shirt_on_form(edge_mm)
    scan = TriangleMesh(_scan(fabric, edge_mm, seconds), mesh.faces)
    config = RestShapeConfig(mode=mode, target_error_mm=_ERROR_MM, settle_seconds=seconds)
    found, timing = timed(partial(rest_shape, scan, config, Job(), body, cloth), runs=1)
    again = drape(Garment(scan, found), body, cloth, _until_rest(seconds)).mesh.vertices
    elsewhere = drape(Garment(mesh, found), body, cloth, _until_rest(seconds)).mesh.vertices
    wrong = np.abs(edge_strain(found.positions, mesh.vertices, mesh.faces))
    apart, other = (1e3 * np.linalg.norm(x - scan.vertices, axis=1) for x in (again, elsewhere))
    return timing, {
        "length_error_median_share": float(np.median(wrong)),
        "length_error_p95_share": float(np.percentile(wrong, 95)),
        "from_scan_mm": float(apart.mean()),
        "from_scan_p95_mm": float(np.percentile(apart, 95)),
        "from_scan_other_start_mm": float(other.mean()),
    }


@cache
def _scan(fabric: str, edge_mm: float, seconds: float) -> FloatArray:
    """Return where the shirt hangs on its form [m], shape (V, 3)."""
    mesh, body = shirt_on_form(edge_mm)
    cut = Garment(mesh, RestShape(mesh.vertices))
    return drape(cut, body, read_fabric(fabric), _until_rest(seconds)).mesh.vertices


def _until_rest(seconds: float) -> dict[str, Value]:
    return {**STAND, "target_error_mm": _ERROR_MM, "settle_seconds": seconds}
