"""Bad starts: what is left after untangling, how far the cloth had to move, whether it grew, and how long it took."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from vto_pipeline.bench.bench import Measured, Row, Watch
from vto_pipeline.bench.collision.bad_starts import BAD_STARTS, BadStart, bad_start
from vto_pipeline.bench.timing import timed
from vto_pipeline.cloth.untangle import Untangled, untangle
from vto_pipeline.geometry.intersections import intersecting_faces, self_intersections
from vto_pipeline.geometry.topology import edges
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
    links = edges(TriangleMesh(start.positions, start.faces))
    was, now = (np.linalg.norm(x[links[:, 1]] - x[links[:, 0]], axis=1) for x in (start.positions, found.positions))
    move = np.linalg.norm(found.positions - start.positions, axis=1)
    return timing, {
        "pairs_before": _pairs(start, start.positions),
        "pairs_left": _pairs(start, found.positions),
        "places_left": len(found.places),
        "area_growth_share": found.area_growth,
        "rms_stretch": float(np.sqrt(np.mean((now / was - 1.0) ** 2))),
        "moved_mm": float(1e3 * move.max()),
        "moved_mean_mm": float(1e3 * move.mean()),
        "rounds": found.rounds,
    }


def _pairs(start: BadStart, positions: np.ndarray) -> int:
    mesh = TriangleMesh(positions, start.faces)
    outer = 0 if start.body is None else len(intersecting_faces(mesh, start.body))
    return len(self_intersections(mesh)) + outer
