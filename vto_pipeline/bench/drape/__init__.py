"""Draping: error against run time, accuracy of its prediction, refinement, rest shapes, and work left out.

`garments`, `sewn` and `transfer` are no part of `vto bench`: they take the files that they are given. The first drapes
them and shows each in a `picture_table`. The second sews patterns, with `seam_gaps` and `ipc_crossings` as judges. On
the third finer meshes ride.
"""

from __future__ import annotations

from collections.abc import Iterator

from vto_pipeline.bench.bench import Row, Watch
from vto_pipeline.bench.drape.budget import budget_rows
from vto_pipeline.bench.drape.case import DrapeCase
from vto_pipeline.bench.drape.left_out import drape_left_out_rows
from vto_pipeline.bench.drape.refinement import refinement_rows
from vto_pipeline.bench.drape.scanned import scanned_rows
from vto_pipeline.bench.report_card.fronts import Default, Trade
from vto_pipeline.cloth.drape_config import DrapeConfig


def rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """Measure all of them, once the kernels are compiled."""
    DrapeCase("skirt", "slim", "denim", edge_mm=60.0).drape({"target_error_mm": 0.5})
    for part in (budget_rows, refinement_rows, scanned_rows, drape_left_out_rows):
        yield from part(quick, watch)


def _default(quick: bool) -> Default:
    usual = DrapeConfig.model_validate({}).target_error_mm
    return lambda row: row.method == "drape" and row.settings.get("target_error_mm") == usual


TRADE = Trade(("distance_mm",), _default)
