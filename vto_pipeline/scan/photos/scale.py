"""Metric scale of photos: from a printed board, with floor and origin, from a stated length, or from a stature."""

from __future__ import annotations

import numpy as np
from pydantic import Field
from scipy.optimize import OptimizeResult, least_squares
from scipy.spatial.transform import Rotation

from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.camera import CameraSet
from vto_pipeline.model.frames import PhotoSet
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud
from vto_pipeline.model.settings import Config
from vto_pipeline.scan.photos.board import board_corners, detect_board
from vto_pipeline.scan.photos.lengths import StatedLength, scale_from_lengths
from vto_pipeline.scan.photos.sfm import transform_reconstruction
from vto_pipeline.scan.photos.stature import scale_from_stature
from vto_pipeline.scan.photos.triangulation import triangulate_points
from vto_pipeline.scan.similarity import fit_similarity


class ScaleConfig(Config):
    """Settings of the metric scale."""

    min_corners: int = Field(6, ge=4, le=1000, description="Corners of the board that at least two photos must see")
    max_error_px: float = Field(2.0, gt=0.1, le=20, description="Corners further from their place are left out [px]")
    max_scale_error: float = Field(0.003, gt=0, le=0.1, description="Standard error above which to warn [share]")
    lengths: tuple[StatedLength, ...] = Field((), description="Known distances between points marked in photos")
    stature: float | None = Field(
        None,
        ge=0.3,
        le=2.6,
        description="Height of the person or form, from the floor to its top [m]",
    )


def apply_scale(
    photos: PhotoSet, cameras: CameraSet, cloud: PointCloud, config: ScaleConfig, job: Job
) -> tuple[CameraSet, PointCloud]:
    """Bring cameras and points into metres, by a stated length, else a board, else a stature, else not at all.

    A length that a user states wins over the board: a board.yaml may be left over from another set-up. A stature does
    not: it is known to a centimetre, a board to a tenth of a millimetre.

    Raises:
        ScanError: a stated length or stature cannot be used.
    """
    if cameras.metric:
        job.leave_out("scale", "the camera poses were given in metres")
        job.measure(scale_source="given poses")
        return cameras, cloud
    if config.lengths:
        scale, error = scale_from_lengths(cameras, config.lengths, config.max_error_px, job)
        return _stated(cameras, cloud, scale, error, "stated length", config, job)
    if photos.board is not None:
        cameras, cloud = apply_board(photos, cameras, cloud, config, job)
        if cameras.metric or config.stature is None:
            return cameras, cloud
    if config.stature is None:
        job.note("no board.yaml with the photos and no stated length: the scan has no scale of its own")
        return cameras, cloud
    scale, error = scale_from_stature(photos, cameras, cloud, config.stature, job)
    return _stated(cameras, cloud, scale, error, "stature", config, job)


def _stated(
    cameras: CameraSet, cloud: PointCloud, scale: float, error: float, source: str, config: ScaleConfig, job: Job
) -> tuple[CameraSet, PointCloud]:
    """Bring cameras and points into metres by what the user stated, and tell how well it fixes them."""
    job.measure(scale_source=source, scale_error_percent=round(100 * error, 4))
    if error > config.max_scale_error:
        more = "; a length, stated in more photos, or a printed board fixes it better"
        job.warn(f"the {source} fixes the scale to {100 * error:.2f} % only{more}")
    return transform_reconstruction(cameras, cloud, np.eye(4), scale=scale, metric=True)


