"""The noise floor: the spread of measurements over repeated scans of one body."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from vto_pipeline.avatar.from_scan import ScanConfig, fit_scan
from vto_pipeline.avatar.measure import measure
from vto_pipeline.bench.bench import Measured, Row, Watch
from vto_pipeline.bench.body.iso20685 import CLASSES, LIMITS_MM
from vto_pipeline.bench.samples.customer import make_customer
from vto_pipeline.bench.timing import Timing, clocked
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

_JITTER_M = 0.001


def repeat_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """Turned anywhere, with other noise and other points used each time; the spread beside the limits of ISO 20685."""
    repeats = 2 if quick else 10
    config = ScanConfig(probes=500, iterations=5) if quick else ScanConfig()
    body = make_customer()
    measured: list[tuple[dict[str, float], float]] = []

    def spread(kind: str) -> Measured:
        if not measured:
            measured.extend(_again(body, config, seed) for seed in range(repeats))
        values = np.array([[1e3 * found[name] for name in CLASSES[kind]] for found, _ in measured])
        return Timing(float(np.median([seconds for _, seconds in measured])), repeats), {
            "spread_mm": float(values.std(axis=0, ddof=1).max()),
            "group_limit_mm": LIMITS_MM[kind],
        }

    for kind in LIMITS_MM:
        settings = {"repeats": repeats, "noise_mm": 1e3 * _JITTER_M, "probes": config.probes}
        yield watch.row(kind, "repeated scan", settings, len(body.vertices), lambda kind=kind: spread(kind))  # type: ignore[misc]


def _again(body: TriangleMesh, config: ScanConfig, seed: int) -> tuple[dict[str, float], float]:
    rng = np.random.default_rng(seed)
    turn = Rotation.from_rotvec([0.0, rng.uniform(-np.pi, np.pi), 0.0]).as_matrix()
    scan = TriangleMesh(body.vertices @ turn.T + rng.normal(0.0, _JITTER_M, body.vertices.shape), body.faces)
    fitted, seconds = clocked(fit_scan, scan, config, Job(seed=seed))
    return dict(measure(fitted).values), seconds
