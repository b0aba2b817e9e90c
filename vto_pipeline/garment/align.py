"""Bring the scan of a dressed mannequin into the mannequin's frame."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.coarse_align import PlacementSearch, tilted_rotations, upright_rotations
from vto_pipeline.garment.robust_icp import MannequinAlignment, robust_icp
from vto_pipeline.garment.scale_search import scaled_starts
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import face_area_vectors, face_normals
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config

COARSE_CELL = 0.02
COARSE_BANDS = np.geomspace(0.04, 0.008, 15)
FINE_BANDS = 12
TIGHTENINGS = 5
BAND_SIGMAS = 1.5
"""The band ends at so many standard deviations of the scan's noise: tight cloth lies hardly further out. The noise
looks larger while the placement is off, so that the band is tightened several times."""
LEAST_BAND = 5e-4
SAME_SCALE = 0.02
"""Placements whose scales differ by no more than this share are one."""
SPACING = 0.01
"""Scan noise is taken as independent from one such square to the next when the uncertainty is estimated [m]."""


class AlignConfig(Config):
    """How the scan is brought onto the mannequin."""

    samples: int = Field(8000, ge=1000, le=100_000, description="Scan points used")
    yaw_starts: int = Field(24, ge=4, le=180, description="Directions tried about the vertical")
    candidates: int = Field(6, ge=1, le=50, description="Placements refined; twice as many where the scale is unknown")
    widest_band_mm: float = Field(3.0, ge=0.2, le=20, description="Farther out, a point is never bare mannequin [mm]")
    enough_bare: float = Field(0.03, ge=0, le=1, description="Least share of the scan that must lie on bare mannequin")
    upright_bare: float = Field(0.08, ge=0, le=1, description="Below this share, other up axes are tried too")
    most_inside: float = Field(0.02, ge=0, le=1, description="Largest share of the scan inside the mannequin")
    worst_sigma_mm: float = Field(1.0, ge=0.01, le=50, description="Largest placement uncertainty accepted [mm]")
    rival_merit: float = Field(
        0.9, gt=0, le=1, description="A placement of another scale that is nearly as good is an error [share]"
    )


def align_to_mannequin(surface: TriangleMesh, mannequin: TriangleMesh, config: AlignConfig, job: Job) -> FloatArray:
    """Return mannequin_from_surface, shape (4, 4): rigid, or a similarity where the scan has no scale of its own.

    Only what shows of the bare mannequin (neck, forearms, stand) tells the placement; the garment stands off outwards
    and is trimmed, and nothing may lie inside. All translations of many rotations are scored at once, the best
    placements refined by robust point-to-plane steps, the best of these kept.

    Raises:
        GarmentError: too little bare mannequin shows, what shows leaves some motion undetermined, too much of the
            scan lies inside, or another scale explains it as well.
    """
    distance = SurfaceDistance(mannequin)
    normals_there = face_normals(mannequin)
    points, normals, _ = sample_surface(surface, config.samples, job.seed)
    few = slice(None, None, max(config.samples // 2000, 1))
    free = not surface.metric

    def refined(start: FloatArray, bands: FloatArray, which: slice = slice(None)) -> MannequinAlignment:
        return robust_icp(points[which], normals[which], distance, normals_there, start, bands, free)

    def best_of(starts: list[FloatArray]) -> MannequinAlignment:
        rough = [refined(start, COARSE_BANDS, few) for start in starts]
        rough = [one for one in rough if one.bare.mean() >= config.enough_bare] or rough[:1]
        best = max(rough, key=_worth)
        rivals = [one for one in rough if _worth(one) > config.rival_merit * _worth(best)]
        apart = max((abs(np.log(one.scale / best.scale)) for one in rivals), default=0.0)
        if apart > SAME_SCALE:
            other = max(rivals, key=lambda one: abs(np.log(one.scale / best.scale)))
            raise GarmentError(
                f"the scan fits the mannequin in two sizes, {other.scale / best.scale:.2f} to 1: too little is bare",
                hint="give the scan a scale: a printed board in the photos, or a known length (scale.lengths); or show "
                "more of the bare mannequin",
            )
        bands = np.geomspace(COARSE_BANDS[-1], config.widest_band_mm * 1e-3, FINE_BANDS)
        placed = refined(best.mannequin_from_surface, bands)
        for _ in range(TIGHTENINGS):
            band = float(np.clip(BAND_SIGMAS * placed.noise, LEAST_BAND, bands[-1]))
            bands = np.geomspace(bands[-1], band, FINE_BANDS)
            placed = refined(placed.mannequin_from_surface, bands)
        return placed

    if free:
        job.progress(0.1, "trying sizes")
        sized = scaled_starts(points[few], mannequin, distance, 2 * config.candidates, config.enough_bare)
        placed = best_of(sized or [np.eye(4)])
        return _accept(placed, surface, config, job)
    search = PlacementSearch(points, mannequin, distance, COARSE_CELL)

    def starts(rotations: list[FloatArray]) -> list[FloatArray]:
        scored = sorted((search.best(rotation) for rotation in rotations), key=lambda found: -found[0])
        return [placement for _, placement in scored[: config.candidates]]

    job.progress(0.1, "trying upright placements")
    placed = best_of(starts(upright_rotations(config.yaw_starts)))
    fits = placed.bare.mean() >= config.upright_bare and placed.inside <= config.most_inside
    if fits and not job.force_all:
        reason = f"{placed.bare.mean():.0%} of the upright scan lies on bare mannequin, {placed.inside:.1%} inside it"
        job.leave_out("other up axes", reason)
    else:
        job.progress(0.4, "trying other up axes")
        placed = max((placed, best_of(starts(tilted_rotations(12, np.deg2rad(15.0))))), key=_worth)
    return _accept(placed, surface, config, job)


def _worth(placed: MannequinAlignment) -> float:
    """Return a number that is larger for the better of two placements, up to the scan's area: what it explains."""
    return placed.merit * placed.scale**2


