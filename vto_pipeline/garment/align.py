"""Bring the scan of a dressed mannequin into the mannequin's frame."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import Field

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.alignment.coarse_align import PlacementSearch, tilted_rotations, upright_rotations
from vto_pipeline.garment.alignment.robust_icp import MannequinAlignment, robust_icp, scale_of
from vto_pipeline.garment.alignment.scale_search import scaled_starts
from vto_pipeline.garment.outline.edges import load_edges
from vto_pipeline.garment.outline.inside import inside_share
from vto_pipeline.garment.outline.search import OutlineConfig, place_by_outline
from vto_pipeline.geometry.rigid import transform_mesh
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import face_normals, surface_area
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.camera import CameraSet
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
FEW = 2000
"""Scan points that rank the starts."""
SAME_SCALE = 0.02
"""Placements whose scales differ by no more than this share are one."""
SIZE_OFF, SIZE_SIGMAS = 0.01, 4.0
"""A scan in metres may fit the mannequin better in a size that differs by this share, or by so many standard errors."""
SPACING = 0.01
"""Scan noise is taken as independent from one such square to the next when the uncertainty is estimated [m]."""


class AlignConfig(Config):
    """How the scan is brought onto the mannequin."""

    samples: int = Field(8000, ge=1000, le=100_000, description="Scan points used")
    yaw_starts: int = Field(24, ge=4, le=180, description="Directions tried about the vertical")
    candidates: int = Field(6, ge=1, le=50, description="Placements refined; twice as many where the scale is unknown")
    widest_band_mm: float = Field(3.0, ge=0.2, le=20, description="Farther out, a point is never bare mannequin [mm]")
    enough_bare: float = Field(0.03, ge=0, le=1, description="Least share of the scan that must lie on bare mannequin")
    upright_bare: float = Field(
        0.08, ge=0, le=1, description="Below this share, outline or other up axes are tried, where the scale is known"
    )
    most_inside: float = Field(0.02, ge=0, le=1, description="Largest share of the scan inside the mannequin")
    worst_sigma_mm: float = Field(1.0, ge=0.01, le=50, description="Largest placement uncertainty accepted [mm]")
    rival_merit: float = Field(
        0.9, gt=0, le=1, description="A placement of another scale that is nearly as good is an error [share]"
    )
    outline: OutlineConfig = Field(default_factory=OutlineConfig, description="The mannequin's outline in photos")


GIVE_A_SCALE = "give the scan a scale: a printed board in the photos, or a known length (scale.lengths)"


@dataclass(frozen=True)
class PosedPhotos:
    """The photos a scan was made from.

    Args:
        paths: Their files.
        cameras: In the scan's frame and unit.
        beside_depth: Whether they are a depth camera's: then depth was read even where their colours tell nothing.
    """

    paths: tuple[Path, ...]
    cameras: CameraSet
    beside_depth: bool = False


def align_to_mannequin(
    surface: TriangleMesh, mannequin: TriangleMesh, config: AlignConfig, job: Job, photos: PosedPhotos | None = None
) -> FloatArray:
    """Return mannequin_from_surface, shape (4, 4): rigid, or a similarity where the scan has no scale of its own.

    What was scanned of the bare mannequin (neck, forearms, stand) tells the placement. Where that is too little, as of
    a form without texture, its outline in the photos does. Where there are photos and no scale, the outline alone does:
    cloth that lies close passes for bare mannequin of another size.

    Raises:
        GarmentError: neither settles the placement, and why; or scan and mannequin differ in size.
    """
    scan = _Scan(surface, mannequin, config, job)
    if photos is None:
        return scan.of_same_size(scan.on_bare_parts(config.enough_bare, tilted=True))
    if scan.free:
        reason = "the scan has no scale of its own, and in another size close cloth may pass for bare mannequin"
    else:
        try:
            found = scan.on_bare_parts(config.upright_bare, tilted=False)
        except GarmentError as error:
            reason = error.problem
        else:
            return scan.of_same_size(found)
    outlined = scan.by_outline(photos)
    if not isinstance(outlined, GarmentError):
        job.note(f"the mannequin is placed by its outline in the photos: {reason}")
        return outlined
    no_outline = outlined
    if scan.free:
        hint = f"{_of_unplaced(photos.cameras)}{no_outline.hint}; or {GIVE_A_SCALE}"
        raise GarmentError(no_outline.problem, hint=hint) from no_outline
    try:
        found = scan.on_bare_parts(config.enough_bare, tilted=True)
    except GarmentError as error:
        problem = f"{error.problem}; and {no_outline.problem}"
        raise GarmentError(problem, hint=_of_unplaced(photos.cameras) + no_outline.hint) from None
    job.warn(f"bare mannequin alone tells the placement, and photos do not confirm it: {no_outline.problem}")
    return found


class _Scan:
    """One scan to be placed."""

    def __init__(self, surface: TriangleMesh, mannequin: TriangleMesh, config: AlignConfig, job: Job) -> None:
        self.surface, self.mannequin, self.config, self.job = surface, mannequin, config, job
        self.distance = SurfaceDistance(mannequin)
        self.normals_there = face_normals(mannequin)
        self.points, self.normals, _ = sample_surface(surface, config.samples, job.seed)
        self.few = slice(None, None, max(config.samples // FEW, 1))
        self.free = not surface.metric

    def on_bare_parts(self, least: float, tilted: bool) -> FloatArray:
        """Place the scan by what it shows of the bare mannequin.

        The garment stands off outwards and is trimmed, and nothing may lie inside. All translations of many rotations
        are scored at once, the best placements refined by robust point-to-plane steps, the best of these kept.

        Args:
            least: Share of the scan that must lie on bare mannequin; cloth that lies close may pass for some percent.
            tilted: Whether other up axes are tried.

        Raises:
            GarmentError: too little bare mannequin shows, what shows leaves some motion undetermined, too much of the
                scan lies inside, or another scale explains it as well.
        """
        config, job = self.config, self.job
        if self.free:
            job.progress(0.1, "trying sizes")
            sized = self._sized(2 * config.candidates)
            return _accept(self._best_of(sized or [np.eye(4)]), self.surface, least, config, job)
        job.progress(0.1, "trying upright placements")
        placed = self._best_of(self._starts(upright_rotations(config.yaw_starts))[: config.candidates])
        share = float(placed.bare.mean())
        fits = share >= config.upright_bare and placed.inside <= config.most_inside
        if fits and not job.force_all:
            job.leave_out(
                "other up axes",
                f"{share:.0%} of the upright scan lies on bare mannequin, {placed.inside:.1%} inside it",
            )
        elif tilted:
            job.progress(0.4, "trying other up axes")
            tilts = self._starts(tilted_rotations(12, np.deg2rad(15.0)))[: config.candidates]
            placed = max((placed, self._best_of(tilts)), key=_worth)
        return _accept(placed, self.surface, least, config, job)

    def by_outline(self, photos: PosedPhotos) -> FloatArray | GarmentError:
        """Place the scan by the mannequin's outline in its photos; where it does not settle the placement, return why.

        Raises:
            GarmentError: the outline fits better in another size: no other placement is right then.
        """
        config, job = self.config, self.job
        job.progress(0.3, "the mannequin's outline in the photos")
        if self.free:
            starts = self._sized(config.yaw_starts)
        else:
            starts = self._starts(upright_rotations(config.yaw_starts))
        if not starts:
            return GarmentError("the scan fits the mannequin in no size", hint="is it the right mannequin?")
        edges = load_edges(photos.paths, photos.cameras, self.surface)
        some = self.points[self.few]
        try:
            found = place_by_outline(self.mannequin, some, edges, starts, self.free, config.outline, job)
        except GarmentError as error:
            return error
        placement = found.mannequin_from_scan
        if not self.free:
            job.measure(size_on_mannequin=found.size)
            if found.size_merit * config.rival_merit > 1.0:
                _refuse_size(found.size, found.size_error)
        inside = inside_share(transform_mesh(self.surface, placement), self.mannequin, found.depth, job.seed)
        job.measure(placed_by="outline", inside_share=inside)
        try:
            _check_inside(inside, config)
        except GarmentError as error:
            return error
        if self.free:
            _tell_scale(scale_of(placement), found.scale_error, job)
        return placement

    def of_same_size(self, placement: FloatArray) -> FloatArray:
        """Return the placement, by bare parts, of a scan in metres; refuse one that they fit better in another size.

        A few per cent are easily overlooked: half of the bare parts still lie near the mannequin, and little inside.
        They come of a board that was printed to fit a page, or of another size of the same form.

        Raises:
            GarmentError: one of the two has a wrong size.
        """
        if self.free:
            return placement
        bands = np.geomspace(COARSE_BANDS[0], self.config.widest_band_mm * 1e-3, FINE_BANDS)
        here, sized = (
            robust_icp(self.points, self.normals, self.distance, self.normals_there, placement, bands, free_scale)
            for free_scale in (False, True)
        )
        error = _uncertainty(sized, self.surface, self.config.samples)[1]
        self.job.measure(size_on_mannequin=sized.scale)
        told = sized.bare.mean() >= self.config.upright_bare
        if told and _worth(here) < self.config.rival_merit * _worth(sized):
            _refuse_size(sized.scale, error)
        return placement

    def _starts(self, rotations: list[FloatArray]) -> list[FloatArray]:
        """The best translation of each rotation, best first."""
        search = PlacementSearch(self.points, self.mannequin, self.distance, COARSE_CELL)
        scored = sorted(search.best_of(rotations), key=lambda found: -found[0])
        return [placement for _, placement in scored]

    def _sized(self, count: int) -> list[FloatArray]:
        """Placements in several sizes, best first."""
        return scaled_starts(self.points[self.few], self.mannequin, self.distance, self.config.enough_bare)[:count]

    def _refined(self, start: FloatArray, bands: FloatArray, which: slice = slice(None)) -> MannequinAlignment:
        points, normals = self.points[which], self.normals[which]
        return robust_icp(points, normals, self.distance, self.normals_there, start, bands, self.free)

    def _best_of(self, starts: list[FloatArray]) -> MannequinAlignment:
        config = self.config
        rough = [self._refined(start, COARSE_BANDS, self.few) for start in starts]
        rough = [one for one in rough if one.bare.mean() >= config.enough_bare] or rough[:1]
        best = max(rough, key=_worth)
        rivals = [one for one in rough if _worth(one) > config.rival_merit * _worth(best)]
        apart = max((abs(np.log(one.scale / best.scale)) for one in rivals), default=0.0)
        if apart > SAME_SCALE:
            other = max(rivals, key=lambda one: abs(np.log(one.scale / best.scale)))
            raise GarmentError(
                f"the scan fits the mannequin in two sizes, {other.scale / best.scale:.2f} to 1: too little is bare",
                hint=f"{GIVE_A_SCALE}; or show more of the bare mannequin",
            )
        bands = np.geomspace(COARSE_BANDS[-1], config.widest_band_mm * 1e-3, FINE_BANDS)
        placed = self._refined(best.mannequin_from_surface, bands)
        for _ in range(TIGHTENINGS):
            band = float(np.clip(BAND_SIGMAS * placed.noise, LEAST_BAND, bands[-1]))
            bands = np.geomspace(bands[-1], band, FINE_BANDS)
            placed = self._refined(placed.mannequin_from_surface, bands)
        return placed


def _worth(placed: MannequinAlignment) -> float:
    """Return a number that is larger for the better of two placements, up to the scan's area: what it explains."""
    return placed.merit * placed.scale**2


