"""Bad starts: crossings left after untangling, motion and stretch of the cloth, and run time."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from vto_pipeline.bench.bench import Measured, Row, Watch
from vto_pipeline.bench.collision.bad_starts import BAD_STARTS, BadStart, bad_start
from vto_pipeline.bench.measures import edge_strain
from vto_pipeline.bench.timing import timed
from vto_pipeline.cloth.judge.crossings import crossings_between, self_crossings
from vto_pipeline.cloth.untangle import Untangled, untangle
from vto_pipeline.model.mesh import TriangleMesh

THICKNESS = 1e-3  # [m]


def untangling_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """Every case, three times in a hurry and else ten times, differently jittered."""
    for name in BAD_STARTS:
        for jitter in range(3 if quick else 10):
            start = bad_start(name, jitter)
            yield watch.row(name, "untangle", {"jitter": jitter}, len(start.positions), partial(_measure, start))


def _measure(start: BadStart) -> Measured:
    def run() -> Untangled:
        return untangle(start.positions, start.faces, body=start.body, thickness=THICKNESS)

    found, timing = timed(run, warm=run)
    strain = edge_strain(found.positions, start.positions, start.faces)
    move = np.linalg.norm(found.positions - start.positions, axis=1)
    return timing, {
        "pairs_before": _pairs(start, start.positions),
        "pairs_left": _pairs(start, found.positions),
        "places_left": len(found.places),
        "area_growth_share": found.area_growth,
        "rms_stretch": float(np.sqrt(np.mean(strain**2))),
        "moved_mm": float(1e3 * move.max()),
        "moved_mean_mm": float(1e3 * move.mean()),
        "rounds": found.rounds,
    }


def _pairs(start: BadStart, positions: np.ndarray) -> int:
    mesh = TriangleMesh(positions, start.faces)
    outer = 0 if start.body is None else len(crossings_between(mesh, start.body))
    return len(self_crossings(mesh)) + outer
