"""The mannequin's placement from its outline: many starts, one winner, or a refusal in words."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.outline.contour import ContourMesh
from vto_pipeline.garment.outline.edges import EdgePhoto
from vto_pipeline.garment.outline.fit import INSIDE_REACH, OutlineFit, OutlineProblem
from vto_pipeline.geometry.remeshing.decimate import decimate
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config

FEW_PHOTOS = 12
"""So many, from all sides, tell good starts from bad ones."""
WIDEST, COARSE = 0.06, 0.012
"""Reach of the first step and of the steps that rank the starts [share of the form's size]."""
COARSE_STEPS, FINE_STEPS, SIZE_STEPS = 8, 12, 8
FINEST_PX = 3.0
"""Reach of the last steps, in pixels on the form."""
UPRIGHT = (1, 3, 4, 5)
"""Of the seven ways to move, those that leave an upright form upright."""
LARGEST_FORMS = (40_000, 10_000, 4_000)
"""Faces, for photos of full size, of half, and smaller; an outline at their pixels is not changed by more."""
SAME_PLACE = 0.02
"""Placements whose points differ by no more than this on average are one [share of the form's size]."""
MET = 0.004
"""Placements no farther apart than this take the same steps from here on [share of the form's size]."""
SHARED_PX = 0.5
"""What cameras may all have wrong alike, so that photos do not disagree over it [px]."""


class OutlineConfig(Config):
    """How the mannequin's outline in the photos is used."""

    refined: int = Field(default=4, ge=1, le=50, description="Starts followed to the end")
    least_support: float = Field(
        default=0.35, ge=0, le=1, description="Least share of the visible outline that is an edge"
    )
    least_photos: int = Field(default=4, ge=2, le=1000, description="Photos that must show some of the outline")
    rival_support: float = Field(
        default=0.8, gt=0, le=1, description="Another placement as good as this share is an error"
    )
    worst_sigma_mm: float = Field(
        default=4.0, ge=0.01, le=50, description="Largest placement uncertainty accepted [mm]"
    )


@dataclass(frozen=True)
class OutlinePlacement:
    """Where the outline puts the mannequin.

    Args:
        mannequin_from_scan: Rigid, or a similarity where the scale was free, shape (4, 4).
        fit: The last step.
        sigma: Standard error of the least certain point [m].
        scale_error: Standard error of the scale [share]; 0 where it was known.
        depth: So far inside the form is inside by more than the photos' pixels explain [m].
        size: By what the scan would have to be multiplied for the outline to fit best; 1 where its scale was free.
        size_error: Standard error of that [share].
        size_merit: How much better than now the outline then fits the photos, as a ratio.
    """

    mannequin_from_scan: FloatArray
    fit: OutlineFit
    sigma: float
    scale_error: float
    depth: float
    size: float = 1.0
    size_error: float = 0.0
    size_merit: float = 1.0


def place_by_outline(
    form: TriangleMesh,
    scan: FloatArray,
    photos: Sequence[EdgePhoto],
    starts: Sequence[FloatArray],
    free_scale: bool,
    config: OutlineConfig,
    job: Job,
) -> OutlinePlacement:
    """Find the placement in which the outline of the form lies on edges of the photos.

    Cloth hides part of the outline and is never inside the form. Each start takes some steps in a few photos with the
    form upright; the best are followed in all photos, with all ways to move free, to a reach of some pixels.

    Args:
        form: The mannequin [m].
        scan: Points of the garment's scan, spread evenly, shape (N, 3), in its own unit.
        photos: As edges.
        starts: mannequin_from_scan, each (4, 4), with a scale.
        free_scale: Whether the scale is unknown.
        config: Settings.
        job: Receives progress and the figures.

    Raises:
        GarmentError: the outline is not found, found in two places, or leaves the placement uncertain.
    """
    meshes = [ContourMesh(decimate(form, faces)) for faces in LARGEST_FORMS]
    mesh = meshes[0]
    distance = SurfaceDistance(mesh.mesh)
    some = np.unique(np.linspace(0, len(photos) - 1, min(len(photos), FEW_PHOTOS)).round().astype(int))
    few = OutlineProblem(meshes, distance, scan, [photos[k] for k in some])
    free: tuple[int, ...] = (*UPRIGHT, 6) if free_scale else UPRIGHT
    job.progress(0.4, f"outline: {len(starts)} starts")
    rough = _followed([_inverse(start) for start in starts], few, free, WIDEST, COARSE_STEPS, lambda _: COARSE)
    chosen = _distinct(rough, mesh, SAME_PLACE)[: config.refined]
    job.progress(0.7, f"outline: {len(chosen)} placements")
    every = OutlineProblem(meshes, distance, scan, photos)
    free, finest = tuple(range(7 if free_scale else 6)), _finest(photos, mesh)
    fits = _followed([fit.scan_from_form for fit in chosen], every, free, 2 * COARSE, FINE_STEPS, finest)
    fits = _distinct(fits, mesh, SAME_PLACE)
    found = _accept(fits, mesh, photos, free_scale, config, job)
    return found if free_scale else _sized(found, every, photos, mesh)


def _sized(
    found: OutlinePlacement, every: OutlineProblem, photos: Sequence[EdgePhoto], mesh: ContourMesh
) -> OutlinePlacement:
    """Return a rigid placement with the size in which the outline would fit best."""
    placement, finest = found.fit.scan_from_form, _finest(photos, mesh)
    sized = _followed([placement], every, tuple(range(7)), 2 * COARSE, SIZE_STEPS, finest)[0]
    pixel = _pixel(placement, photos, mesh)
    error = np.hypot(np.sqrt(sized.covariance[6, 6]), SHARED_PX * pixel / (0.5 * mesh.size))
    size = float(np.cbrt(np.linalg.det(_inverse(sized.scan_from_form)[:3, :3])))
    merit = _worth(sized) / max(_worth(found.fit), 1e-9)
    return replace(found, size=size, size_error=float(error), size_merit=merit)


def _followed(
    placements: list[FloatArray],
    problem: OutlineProblem,
    free: Sequence[int],
    widest: float,
    steps: int,
    finest: Callable[[FloatArray], float],
) -> list[OutlineFit]:
    """Follow placements to where the outline lies on edges; of those that meet on the way, the first goes on.

    Args:
        placements: scan_from_form, each (4, 4).
        problem: The photos.
        free: Which ways they may move.
        widest: Reach of the first step [share of the form's size].
        steps: How many.
        finest: Of a placement, the reach of the last step [share of the form's size].

    Returns:
        Where they end, the best first.
    """
    form, size = problem.forms[-1], problem.form.size
    fits: list[OutlineFit] = []
    for along in np.linspace(0.0, 1.0, steps):
        reaches = [max(widest, last) ** (1 - along) * last**along for last in map(finest, placements)]
        fits = [problem.step(one, size * reach, free) for one, reach in zip(placements, reaches, strict=True)]
        placements = [fit.scan_from_form for fit in _distinct(fits, form, MET)]
    ends = [problem.step(one, size * finest(one), free, move=False) for one in placements]
    return sorted(ends, key=_worth, reverse=True)


def _finest(photos: Sequence[EdgePhoto], mesh: ContourMesh) -> Callable[[FloatArray], float]:
    """The reach of the last step of a placement: some pixels on the form [share of its size]."""
    return lambda placement: FINEST_PX * _pixel(placement, photos, mesh) / mesh.size


def _inverse(transform: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.inv(transform), dtype=np.float64)


def _worth(fit: OutlineFit) -> float:
    return fit.support - fit.inside


def _distinct(fits: list[OutlineFit], mesh: ContourMesh, least: float) -> list[OutlineFit]:
    """Of placements less than this apart [share of the form's size], the first."""
    kept: list[OutlineFit] = []
    for fit in fits:
        if all(_apart(fit, other, mesh) > least for other in kept):
            kept.append(fit)
    return kept


def _apart(one: OutlineFit, other: OutlineFit, mesh: ContourMesh) -> float:
    """Mean distance between two placements of the form [share of its size]."""
    between = np.linalg.solve(one.scan_from_form, other.scan_from_form)
    moved = mesh.mesh.vertices @ between[:3, :3].T + between[:3, 3]
    return float(np.linalg.norm(moved - mesh.mesh.vertices, axis=1).mean() / mesh.size)


def _pixel(placement: FloatArray, photos: Sequence[EdgePhoto], mesh: ContourMesh) -> float:
    """Side of a pixel on the form, the median over the photos [m]."""
    scale = float(np.cbrt(np.linalg.det(placement[:3, :3])))
    middle = placement[:3, :3] @ mesh.mesh.vertices.mean(axis=0) + placement[:3, 3]
    away = [photo.cam_from_scan[2, :3] @ middle + photo.cam_from_scan[2, 3] for photo in photos]
    return float(np.median([abs(z) / p.levels[0].camera.fx for z, p in zip(away, photos, strict=True)])) / scale


def _accept(
    fits: list[OutlineFit],
    mesh: ContourMesh,
    photos: Sequence[EdgePhoto],
    free_scale: bool,
    config: OutlineConfig,
    job: Job,
) -> OutlinePlacement:
    """Measure the best placement, and refuse it where the photos do not settle it."""
    best = fits[0]
    rival = max((_worth(fit) / max(_worth(best), 1e-9) for fit in fits[1:]), default=0.0)
    shared = SHARED_PX * _pixel(best.scan_from_form, photos, mesh)
    arm = 0.5 * mesh.size
    parts = np.array([arm] * 3 + [1.0] * 3 + [arm])[: len(best.covariance)]
    spread = best.covariance * np.outer(parts, parts)
    sigma = float(np.sqrt(np.linalg.eigvalsh(spread)[-1] + shared**2))
    of_scale = float(np.hypot(np.sqrt(best.covariance[6, 6]), shared / arm)) if free_scale else 0.0
    job.measure(
        outline_support=round(best.support, 3),
        outline_rival=round(rival, 3),
        outline_photos=best.photos,
        outline_rms_mm=best.rms * 1e3,
        uncertainty_mm=sigma * 1e3,
    )
    hint = "show more of the bare mannequin (neck, arms, stand) on several sides, before a backdrop of another colour"
    if best.photos < config.least_photos or best.support < config.least_support:
        raise GarmentError(
            f"the mannequin's outline is not in the photos: {best.support:.0%} of it lies on edges in {best.photos} "
            f"photos; at least {config.least_support:.0%} in {config.least_photos} photos is needed",
            hint="is it the right mannequin, in metres, in the same pose? " + hint,
        )
    if rival > config.rival_support:
        raise GarmentError(
            f"the mannequin's outline fits the photos in two places, the second {rival:.0%} as well as the first",
            hint=hint,
        )
    if sigma > config.worst_sigma_mm * 1e-3:
        raise GarmentError(
            f"the mannequin's outline leaves its placement uncertain by {sigma * 1e3:.1f} mm; at most "
            f"{config.worst_sigma_mm:g} mm is allowed",
            hint=hint,
        )
    depth = INSIDE_REACH * FINEST_PX * _pixel(best.scan_from_form, photos, mesh)
    return OutlinePlacement(_inverse(best.scan_from_form), best, sigma, of_scale, depth)
