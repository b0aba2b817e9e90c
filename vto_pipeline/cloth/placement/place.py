"""Placement of a garment on a new body: unit, axes and best position."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from pydantic import Field

from vto_pipeline.cloth.placement.body_growth import lead_to_body
from vto_pipeline.cloth.placement.orientation import (
    FALLING,
    LARGER,
    axis_names,
    best_orientation,
    fits_when_larger,
    larger,
    of_few_triangles,
    other_way_round,
    other_way_up,
    promising_orientations,
)
from vto_pipeline.cloth.placement.thinning import Thinning
from vto_pipeline.cloth.placement.voxel_fit import BodyCubes, VoxelPlacement, quarter_turns
from vto_pipeline.errors import InputError
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.garment import Garment
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config
from vto_pipeline.units import LENGTH_M

_PLAUSIBLE = (0.12, 1.3)  # longest side of a garment as a share of the body's: from briefs to a gown with a train
_SMALLEST = 0.02  # the same of a patch of cloth that is in metres: no other unit would make it larger
_ALIKE = 0.98  # as good, but for where the cubes happen to lie
_FAR_BETTER = 1.25  # times the worth of its own size: a garment that fits gains less by being larger
_DEEP = 0.01  # m
_HEIGHTS, _ALL_HEIGHTS = 6, 24  # tried where limbs are astray: where that takes long to tell, and where it does not
_WORTH_A_TRY = 0.5  # of the score of the first place: less is beside the body
_FILE_STATURE = 1.72  # m: the mean of both sexes, which GarmentCode draws for
_FILE_ORIGINS = (0.0, 1.15)  # m over the floor: GarmentCode has it there, its predecessor where SMPL's template has it
_BESIDE, _ABOVE, _BELOW = 0.1, 0.03, 0.12  # m from where a file has it: hoods are laid out higher than they are worn
_AROUND = 32  # cubes along the longest side: enough to tell units, which differ by 2.5 at least


class PlaceConfig(Config):
    """How a garment without a source body is placed on the body."""

    place: str = Field(
        "auto", pattern="^(auto|as_it_stands|align)$", description="auto aligns a garment that is out of place"
    )
    cube_mm: float = Field(15.0, ge=5, le=50, description="Resolution of the placement search [mm]")
    cloth_in_body: float = Field(
        2.0, ge=0, le=100, description="Weight of cloth inside the body against body inside the garment"
    )
    stands_well: float = Field(
        0.95, ge=0, le=1, description="auto keeps a garment whose place scores this share of the best"
    )
    turned_well: float = Field(
        0.85,
        ge=0,
        le=1,
        description="Share of the best score with which a garment stays as files have it: y up and front +z, or z up "
        "and front -y",
    )
    buried: float = Field(
        0.1,
        ge=0,
        le=1,
        description="Share of a garment over 10 mm deep in the body above which it starts enlarged",
    )


class Placement(NamedTuple):
    """The placement of a garment: scaled and rotated about the origin, stretched, then shifted.

    Args:
        scale: Metres in its unit.
        turn: Rotation, shape (3, 3).
        stretch: How much larger than it is the garment starts, for the body to be inside.
        shift: [m], shape (3,).
    """

    scale: float
    turn: FloatArray
    stretch: float
    shift: FloatArray

    def rest_positions(self, rest: FloatArray) -> FloatArray:
        """Return the rest positions of the garment, shape (V, 3), in metres and in the body's axes."""
        return self.scale * rest @ self.turn.T

    def start_positions(self, positions: FloatArray) -> FloatArray:
        """Return the start positions of a garment from its original ones, shape (V, 3) [m]."""
        return self.stretch * self.rest_positions(positions) + self.shift


_AS_IT_STANDS = Placement(1.0, np.eye(3), 1.0, np.zeros(3))