def _accept(
    placed: MannequinAlignment, surface: TriangleMesh, least: float, config: AlignConfig, job: Job
) -> FloatArray:
    """Measure the placement, and refuse one that the bare parts do not determine."""
    share = float(placed.bare.mean())
    if share < least:
        raise GarmentError(
            f"only {share:.1%} of the scan lies on bare mannequin; at least {least:.0%} is needed",
            hint="is it the right mannequin, in metres? the scan should show the neck, arms or stand",
        )
    _check_inside(placed.inside, config)
    sigma, of_scale = _uncertainty(placed, surface, config.samples)
    job.measure(
        inlier_rms_mm=placed.rms * 1e3, inlier_share=share, inside_share=placed.inside, uncertainty_mm=sigma * 1e3
    )
    if not surface.metric:
        _tell_scale(placed.scale, of_scale, job)
    if sigma > config.worst_sigma_mm * 1e-3:
        raise GarmentError(
            f"the visible part of the mannequin leaves its placement uncertain by {sigma * 1e3:.1f} mm; "
            f"at most {config.worst_sigma_mm:g} mm is allowed",
            hint="leave more of the mannequin uncovered, on several sides",
        )
    return placed.mannequin_from_surface


def _refuse_size(size: float, error: float) -> None:
    """Refuse a scan in metres that fits the mannequin better in another size, if that is certain.

    Args:
        size: By what the scan is to be multiplied.
        error: Standard error of it.

    Raises:
        GarmentError: it is.
    """
    off = size - 1.0
    if abs(off) > max(SIZE_OFF, SIZE_SIGMAS * error):
        raise GarmentError(
            f"the scan lies on the mannequin only if it is made {abs(off):.1%} {'larger' if off > 0 else 'smaller'}",
            hint="is it the mannequin that was scanned, and in its unit? was the board printed in its full size?",
        )