def _accept(placed: MannequinAlignment, surface: TriangleMesh, config: AlignConfig, job: Job) -> FloatArray:
    """Measure the placement, and refuse one that the bare parts do not determine."""
    share = float(placed.bare.mean())
    if share < config.enough_bare:
        raise GarmentError(
            f"only {share:.1%} of the scan lies on bare mannequin; at least {config.enough_bare:.0%} is needed",
            hint="is it the right mannequin, in metres? the scan should show the neck, arms or stand",
        )
    if placed.inside > config.most_inside:
        raise GarmentError(
            f"{placed.inside:.1%} of the scan lies inside the mannequin; at most {config.most_inside:.0%} is allowed",
            hint="is it the right mannequin, in metres, in the same pose?",
        )
    sigma, of_scale = _uncertainty(placed, surface, config.samples)
    job.measure(
        inlier_rms_mm=placed.rms * 1e3, inlier_share=share, inside_share=placed.inside, uncertainty_mm=sigma * 1e3
    )
    if not surface.metric:
        job.measure(scale_source="mannequin", metres_per_unit=placed.scale, scale_error_percent=100 * of_scale)
        job.note(f"the scan is scaled by the mannequin: standard error {100 * of_scale:.2f} %")
    if sigma > config.worst_sigma_mm * 1e-3:
        raise GarmentError(
            f"the visible part of the mannequin leaves its placement uncertain by {sigma * 1e3:.1f} mm; "
            f"at most {config.worst_sigma_mm:g} mm is allowed",
            hint="leave more of the mannequin uncovered, on several sides",
        )
    return placed.mannequin_from_surface


def _uncertainty(placed: MannequinAlignment, surface: TriangleMesh, samples: int) -> tuple[float, float]:
    """Return standard deviations: of the least determined motion, as a displacement half the scan's size out [m], and
    of the scale [share], 0 where it was known."""
    lever = 0.5 * placed.scale * float(np.ptp(surface.vertices, axis=0).max())
    turns, shifts = [1.0 / lever] * 3, [1.0] * 3
    unit = np.array([*turns, *shifts, 1.0 / lever][: len(placed.normal_matrix)])
    area = placed.scale**2 * float(np.linalg.norm(face_area_vectors(surface), axis=1).sum())
    independent = min(area / samples / SPACING**2, 1.0)  # samples closer than the noise's reach do not add up
    information = placed.normal_matrix * np.outer(unit, unit) * independent
    weakest = float(np.linalg.eigvalsh(information)[0])
    if weakest <= 1e-12:
        return float(placed.rms * 1e6), np.inf
    of_scale = placed.rms * np.sqrt(np.linalg.inv(information)[6, 6]) / lever if len(unit) == 7 else 0.0
    return float(placed.rms / np.sqrt(weakest)), float(of_scale)