def find_placement(
    garment: TriangleMesh,
    body: TriangleMesh,
    config: PlaceConfig,
    job: Job,
    laid_out: bool = False,
    worn: bool = False,
) -> Placement:
    """Return the placement that a pattern's file means, or else that in which the body fills the garment best.

    Args:
        garment: As it stands, in metres or another unit, with any axis up.
        body: Where it shall go [m].
        config: Search and thresholds.
        job: Receives what is done, and why.
        laid_out: Whether it stands as a pattern file has it, in metres and upright: its own place is the first choice.
        worn: Whether it was worn there: then it is not moved at all, unless the body is not in it, or a limb goes
            through it.

    Raises:
        InputError: in no unit is this a garment for a body of this size, or the body fills it nowhere.
    """
    if config.place == "as_it_stands":
        job.note("garment left where it stands, as requested")
        return _AS_IT_STANDS
    cubes = BodyCubes(body, 1e-3 * config.cube_mm, config.cloth_in_body)
    if laid_out and config.place == "auto":
        own = _as_worn(garment, cubes, job) if worn else _as_laid_out(garment, cubes, job)
        if own is not None:
            return own
    scale = _scale(garment, cubes, job)
    metres = TriangleMesh(scale * garment.vertices, garment.faces)
    ways = promising_orientations(metres, cubes, config.turned_well)
    stands, fullest = ways[0], max(ways, key=lambda way: way.score)
    if round(fullest.score, 6) <= 0.0:  # but for what the transforms round
        raise InputError(
            "the body fills this garment nowhere: it goes around nothing of the body",
            hint="give it as it is worn, sewn and open; drape.place=as_it_stands leaves it where it lies",
        )
    best = best_orientation(metres, cubes, ways, config.turned_well)
    thinning, few = Thinning(body), of_few_triangles(metres)
    sized = partial(_enlarge_until_body_inside, metres, cubes, best, thinning, config)
    if (turned := other_way_up(metres, few, cubes, best, sized, thinning.limbs_astray, config.turned_well)) is not None:
        job.note("garment turned the other way up: more limbs are where its openings are then")
        best = turned
    if (turned := other_way_round(metres, few, cubes, best, thinning.neck_lean, config.turned_well)) is not None:
        job.note("garment turned the other way round: its neck is lower in front then")
        best = turned
    if (best.turn == stands.turn).all():
        best, gain = stands, fullest.score / max(stands.score, 1e-9) - 1.0
        if (gain + 1.0) * _ALIKE > 1.0:
            job.note(
                f"garment not turned, though ({axis_names(fullest.turn)}) as (x, y, z) would score {gain:.1%} better"
            )
    else:
        job.note(
            f"garment turned: its ({axis_names(best.turn)}) is the body's (x, y, z); as it stood, it scored "
            f"{_relative_score(stands.score, best.score):.0%} of the best"
        )
    stretch, best = _enlarge_until_body_inside(metres, cubes, best, thinning, config)
    job.metrics["needs_larger_share"] = stretch - 1.0
    if stretch > 1.0:
        job.warn(f"too small: this body needs it {stretch - 1:.0%} larger")
    if config.place == "auto":
        stretch, best = _where_limbs_are_in_place(metres, cubes, stretch, best, thinning, job)
    share = _relative_score(best.score_in_place, best.score)
    if config.place == "auto" and best is stands and scale == 1.0 and share >= config.stands_well:
        job.note(f"garment left where it stands: its place scores {share:.0%} of the best")
        return _AS_IT_STANDS
    job.note(
        f"garment moved by ({', '.join(f'{1e3 * part:.0f}' for part in best.shift)}) mm (x, y, z) to where the body "
        f"fills it best; its first place scored {share:.0%} of that"
    )
    return Placement(scale, best.turn, stretch, best.shift)


def place_garment(garment: Garment, body: TriangleMesh, config: PlaceConfig, job: Job) -> Garment:
    """Return the garment in its place, with its rest shape in metres and rotated alike: the warp is its vertical.

    Args, Raises: See `find_placement`.
    """
    placed = find_placement(garment.mesh, body, config, job, garment.laid_out, garment.worn)
    mesh = TriangleMesh(placed.start_positions(garment.mesh.vertices), garment.mesh.faces, garment.mesh.colors)
    rest = garment.rest
    panels = None if rest.panels is None else placed.scale * rest.panels
    return Garment(mesh, replace(rest, positions=placed.rest_positions(rest.positions), panels=panels))