def _of_unplaced(cameras: CameraSet) -> str:
    """Return what to repair first where most photos have no pose, for the scan then lacks what they show."""
    lost, placed = len(cameras.unregistered), len(cameras.names)
    if lost <= placed:
        return ""
    return f"{lost} of {lost + placed} photos could not be placed, as the warning says: repair that first. Else: "


def _check_inside(share: float, config: AlignConfig) -> None:
    """Refuse a placement in which cloth would be inside the mannequin."""
    if share > config.most_inside:
        raise GarmentError(
            f"{share:.1%} of the scan lies inside the mannequin; at most {config.most_inside:.0%} is allowed",
            hint="is it the right mannequin, in metres, in the same pose?",
        )


def _tell_scale(scale: float, error: float, job: Job) -> None:
    """Record a scale that comes from the mannequin and its standard error [share]."""
    job.measure(scale_source="mannequin", metres_per_unit=scale, scale_error_percent=100 * error)
    job.note(f"the scan is scaled by the mannequin: standard error {100 * error:.2f} %")


def _uncertainty(placed: MannequinAlignment, surface: TriangleMesh, samples: int) -> tuple[float, float]:
    """Return standard deviations: of the least determined motion, as a displacement half the scan's size out [m], and
    of the scale [share], 0 where it was known."""
    lever = 0.5 * placed.scale * float(np.ptp(surface.vertices, axis=0).max())
    turns, shifts = [1.0 / lever] * 3, [1.0] * 3
    unit = np.array([*turns, *shifts, 1.0 / lever][: len(placed.normal_matrix)])
    area = placed.scale**2 * surface_area(surface)
    independent = min(area / samples / SPACING**2, 1.0)  # samples closer than the noise's reach do not add up
    information = placed.normal_matrix * np.outer(unit, unit) * independent
    weakest = float(np.linalg.eigvalsh(information)[0])
    if weakest <= 1e-12:
        return float(placed.rms * 1e6), np.inf
    of_scale = placed.rms * np.sqrt(np.linalg.inv(information)[6, 6]) / lever if len(unit) == 7 else 0.0
    return float(placed.rms / np.sqrt(weakest)), float(of_scale)
