"""Collision: queries, broad phase, scenes of self-contact, what is left out, bad starts, and friction."""

from __future__ import annotations

from collections.abc import Iterator

from vto_pipeline.bench.bench import Row, Watch
from vto_pipeline.bench.collision.broad import broad_rows
from vto_pipeline.bench.collision.friction import friction_rows
from vto_pipeline.bench.collision.left_out import left_out_rows
from vto_pipeline.bench.collision.queries import query_rows
from vto_pipeline.bench.collision.scenes import scene_rows
from vto_pipeline.bench.collision.untangling import untangling_rows


def rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """Measure all of them."""
    for part in (query_rows, broad_rows, scene_rows, left_out_rows, untangling_rows, friction_rows):
        yield from part(quick, watch)