def _as_worn(garment: TriangleMesh, body: BodyCubes, job: Job) -> Placement | None:
    """Return that it stays, where the body fills it and no limb goes through it; None: it was not on this body.

    The body fills a loose garment as well some way off, so its best place by the cubes is not where it was worn.
    """
    best = body.fit(garment).best_placement(np.eye(3))
    if best.score_in_place <= max(_WORTH_A_TRY * best.score, 0.0) or Thinning(body.mesh).limbs_astray(garment):
        return None
    job.note("garment left where its panels were worn, as its file says")
    return _AS_IT_STANDS


def _as_laid_out(garment: TriangleMesh, body: BodyCubes, job: Job) -> Placement | None:
    """Return the placement that a pattern's file means; None where that is beside the body.

    The file was drawn for another body: the garment's top, which it hangs from, goes to the same share of the stature.
    """
    fit = body.fit(garment)
    top, floor = float(garment.vertices[:, 1].max()), float(body.mesh.vertices[:, 1].min())
    ratio = float(np.ptp(body.mesh.vertices[:, 1])) / _FILE_STATURE
    middle = np.median(body.mesh.vertices, axis=0)
    within = (_BESIDE, 0.5 * (_ABOVE + _BELOW), _BESIDE)
    meant = []
    for origin in _FILE_ORIGINS:
        height = floor + ratio * (top + origin) - top
        near = np.array([middle[0], height + 0.5 * (_ABOVE - _BELOW), middle[2]])
        meant += fit.best_placements(np.eye(3), 1, near, within)
    if not meant or round(max(way.score for way in meant), 6) <= 0.0:
        return None
    best = max(meant, key=lambda way: way.score)

    def at_other_heights() -> list[VoxelPlacement]:
        anywhere = (_BESIDE, np.inf, _BESIDE)
        ways = fit.best_placements(np.eye(3), _HEIGHTS, best.shift, anywhere)
        return sorted(ways, key=lambda way: abs(way.shift[1] - best.shift[1]))

    thinning = Thinning(body.mesh)

    def pierced(there: TriangleMesh) -> int:
        return thinning.limbs_astray(there) or lead_to_body(body.mesh, there, Job()).pierced  # the dearer one last

    best = _least_pierced(best, at_other_heights, garment, pierced, job)
    job.note(
        f"garment put where its file has it on a body of {_FILE_STATURE:.2f} m, at this body's stature: moved by "
        f"({', '.join(f'{1e3 * part:.0f}' for part in best.shift)}) mm (x, y, z)"
    )
    return Placement(1.0, best.turn, 1.0, best.shift)


def _where_limbs_are_in_place(
    garment: TriangleMesh, body: BodyCubes, stretch: float, best: VoxelPlacement, thinning: Thinning, job: Job
) -> tuple[float, VoxelPlacement]:
    """Return how much larger the garment starts, and the best height at which the fewest limbs are out of place.

    A trunk may fill a loose skirt better than the hips do, but there its arms go through the cloth; and hips a tight
    blouse better than the chest does, but there its neck is at the waist.

    What hangs from one opening for both arms goes below them. Where it is out of place, or too small, it goes to the
    lowest of the heights that are as good to it, were it large enough: it slides. There it starts in its own size.
    """
    start = TriangleMesh(stretch * garment.vertices, garment.faces)
    there, fit = best.placed(start), body.fit(start)
    heights = partial(fit.best_placements, best.turn, _ALL_HEIGHTS)
    if not thinning.hangs(there):
        return stretch, _least_pierced(best, heights, start, thinning.limbs_out_of_place, job)
    if stretch > 1.0 or thinning.limbs_out_of_place(there) > 0:
        below = [way for way in heights() if thinning.is_below_arms(way.placed(start))]
        good = [way for way in below if way.score >= FALLING * below[0].score]
        own, turned = body.fit(garment), garment.vertices @ best.turn.T
        ways = []
        for way in sorted(good, key=lambda way: float(way.shift[1])):
            rise = way.placed(start).vertices[:, 1].max() - turned[:, 1].max()
            ways += own.best_placements(best.turn, 1, np.array([0.0, rise, 0.0]), (np.inf, body.cube, np.inf))
        if ways:
            best = _least_pierced(ways[0], lambda: ways[1:], garment, thinning.limbs_out_of_place, job)
            rise = best.placed(garment).vertices[:, 1].max() - there.vertices[:, 1].max()
            job.note(f"it hangs: put {1e3 * rise:+.0f} mm from where it fits best, with fewer limbs in the way")
            return 1.0, best
    return stretch, best


