"""Coverage of the uncertainties of a scanned body: how often 95 % intervals hold the truth."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from vto_pipeline.avatar.from_scan import ScanConfig, fit_scan
from vto_pipeline.avatar.measure import measure
from vto_pipeline.avatar.measuring.definitions import DEFINITIONS
from vto_pipeline.bench.bench import Measured, Row, Value, Watch
from vto_pipeline.bench.body.people import as_standing, poor_scan, random_body
from vto_pipeline.bench.timing import Timing, clocked
from vto_pipeline.model.body import Measurements
from vto_pipeline.model.job import Job
from vto_pipeline.scan.surface import SurfaceConfig, reconstruct_cloud

_FIRST_SEED = 100
"""Of people whom nothing else uses."""
_KINDS = {
    "girths": ("girth", "loop"),
    "extents": ("breadth", "depth"),
    "heights": ("height",),
    "lengths": ("path", "span", "drop"),
}
_GIRTHS = ("neck", "chest", "waist", "navel", "hip", "thigh", "knee", "calf", "ankle")


def coverage_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """Random women and men in turn, scanned poorly; the truth is their body as it stood, at its own rows."""
    count, config = (1, ScanConfig(probes=1000, iterations=5)) if quick else (20, ScanConfig())
    yield watch.row("drawn people", "scan, intervals", {"people": count}, 20_000, lambda: _covered(count, config))


def _covered(count: int, config: ScanConfig) -> Measured:
    seconds, pairs = [], []
    for k in range(count):
        sex = ("female", "male")[k % 2]
        body = random_body(sex, _FIRST_SEED + k)
        scan = reconstruct_cloud(poor_scan(body, _FIRST_SEED + k), SurfaceConfig.model_validate({}), Job())
        fitted, taken = clocked(fit_scan, scan, config)
        seconds.append(taken)
        pairs.append((measure(fitted), measure(as_standing(body)).values))
    return Timing(float(np.median(seconds)), count), interval_errors(pairs)


def interval_errors(pairs: Sequence[tuple[Measurements, Mapping[str, float]]]) -> dict[str, Value]:
    """Return by kind the share of true values inside their 95 % intervals, and errors beside half intervals [mm].

    Args:
        pairs: Of each person what was found, and what is true.
    """
    wrong = {name: np.array([found.values[name] - true[name] for found, true in pairs]) for name in DEFINITIONS}
    half = {name: np.array([1.96 * found.sigmas[name] for found, _ in pairs]) for name in DEFINITIONS}
    inside = {name: float(np.mean(np.abs(wrong[name]) <= half[name])) for name in DEFINITIONS}
    out: dict[str, Value] = {
        f"{label}_inside_share": float(np.mean([inside[n] for n, what in DEFINITIONS.items() if what.kind in kinds]))
        for label, kinds in _KINDS.items()
    }
    for row in _GIRTHS:
        name = f"{row}_girth"
        out[f"{name}_rms_mm"] = 1e3 * float(np.sqrt(np.mean(wrong[name] ** 2)))
        out[f"{name}_interval_mm"] = 1e3 * float(np.sqrt(np.mean(half[name] ** 2)))
        out[f"{name}_inside_share"] = inside[name]
    return out
