"""A body from four tape measurements: whether it meets them, and the errors of all others."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.avatar.measure import measure
from vto_pipeline.avatar.measuring.population import population
from vto_pipeline.bench.bench import Measured, Row, Watch
from vto_pipeline.bench.body.people import ASKED, random_measurements
from vto_pipeline.bench.timing import Timing, clocked
from vto_pipeline.model.body import Measurements


def measurement_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """Random people of either sex."""
    count = 2 if quick else 50
    for sex in ("female",) if quick else ("female", "male"):
        yield watch.row(
            f"{sex}, random people",
            "tape",
            {"people": count, "asked": len(ASKED)},
            len(fit_measurements(_asked(sex, 0)).vertices),
            lambda sex=sex: _people(sex, count),  # type: ignore[misc]
        )


def _asked(sex: str, seed: int) -> Measurements:
    return Measurements({name: random_measurements(sex, seed).values[name] for name in ASKED}, sex=sex)


def _people(sex: str, count: int) -> Measured:
    seconds, asked, wrong, mean = [], [], [], []
    average = dict(zip(population(sex).names, population(sex).mean, strict=True))
    for seed in range(count):
        true = random_measurements(sex, seed).values
        body, taken = clocked(fit_measurements, _asked(sex, seed))
        seconds.append(taken)
        read = measure(body).values
        asked.append(max(abs(read[name] - true[name]) for name in ASKED))
        rest = [name for name in true if name not in ASKED and name != "mass"]
        wrong.append([abs(read[name] - true[name]) for name in rest])
        mean.append([abs(average[name] - true[name]) for name in rest])
    return Timing(float(np.median(seconds)), count), {
        "asked_mm": 1e3 * float(max(asked)),
        "unasked_mae_mm": 1e3 * float(np.mean(wrong)),
        "unasked_mae_by_the_mean_mm": 1e3 * float(np.mean(mean)),
    }
