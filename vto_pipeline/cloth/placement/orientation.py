"""Which way up a garment goes, and which way round: as files have it, unless body or limbs tell otherwise."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from vto_pipeline.cloth.placement.voxel_fit import BodyCubes, VoxelFit, VoxelPlacement, quarter_turns
from vto_pipeline.errors import InputError
from vto_pipeline.geometry.remeshing.decimate import decimate
from vto_pipeline.geometry.topology import boundary_loops
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

LARGER = 1.2
"""Times its size: how much larger a garment is tried at each step, up to twice as large as it is."""

FALLING = 0.85
"""Of the best score yet: larger garments need not be tried."""

_STEPS = 4
_COARSE = 2.0  # times the cube: enough to tell which ways up are worth a second look
_TELLING = 1.5  # times the cube: enough to tell them apart
_CLOSE = 0.9  # of the best coarse score: these are looked at again with fine cubes
_FEW = 4000  # triangles: enough to tell where limbs go
_LEANS_BACK = np.deg2rad(10.0)  # of a neckline: by so much none does in front
_LIMBS_TELL = 2  # fewer limbs astray: one is, of many a garment that is worn as it should be


def promising_orientations(garment: TriangleMesh, body: BodyCubes, turned_well: float) -> list[VoxelPlacement]:
    """Return the best places of the garment as it is turned in the file, first, and after promising quarter turns.

    Args:
        garment: In metres.
        body: Where it shall go.
        turned_well: Share of the best score with which it stays as files have it.
    """
    turns = quarter_turns()
    cubes = body.fit(garment, _COARSE)
    coarse = np.array([cubes.best_placement(turn).score for turn in turns])
    promising = coarse >= np.maximum(_CLOSE * coarse.max(), turned_well * coarse[0])
    cubes = body.fit(garment)
    looks = zip(turns, promising, strict=True)
    return [cubes.best_placement(turn) for turn, look in looks if look or as_files_have_it(turn)]


def best_orientation(
    garment: TriangleMesh, body: BodyCubes, ways: Sequence[VoxelPlacement], turned_well: float
) -> VoxelPlacement:
    """Return that of some ways to turn the garment in which it is meant to be worn.

    A body fills a garment that is back to front, or a loose skirt upside down, almost as well or better. So the score
    counts only where it is clear.

    Args:
        garment: In metres.
        body: Where it shall go.
        ways: The promising ones.
        turned_well: Share of the best score with which it stays as files have it.
    """
    best = ways[_preferred([way.turn for way in ways], np.array([way.score for way in ways]), turned_well)]
    if as_files_have_it(best.turn):
        return best
    turns = quarter_turns()
    if _is_upright(max(ways, key=lambda way: way.score).turn):  # to be tight is no reason to be upside down
        turns = [turn for turn in turns if _is_upright(turn)]
    return _best_if_larger(garment, body, turns, turned_well)


def other_way_up(
    garment: TriangleMesh,
    few: TriangleMesh,
    body: BodyCubes,
    best: VoxelPlacement,
    enlarged: Callable[[], tuple[float, VoxelPlacement]],
    limbs_astray: Callable[[TriangleMesh], int],
    turned_well: float,
) -> VoxelPlacement | None:
    """Return the best place the other way up, where limbs tell that it is worn so; None where they do not.

    A shirt upside down is filled as well as a shirt: by hips. But arms are nowhere near its sleeves, and legs go
    through its neck. What is too small is filled best by a head, with limbs astray, however it is turned: it is looked
    at as large as it starts.

    Args:
        garment: In metres.
        few: The same in few triangles.
        body: Where it shall go.
        best: Its best place.
        enlarged: Finds how many times its size it starts, and its place then.
        limbs_astray: Counts the limbs that are not where they are meant to be, with a garment there.
        turned_well: Share of the best score that another way needs.
    """
    before = limbs_astray(best.placed(few))
    if before >= _LIMBS_TELL:
        times, there = enlarged()
        before = min(before, limbs_astray(there.placed(TriangleMesh(times * few.vertices, few.faces))))
    if before < _LIMBS_TELL:
        return None
    cubes = body.fit(garment)
    ways = [cubes.best_placement(half @ best.turn) for half in (np.diag([-1.0, -1.0, 1.0]), np.diag([1.0, -1.0, -1.0]))]
    for way in sorted(ways, key=lambda way: -way.score):
        if way.score >= turned_well * best.score and limbs_astray(way.placed(few)) <= before - _LIMBS_TELL:
            return way
    return None


def other_way_round(
    garment: TriangleMesh,
    few: TriangleMesh,
    body: BodyCubes,
    best: VoxelPlacement,
    neck_lean: Callable[[TriangleMesh], float | None],
    turned_well: float,
) -> VoxelPlacement | None:
    """Return the best place the other way round, where the neck tells that it is worn so; None where it does not.

    Necklines are lower in front: their planes lean forward by 2 to 50 degrees, half of them by 23 and more.

    Args:
        garment: In metres.
        few: The same in few triangles.
        body: Where it shall go.
        best: Its best place.
        neck_lean: How far the neck of a garment there leans forward [rad]; None where it has none.
        turned_well: Share of the best score that another way needs.
    """
    lean = neck_lean(best.placed(few))
    if lean is None or lean > -_LEANS_BACK:
        return None
    way = body.fit(garment).best_placement(np.diag([-1.0, 1.0, -1.0]) @ best.turn)
    return way if way.score >= turned_well * best.score else None


def of_few_triangles(garment: TriangleMesh) -> TriangleMesh:
    """Return a garment [m] in few triangles; as it is where edges would have more than two of them then."""
    few = decimate(garment, _FEW)
    try:
        boundary_loops(few)
    except InputError:
        return garment
    return few


def fits_when_larger(garment: TriangleMesh, body: BodyCubes) -> Iterator[VoxelFit]:
    """Yield the fits of a garment [m] as large as it is, and larger by a step each time."""
    for step in range(_STEPS + 1):
        yield body.fit(larger(garment, step), _TELLING)


def larger(garment: TriangleMesh, steps: int) -> TriangleMesh:
    """Return a garment [m] larger by so many steps."""
    return TriangleMesh(LARGER**steps * garment.vertices, garment.faces)


def axis_names(turn: FloatArray) -> str:
    """Name which of the garment's axes a turn, shape (3, 3), makes the body's x, y and z."""
    return ", ".join(("-" if row.sum() < 0.0 else "") + "xyz"[np.abs(row).argmax()] for row in turn)


def as_files_have_it(turn: FloatArray) -> bool:
    """Return whether a turn, shape (3, 3), brings y up and front +z, or z up and front -y, to the body's y and z."""
    return _is_upright(turn) and turn[0, 0] == 1.0


