"""The broad phase: pairs and time of one search against size, and the proof that skips it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

import numpy as np

from vto_pipeline.bench.bench import Measured, Row, Value, Watch
from vto_pipeline.bench.cloth.scenes import FRICTION
from vto_pipeline.bench.collision.sheets import square
from vto_pipeline.bench.scaling.sizes import fit_power_law
from vto_pipeline.bench.timing import timed
from vto_pipeline.cloth.collision.self_collision.candidates import self_candidates
from vto_pipeline.cloth.collision.self_collision.pieces import surface_components
from vto_pipeline.cloth.collision.self_collision.proximity_bound import prove_separation
from vto_pipeline.cloth.collision.self_collision.self_contact import SelfContact
from vto_pipeline.cloth.collision.self_collision.surface_features import Features, features
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.numerics.spatial import bvh
from vto_pipeline.numerics.spatial.boxes import simplex_boxes, swept_boxes

SIDE = 1.0  # [m]
THICKNESS = 1e-3  # [m]
STEP = 1.0 / 60.0  # [s]
SPEED = 1.0  # of the lower edge against the upper, where the sheet swings [m/s]
FALL = 0.2  # of the top layer against the lowest, where it falls in folds [m/s]
LAYERS = 6

_RUNS = 15  # a search takes milliseconds
_LONG = 0.3  # s; what takes longer is not repeated
_AT_A_TIME = 64  # boxes held against all others, by brute force


class _Step(NamedTuple):
    """A sheet that moves: what a search is given."""

    features: Features
    start: FloatArray
    end: FloatArray
    radius: FloatArray


Search = Callable[[], dict[str, int]]
"""Tells how many "pairs" it found."""


def broad_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """Searches in a sheet that hangs flat and in one that falls in folds, 1k vertices and more; with exponents."""
    sides = (32, 64, 128) if quick else (32, 64, 128, 256)
    for scene, make in (("hanging flat", _hanging), ("falling in folds", _folding)):
        for method, prepare in _METHODS.items():
            measured = []
            for side in sides:
                if method == "brute force" and side > (32 if quick else 64):
                    break
                measure = partial(_measure, prepare, make, side)
                measured.append(watch.row(f"broad phase, {scene}", method, {"side": side}, side**2, measure))
                yield measured[-1]
            if len(measured) > 1:
                yield _exponent(measured)


def _measure(prepare: Callable[[_Step], Search], make: Callable[[int], _Step], side: int) -> Measured:
    search = prepare(make(side))
    found, timing = timed(search, warm=search, runs=_RUNS, budget=_LONG)
    return timing, {**found, "pairs_per_s": found["pairs"] / timing.seconds}


def _exponent(rows: list[Row]) -> Row:
    found = fit_power_law([row.vertices for row in rows], [row.seconds for row in rows])
    errors: dict[str, Value] = {"exponent": found.exponent, "exponent_uncertainty": found.uncertainty}
    last = rows[-1]
    return Row(last.scene, f"{last.method}, exponent", {"sizes": len(rows)}, last.vertices, 0.0, errors)


def _hanging(side: int) -> _Step:
    """A sheet that swings: each point with a speed in proportion to its depth."""
    flat, faces = square(side, SIDE)
    x, _, depth = flat.T
    start = np.column_stack([x, -depth, 0.1 * depth**2])
    return _step(start, start + np.outer(depth - depth.min(), [0.0, 0.0, SPEED * STEP]), faces)


def _folding(side: int) -> _Step:
    """A zigzag of layers two thicknesses apart, of which the upper fall faster."""
    flat, faces = square(side, SIDE)
    along = LAYERS * (flat[:, 0] / SIDE + 0.5)
    zigzag = np.abs(along % 2.0 - 1.0) * SIDE / LAYERS
    start = np.column_stack([zigzag, 2.0 * THICKNESS * along, flat[:, 2]])
    return _step(start, start - np.outer(along / LAYERS, [0.0, FALL * STEP, 0.0]), faces)


def _step(start: FloatArray, end: FloatArray, faces: IntArray) -> _Step:
    return _Step(features(faces, len(start)), start, end, np.full(len(start), 0.5 * THICKNESS))


def _by_tree(step: _Step) -> Search:
    """Return a search with a tree that is refitted."""
    kinds, start, end, radius = step
    tree = bvh.build(start, kinds.faces)

    def search() -> dict[str, int]:
        bvh.refit_swept(tree, start, end, kinds.faces, radius)
        return {"pairs": sum(map(len, self_candidates(tree, kinds, start, end, radius)))}

    return search


def _by_brute_force(step: _Step) -> Search:
    """Return a search that holds each box against all others."""
    kinds, start, end, radius = step
    corners = np.arange(len(start), dtype=np.int32)[:, None]

    def search() -> dict[str, int]:
        boxes = swept_boxes(start, end, radius)
        edges = _overlapping(kinds.edges, kinds.edges, boxes) // 2  # each came both ways
        return {"pairs": _overlapping(corners, kinds.faces, boxes) + edges}

    return search


def _overlapping(one: IntArray, other: IntArray, boxes: FloatArray) -> int:
    """Return how many pairs without a common vertex have boxes that overlap."""
    some, others = simplex_boxes(boxes, one), simplex_boxes(boxes, other)
    count = 0
    for first in range(0, len(one), _AT_A_TIME):
        own = some[first : first + _AT_A_TIME, None]
        i, j = np.nonzero(((own[..., :3] <= others[:, 3:]) & (others[:, :3] <= own[..., 3:])).all(axis=2))
        count += int((~(one[first + i, :, None] == other[j, None]).any(axis=(1, 2))).sum())
    return count


def _with_narrow_phase(step: _Step) -> Search:
    """Return all that a step does about the cloth itself: what is near, and how far it may go; nothing left out.

    Else a second run would be answered by what the first had found.
    """
    contact = SelfContact(step.features.faces, step.radius, FRICTION, force_all=True)

    def search() -> dict[str, int]:
        before = contact.counters.impacts
        contact.find_pairs(step.start, step.end, 0.0)
        contact.collision_free(step.start, step.end)
        return {"pairs": contact.counters.impacts - before}

    return search


def _by_proof(step: _Step) -> Search:
    """Return the proof that no search is needed: no pairs, and whether it succeeds."""
    cloth = surface_components(step.features.faces, len(step.start))

    def prove() -> dict[str, int]:
        return {"pairs": 0, "proven": int(prove_separation(cloth, step.start, step.end, step.radius).out)}

    return prove


_METHODS: dict[str, Callable[[_Step], Search]] = {
    "tree": _by_tree,
    "brute force": _by_brute_force,
    "tree and narrow phase": _with_narrow_phase,
    "proof": _by_proof,
}
