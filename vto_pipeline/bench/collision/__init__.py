"""Collision: queries, broad phase, scenes of self-contact, work left out, bad starts, and friction.

known_queries, queries: continuous tests whose answer is known
broad: the broad phase against size
sheets, contact_scene, scenes, penetration: scenes of self-contact, and what is measured on them
bad_starts, untangling: tangled starts, and what is left of them
friction, capstan, stick_slip: closed forms of friction
left_out: what leaving work out saves
"""

from __future__ import annotations

from collections.abc import Iterator

from vto_pipeline.bench.bench import Row, Watch
from vto_pipeline.bench.collision.broad import broad_rows
from vto_pipeline.bench.collision.friction import friction_rows
from vto_pipeline.bench.collision.left_out import collision_left_out_rows
from vto_pipeline.bench.collision.queries import query_rows
from vto_pipeline.bench.collision.scenes import scene_rows
from vto_pipeline.bench.collision.untangling import untangling_rows


def rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """Measure all of them."""
    for part in (query_rows, broad_rows, scene_rows, collision_left_out_rows, untangling_rows, friction_rows):
        yield from part(quick, watch)


TRADE = "every way finds the same pairs, and all that touch; only their time differs"