def _least_pierced(
    first: VoxelPlacement,
    others: Callable[[], Sequence[VoxelPlacement]],
    garment: TriangleMesh,
    astray: Callable[[TriangleMesh], int],
    job: Job,
) -> VoxelPlacement:
    """Return the first place, or the next in which fewer limbs are astray.

    Args:
        first: The best place.
        others: Finds further ones, the next best first.
        garment: As large as it starts [m].
        astray: Counts the limbs that are not where they are meant to be, with a garment there.
        job: Receives that it went elsewhere.
    """

    def count(way: VoxelPlacement) -> int:
        return astray(way.placed(garment))

    best, fewest = first, count(first)
    if fewest == 0:
        return first
    job.progress(0.0, f"{fewest} limbs are astray: other heights are tried")
    for way in others():
        if way.score >= _WORTH_A_TRY * first.score and (found := count(way)) < fewest:
            best, fewest = way, found
        if fewest == 0:
            break
    if best is not first:
        rise = 1e3 * (best.shift[1] - first.shift[1])
        job.note(f"another height than that which fits best, by {rise:+.0f} mm: fewer limbs are astray there")
    return best


def _enlarge_until_body_inside(
    garment: TriangleMesh, body: BodyCubes, own: VoxelPlacement, thinning: Thinning, config: PlaceConfig
) -> tuple[float, VoxelPlacement]:
    """Return by how much the garment must start larger for the body to be inside it, and its place then.

    So it must where much of it is buried; or where a person fills it far better then, and limbs are in its way or it
    hangs: a head fills a skirt best that no hips get into. What fits tightly as it is worn is filled better then, too.

    Args:
        garment: As large as it is [m].
        body: To be inside.
        own: Its best place at its own size, with the turn to keep.
        thinning: Of the body.
        config: Thresholds.
    """
    scores: list[float] = []
    for cubes in fits_when_larger(garment, body):
        scores.append(cubes.best_placement(own.turn).score)
        if scores[-1] < FALLING * max(scores):
            break
    best = int(np.argmax(scores))
    if best == 0:
        return 1.0, own
    if scores[best] < _FAR_BETTER * scores[0] or not thinning.tells_too_small(own.placed(garment)):
        depth = -SurfaceDistance(body.mesh).signed(own.placed(garment).vertices).distance
        if (depth > _DEEP).mean() <= config.buried:
            return 1.0, own
    there = body.fit(larger(garment, best)).best_placement(own.turn)
    return (LARGER**best, there) if there.score > own.score else (1.0, own)


def _scale(garment: TriangleMesh, body: BodyCubes, job: Job) -> float:
    """Return the garment's unit in metres: one if plausible, else the unit in which the body fills it best."""
    longest = np.ptp(garment.vertices, axis=0).max() / np.ptp(body.mesh.vertices, axis=0).max()
    low, high = _PLAUSIBLE
    plausible = {unit: metres for unit, metres in LENGTH_M.items() if low <= metres * longest <= high}
    if _SMALLEST <= longest <= high:
        return 1.0
    if not plausible:
        raise InputError(
            f"the garment's longest side is {longest:.3g} times the body's. It should be {low} to {high} times; "
            f"no unit of {', '.join(LENGTH_M)} gives that",
            hint="scale the garment, or give the unit of its file",
        )
    worth = dict.fromkeys(plausible, 0.0)
    for unit, metres in plausible.items() if len(plausible) > 1 else ():
        scaled = TriangleMesh(metres * garment.vertices, garment.faces)
        cubes = body.fit(scaled, max(1.0, np.ptp(scaled.vertices, axis=0).max() / (_AROUND * body.cube)))
        worth[unit] = max(cubes.best_placement(turn).score for turn in quarter_turns())
    unit = max(worth, key=lambda name: worth[name])
    job.note(f"garment assumed to be in {unit}: in metres its longest side would be {longest:.3g} times the body's")
    return plausible[unit]


def _relative_score(worth: float, best: float) -> float:
    return max(worth, 0.0) / best if best > 0.0 else 0.0
