"""Error of a registration to a known body against run time, by points used and stiffness levels."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vto_pipeline.avatar.from_scan import ScanConfig, fit_scan
from vto_pipeline.avatar.measure import measure
from vto_pipeline.avatar.template.template import beyond_armscye
from vto_pipeline.bench.bench import Measured, Row, Value, Watch
from vto_pipeline.bench.body.people import poor_scan, random_body
from vto_pipeline.bench.body.slices import TRUNK, girth_errors
from vto_pipeline.bench.samples.customer import make_customer
from vto_pipeline.bench.timing import timed
from vto_pipeline.geometry.closest import closest_points
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.scan.surface import SurfaceConfig, reconstruct_cloud

_PROBES = (500, 1000, 3000, 10_000)
_LEVELS = (1, 2, 4, 6)
_STEPS = (5, 10, 20, 40)
_JUDGED = 6000


class _Scan(NamedTuple):
    """A surface to fit, the body behind it, and that body without its arms, where it is known what those are."""

    surface: TriangleMesh
    body: TriangleMesh
    trunk: TriangleMesh | None = None


def scan_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """A body of another kind, whole; and bodies of our own kind behind noise, outliers and holes."""
    scenes = {"another model's body": _foreign()} if quick else {"another model's body": _foreign(), **_own()}
    plain = ScanConfig(iterations=5) if quick else ScanConfig()
    fit_scan(next(iter(scenes.values())).surface, ScanConfig(probes=500, iterations=5))  # compiles
    for scene, scan in scenes.items():
        for probes in (1000,) if quick else _PROBES:
            yield _row(watch, scene, "points", scan, plain.model_copy(update={"probes": probes}))
        for levels in () if quick else _LEVELS:
            fewer = plain.model_copy(update={"stiffness": plain.stiffness[:levels]})
            yield _row(watch, scene, "stiffness levels", scan, fewer)
        for steps in () if quick else _STEPS:
            yield _row(watch, scene, "Gauss-Newton steps", scan, plain.model_copy(update={"iterations": steps}))


def _foreign() -> _Scan:
    body = make_customer()
    return _Scan(body, body)


def _own() -> dict[str, _Scan]:
    """Bodies that may hold their arms against the chest."""
    scenes = {}
    for sex, seed in (("female", 0), ("male", 1)):
        body = random_body(sex, seed)
        surface = reconstruct_cloud(poor_scan(body, seed), SurfaceConfig.model_validate({}), Job())
        trunk = TriangleMesh(body.vertices, body.faces[~beyond_armscye()[body.faces].any(axis=1)])
        scenes[f"own {sex} body, 2 mm noise, 5 % outliers, 10 % holes"] = _Scan(surface, body.mesh, trunk)
    return scenes


def _row(watch: Watch, scene: str, method: str, scan: _Scan, config: ScanConfig) -> Row:
    settings: dict[str, Value] = {
        "probes": config.probes,
        "levels": len(config.stiffness),
        "iterations": config.iterations,
    }

    def once() -> Measured:
        fitted, timing = timed(lambda: fit_scan(scan.surface, config), runs=1)
        read = measure(fitted).values
        own = {row: read[f"{row}_girth"] for row in TRUNK}
        girths = girth_errors(fitted, own, scan.trunk or scan.body, armless=scan.trunk is not None)
        return timing, surface_errors(scan.body, fitted.mesh) | {
            "girth_mm": 1e3 * max(abs(wrong) for wrong in girths.values()),
            **{f"{row}_girth_mm": 1e3 * wrong for row, wrong in girths.items()},
        }

    return watch.row(scene, method, settings, len(scan.surface.vertices), once)


def surface_errors(truth: TriangleMesh, fitted: TriangleMesh) -> dict[str, Value]:
    """Return mean and 95th percentile of the distance of the true surface from the fitted one [mm], all parts."""
    points, _, _ = sample_surface(truth, _JUDGED, 1)
    _, _, away = closest_points(points, fitted.vertices, fitted.faces)
    return {"surface_mean_mm": 1e3 * float(away.mean()), "surface_p95_mm": 1e3 * float(np.quantile(away, 0.95))}