def _is_upright(turn: FloatArray) -> bool:
    """Return whether what is up in the file, y or z, is up on the body."""
    return bool((turn[1] == (0, 1, 0)).all() or (turn[1] == (0, 0, 1)).all())


def _preferred(turns: Sequence[FloatArray], scores: FloatArray, turned_well: float) -> int:
    """Return which turn is taken: one as files have garments, unless another is far better."""
    best = int(np.argmax(scores))
    usual = (k for k, turn in enumerate(turns) if as_files_have_it(turn))
    return next((k for k in usual if scores[k] >= turned_well * scores[best]), best)


def _best_if_larger(
    garment: TriangleMesh, body: BodyCubes, turns: Sequence[FloatArray], turned_well: float
) -> VoxelPlacement:
    """Return the best place, turned as the garment would be if larger, in one of these ways.

    One too small for the trunk may suit a thigh, and a tight top the hips upside down, its sleeves beside them. So the
    turn is that which suits the size that fits best and the next larger one, in which nothing is tight.
    """
    scores: list[FloatArray] = []
    for cubes in fits_when_larger(garment, body):
        scores.append(np.array([cubes.best_placement(turn).score for turn in turns]))
        if scores[-1].max() < FALLING * max(one.max() for one in scores):
            break
    fits = int(np.argmax([one.max() for one in scores]))
    relative = np.sum([one / max(one.max(), 1e-9) for one in scores[fits : fits + 2]], axis=0)
    return body.fit(garment).best_placement(turns[_preferred(turns, relative, turned_well)])
