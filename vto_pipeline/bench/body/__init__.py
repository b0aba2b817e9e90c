"""Bench of bodies: from scans, naked or dressed, from a tape, from two outlines; extremes, and the noise floor.

people: people whose true body is known
scans, clothed, extremes, coverage, repeats: bodies from scans
measurements, silhouettes: bodies from a tape and from two photos
slices: an independent tape on plane sections
iso20685: the limits of ISO 20685
"""

from __future__ import annotations

from collections.abc import Iterator

from vto_pipeline.bench.bench import Row, Watch
from vto_pipeline.bench.body.clothed import clothed_rows
from vto_pipeline.bench.body.coverage import coverage_rows
from vto_pipeline.bench.body.extremes import extreme_rows
from vto_pipeline.bench.body.measurements import measurement_rows
from vto_pipeline.bench.body.repeats import repeat_rows
from vto_pipeline.bench.body.scans import scan_rows
from vto_pipeline.bench.body.silhouettes import silhouette_rows


def rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """Measure all of them."""
    for part in (scan_rows, coverage_rows, clothed_rows, repeat_rows, measurement_rows, silhouette_rows, extreme_rows):
        yield from part(quick, watch)


TRADE = "every way has another input: who has a scan needs no tape, and who has a tape has no scan"