def apply_board(
    photos: PhotoSet, cameras: CameraSet, cloud: PointCloud, config: ScaleConfig, job: Job
) -> tuple[CameraSet, PointCloud]:
    """Bring cameras and points into metres, with the board as the floor.

    The seven numbers of the similarity are fitted to the corners' pixels in all photos at once, by robust least
    squares.

    Args:
        photos: Photos and the board.
        cameras, cloud: Up to scale.
        config: Settings.
        job: Notified of the error of the scale.

    Returns:
        Both in the board's world: metres, y = 0 the board's plane, +Y up, the origin at its centre, +X along its
        columns. With too little of it seen: unchanged, with a warning.
    """
    assert photos.board is not None
    job.progress(0.0, "looking for the board")
    found = detect_board(photos, cameras.names, job)
    world = board_corners(photos.board)
    ids, observed = triangulate_points(found, cameras, config.max_error_px)
    if len(ids) < config.min_corners:
        sighted = sum(len(identity) > 0 for identity, _ in found)
        job.warn(
            f"only {len(ids)} board corners could be placed, from {sighted} photos; {config.min_corners} are needed. "
            "The scan has no scale. Does board.yaml match the printed board?"
        )
        return cameras, cloud
    job.progress(0.7, f"fitting {len(ids)} corners")
    start = _robust_similarity(observed, world[ids])
    pixels = _Pixels(found, cameras, world)
    fit = _refine(pixels, *start, config.max_error_px)
    scale, board_from_scan = _similarity(fit.x)
    error_px = np.linalg.norm(fit.fun.reshape(-1, 2), axis=1)
    good = error_px < config.max_error_px
    jacobian = fit.jac.reshape(-1, 2, 7)[good].reshape(-1, 7)
    if not _determined(jacobian):
        job.warn(f"{len(ids)} board corners do not fix the floor: do they lie on one line? The scan has no scale.")
        return cameras, cloud
    variance = (error_px[good] ** 2).sum() / max(2 * good.sum() - 7, 1)
    scale_error = float(np.sqrt(variance * np.linalg.inv(jacobian.T @ jacobian)[0, 0]))
    residual = scale * observed @ board_from_scan[:3, :3].T + board_from_scan[:3, 3] - world[ids]
    rms_mm = 1000 * float(np.sqrt(np.median((residual**2).sum(1))))
    job.measure(
        board_corners=len(ids),
        board_sightings=int(good.sum()),
        board_photos=len(np.unique(pixels.photo)),
        board_rms_px=round(float(np.sqrt((error_px[good] ** 2).mean())), 3),
        board_corner_median_mm=round(rms_mm, 3),
        scale_error_percent=round(100 * scale_error, 4),
        scale_source="board",
    )
    if scale_error > config.max_scale_error:
        job.warn(f"the board fixes the scale to {100 * scale_error:.2f} % only; show more of it, in more photos")
    placed, points = transform_reconstruction(cameras, cloud, board_from_scan, scale=scale, metric=True)
    below = int((placed.world_from_cam[:, 1, 3] < 0).sum())
    if below > len(placed.names) / 2:
        job.warn(
            f"{below} of {len(placed.names)} photos look at the board from below: is it printed as board.yaml says?"
        )
    return placed, points


class _Pixels:
    """All sightings of corners, flattened for the fit."""

    def __init__(self, found: list[tuple[IntArray, FloatArray]], cameras: CameraSet, world: FloatArray) -> None:
        self.photo = np.repeat(np.arange(len(found)), [len(ids) for ids, _ in found])
        self.world = world[np.concatenate([ids for ids, _ in found])]
        self.pixel = np.concatenate([pixels for _, pixels in found])
        self.pose = cameras.world_from_cam[self.photo]
        self.lens = np.array([[c.fx, c.fy, c.cx, c.cy, c.k1] for c in cameras.intrinsics])[self.photo]

    def residual(self, parameters: FloatArray) -> FloatArray:
        """Projected minus seen [px], flattened (N, 2)."""
        scale, board_from_scan = _similarity(parameters)
        points = (self.world - board_from_scan[:3, 3]) @ board_from_scan[:3, :3] / scale
        local = np.einsum("nji,nj->ni", self.pose[:, :3, :3], points - self.pose[:, :3, 3])
        flat = local[:, :2] / local[:, 2:]
        bent = flat * (1 + self.lens[:, 4:] * (flat**2).sum(1, keepdims=True))
        return np.asarray(bent * self.lens[:, :2] + self.lens[:, 2:4] - self.pixel).ravel()


def _similarity(parameters: FloatArray) -> tuple[float, FloatArray]:
    """Scale (kept as its logarithm) and rigid transform from seven numbers."""
    transform = np.eye(4)
    transform[:3, :3] = Rotation.from_rotvec(parameters[1:4]).as_matrix()
    transform[:3, 3] = parameters[4:]
    return float(np.exp(parameters[0])), transform


def _refine(pixels: _Pixels, scale: float, transform: FloatArray, softness: float) -> OptimizeResult:
    turn = Rotation.from_matrix(transform[:3, :3]).as_rotvec()
    start = np.concatenate([[np.log(scale)], turn, transform[:3, 3]])
    return least_squares(pixels.residual, start, loss="soft_l1", f_scale=softness / 4, x_scale="jac")


def _determined(jacobian: FloatArray) -> bool:
    """Whether a Jacobian (N, 7) fixes every parameter, whatever their units; one of finite differences has 8 digits."""
    if len(jacobian) < 7:
        return False
    length = np.linalg.norm(jacobian, axis=0)
    return bool(length.min() > 0 and np.linalg.svd(jacobian / length, compute_uv=False)[-1] > 1e-5)


def _robust_similarity(source: FloatArray, target: FloatArray) -> tuple[float, FloatArray]:
    """Similarity to the corners, refitted without those more than three median distances away."""
    scale, transform = fit_similarity(source, target)
    for _ in range(5):
        off = np.linalg.norm(scale * source @ transform[:3, :3].T + transform[:3, 3] - target, axis=1)
        near = off <= 3 * np.median(off) + 1e-12
        scale, transform = fit_similarity(source[near], target[near])
    return scale, transform
