"""Camera poses and sparse points from photos, up to scale."""

from __future__ import annotations

import signal
import tempfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pydantic import Field

from vto_pipeline.errors import ScanError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.camera import CameraSet
from vto_pipeline.model.frames import PhotoSet
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud
from vto_pipeline.model.settings import Config
from vto_pipeline.scan.photos.board import detect_board
from vto_pipeline.scan.photos.matching.adjust import adjust
from vto_pipeline.scan.photos.matching.best_grey import in_best_grey
from vto_pipeline.scan.photos.matching.board_poses import LEAST_CORNERS, Sightings
from vto_pipeline.scan.photos.matching.certainty import uncertainty_px
from vto_pipeline.scan.photos.matching.features import FAINT, SURE, FeatureConfig, detect, match
from vto_pipeline.scan.photos.matching.from_board import map_from_board
from vto_pipeline.scan.photos.matching.mapping import MIN_PHOTOS, lens_of, map_photos
from vto_pipeline.scan.photos.matching.still_background import grey_beside, paint_over, still_pixels
from vto_pipeline.scan.photos.matching.ties import LEAST_TIES
from vto_pipeline.scan.photos.region import object_region
from vto_pipeline.scan.upright import upright_from_scan

ADVICE = (
    "There is too little texture, or photos are too far apart. Put a printed mat or newspaper under the object. "
    "Project or chalk a pattern on plain fabric. Take photos 10 to 15 degrees apart, or use a depth camera."
)


MOST = 0.75
"""Faint features that place fewer of the photos may place them wrongly: 12 of 24 were 0.8 m off."""
STEREO_SIDE = 1000
"""Stereo looks at photos scaled down to this longer side [px]."""
FEW = 0.8
"""Where a smaller share of the photos could be placed, fainter features are looked for."""

SeekBoard = Callable[[], Sightings | None]
"""Looks for the board in all photos, once."""


class SfmConfig(Config):
    """Settings of structure from motion."""

    features: FeatureConfig = Field(default_factory=FeatureConfig, description="Features and matching")
    enough_features: int = Field(1000, ge=50, le=20_000, description="With fewer per photo, fainter ones are used")
    refined: bool = Field(
        True, description="Cameras are adjusted to far more points than features, in neighbouring photos"
    )
    min_placed: float = Field(
        0.5, ge=0, le=1, description="Share of the photos that must be placed; with fewer, the scan is refused"
    )
    max_error_px: float = Field(2.0, gt=0.1, le=10, description="Largest mean error of a sparse point [px]")
    min_views: int = Field(3, ge=2, le=10, description="Photos that must have seen a sparse point")
    max_camera_px: float = Field(
        4.0, gt=0, le=100, description="Most that cameras may be uncertain: one standard deviation at the object [px]"
    )


def estimate_cameras(photos: PhotoSet, config: SfmConfig, job: Job) -> tuple[CameraSet, PointCloud]:
    """Estimate the camera pose of each photo.

    Args:
        photos: Photos, all in one folder.
        config: Settings.
        job: Notified of photos that could not be placed.

    Returns:
        Cameras and sparse points in a frame of arbitrary scale, roughly upright; the points' normals are the mean
        direction towards the photos that saw them.

    Raises:
        ScanError: fewer than 3 photos could be placed, or than `min_placed`, or most of them too uncertainly.
    """
    load_colmap(job.seed)
    with tempfile.TemporaryDirectory(dir=job.scratch) as scratch:
        job.progress(0.0, "features")
        counts = detect(photos, Path(scratch) / "sure.db", SURE, config.features)
        database, tried = Path(scratch) / "sure.db", None
        seek: SeekBoard = cache(partial(_board, photos, job))
        if np.median(counts) < config.enough_features:
            job.note(f"only {int(np.median(counts))} features in the median photo: looking for fainter ones")
            shown = in_best_grey(photos, Path(scratch) / "grey", job)
            database = Path(scratch) / "faint.db"
            counts = detect(shown, database, FAINT, config.features)
            tried = _by_board_alone(photos, database, counts, seek(), job)
        if tried is None:
            tried = _by_features(photos, database, counts, seek, config, job)
        model, counts, pairs = tried.model, tried.features, tried.pairs
    names = [path.name for path in photos.paths]
    if model is None or model.num_reg_images() < MIN_PHOTOS:
        each = ", ".join(f"{name} {count}" for name, count in zip(names, counts, strict=True))
        few = f"fewer than {MIN_PHOTOS} of {len(names)} photos could be placed and tied together by {LEAST_TIES} points"
        problem = f"{few} ({pairs} pairs match); features per photo: {each}"
        raise ScanError(problem, where=str(photos.paths[0].parent), hint=f"{ADVICE}{_of_board(tried)}")
    _check_enough(tried, names, photos, config)
    if config.refined:
        model = adjust(model, photos, job)
    else:
        job.leave_out("an adjustment to more points than features", "sfm.refined is false")
    _check_certain(model, photos, config, job)
    cameras, cloud = _upright(*_values(model, names, config))
    cameras = replace(cameras, still=tried.still)
    cloud = _without_surroundings(cameras, cloud, job)
    if cameras.unregistered:
        why = f"could not be placed, or fewer than {LEAST_TIES} points tie it to the others"
        reasons = {name: f"{why} ({_shown(tried, names.index(name))})" for name in cameras.unregistered}
        job.measure(left_out_photos=reasons)
        unplaced = f"{len(cameras.unregistered)} of {len(names)} photos could not be placed"
        job.warn(f"{unplaced}: {_lost(tried, names, cameras.unregistered)}. {ADVICE}{_of_board(tried)}")
    job.measure(
        registered=len(cameras.names),
        photos=len(names),
        matched_pairs=pairs,
        features_median=int(np.median(counts)),
        sparse_points=len(cloud.points),
        reprojection_px=round(float(model.compute_mean_reprojection_error()), 3),
    )
    return cameras, cloud


class _Tried(NamedTuple):
    """What came of trying to place photos.

    Args:
        model: A pycolmap Reconstruction, or None.
        features: Per photo.
        pairs: That match.
        by_board: Whether the board placed them.
        corners: Of the board, per photo; empty where it was not looked for.
        still: Whether the camera stood still.
    """

    model: Any | None
    features: list[int]
    pairs: int
    by_board: bool
    corners: Sequence[int] = ()
    still: bool = False

    @property
    def placed(self) -> int:
        """How many photos were placed."""
        return 0 if self.model is None else int(self.model.num_reg_images())


def _by_features(
    photos: PhotoSet, database: Path, features: list[int], seek: SeekBoard, config: SfmConfig, job: Job
) -> _Tried:
    """Match the features of all photos and place these; where few could be, look for other features or the board."""
    job.progress(0.3, f"matching {len(photos.paths)} photos")
    pairs, fixed_camera = match(photos, database, config.features, job)
    job.progress(0.7, f"placing cameras, {pairs} matched pairs")
    tried = _placed(photos, database, features, pairs, seek, job)
    again = None
    if fixed_camera and tried.placed < len(photos.paths):
        again = _beside_background(photos, database.parent, seek, config, job)
    elif tried.placed < FEW * len(photos.paths) and database.stem == "sure" and not tried.by_board:
        job.note(f"only {tried.placed} of {len(photos.paths)} photos could be placed: looking for fainter features")
        shown = in_best_grey(photos, database.parent / "grey", job)
        again = _faint(shown, photos, database.parent / "faint", seek, config, job)
    best = again if again is not None and _is_better(again, tried) else tried
    return best._replace(still=fixed_camera)


def _board(photos: PhotoSet, job: Job) -> Sightings | None:
    """Return what each photo shows of the board; None where there is none."""
    if photos.board is None:
        return None
    names = tuple(path.name for path in photos.paths)
    return dict(zip(names, detect_board(photos, names, job), strict=True))


def _by_board_alone(
    photos: PhotoSet, database: Path, features: list[int], found: Sightings | None, job: Job
) -> _Tried | None:
    """Place photos by the board before any features are matched: then these are sought where the board says only.

    Returns:
        None where it does not place nearly all.
    """
    if found is None or photos.board is None:
        return None
    corners, folder = [len(found[path.name][0]) for path in photos.paths], photos.paths[0].parent
    if np.mean(np.array(corners) >= LEAST_CORNERS) < FEW:
        return None
    tried = _Tried(map_from_board(database, folder, photos.board, found, job), features, 0, True, corners)
    if tried.placed < FEW * len(corners):
        return None
    job.leave_out("matching the features of all photos", f"the board places {tried.placed} of {len(corners)} photos")
    return tried


def _placed(photos: PhotoSet, database: Path, features: list[int], pairs: int, seek: SeekBoard, job: Job) -> _Tried:
    """Place photos by their features, or by the board if these place few and it places more."""
    folder, names = photos.paths[0].parent, tuple(path.name for path in photos.paths)
    tried = _Tried(map_photos(database, folder, len(names), job), features, pairs, by_board=False)
    if tried.placed >= FEW * len(names) or photos.board is None:
        return tried
    job.note(f"only {tried.placed} of {len(names)} photos could be placed by features: looking for the board")
    found = seek() or {}
    corners = [len(found[name][0]) for name in names]
    by_board = _Tried(map_from_board(database, folder, photos.board, found, job), features, pairs, True, corners)
    return by_board if by_board.placed > tried.placed else tried._replace(corners=corners)


def _check_enough(tried: _Tried, names: list[str], photos: PhotoSet, config: SfmConfig) -> None:
    """Refuse photos of which too few could be placed: what the others show would be missing from the surface.

    Raises:
        ScanError: fewer than `min_placed` of them could be.
    """
    if tried.placed >= config.min_placed * len(names):
        return
    placed = {image.name for image in tried.model.images.values() if image.has_pose} if tried.model else set()
    lost = _lost(tried, names, [name for name in names if name not in placed])
    problem = f"only {tried.placed} of {len(names)} photos could be placed; not {lost}"
    least = f"sfm.min_placed is {config.min_placed:g}; with a lower one, the surface ends where those photos looked."
    raise ScanError(problem, where=str(photos.paths[0].parent), hint=f"{_of_board(tried)} {ADVICE} {least}".strip())


def _lost(tried: _Tried, names: Sequence[str], unplaced: Sequence[str]) -> str:
    """Return the photos that could not be placed, and what each showed."""
    return ", ".join(f"{name} ({_shown(tried, names.index(name))})" for name in unplaced)


def _shown(tried: _Tried, index: int) -> str:
    """Return what a photo showed that could have placed it."""
    shown = f"{tried.features[index]} features"
    return f"{shown}, {tried.corners[index]} corners of the board" if tried.corners else shown


def _of_board(tried: _Tried) -> str:
    """Return how many photos show enough of the board, and what to do; nothing where all do or it was not sought."""
    enough = sum(corners >= LEAST_CORNERS for corners in tried.corners)
    if enough == len(tried.corners):
        return ""
    shown = f"{enough} of {len(tried.corners)} photos show {LEAST_CORNERS} or more corners of the board"
    return f" {shown}: look down on it from higher up, lay it where nothing hides it, or print it as board.yaml says."


def _beside_background(photos: PhotoSet, scratch: Path, seek: SeekBoard, config: SfmConfig, job: Job) -> _Tried | None:
    """Try again with the background painted over: its many features hide that the object has few, and faint ones.

    None where the background is not known.
    """
    masks = still_pixels(photos)
    if masks is None:
        return None
    job.progress(0.8, "features beside the background")
    share = float(np.mean([mask.mean() for mask in masks]))
    job.measure(background_share=round(share, 3))
    job.note(f"looking for fainter features beside the background, which is {100 * share:.0f} % of the photos")
    beside = scratch / "beside"
    (beside / "photos").mkdir(parents=True)
    painted = paint_over(photos, masks, grey_beside(photos, masks), beside / "photos")
    return _faint(painted, photos, beside, seek, config, job, camera_stays=True)


def _faint(
    shown: PhotoSet,
    photos: PhotoSet,
    folder: Path,
    seek: SeekBoard,
    config: SfmConfig,
    job: Job,
    *,
    camera_stays: bool = False,
) -> _Tried:
    """Place the photos by faint features of what is shown of them."""
    folder.mkdir(exist_ok=True)
    database = folder / "faint.db"
    counts = detect(shown, database, FAINT, config.features)
    pairs, _ = match(shown, database, config.features, Job(seed=job.seed), camera_stays=camera_stays)
    return _placed(photos, database, counts, pairs, seek, job)


def _is_better(again: _Tried, before: _Tried) -> bool:
    """Return whether to believe faint features: they place more than before, and by the board or most of the photos."""
    believed = again.by_board or again.placed >= MOST * len(again.features)
    return believed and again.placed > before.placed


def _check_certain(model: Any, photos: PhotoSet, config: SfmConfig, job: Job) -> None:
    """Refuse cameras that are too uncertain. Stereo compares windows of 13 pixels: two photos, each of which shows a
    place 4 pixels from where its camera says, show other cloth in the same window.

    Raises:
        ScanError: half of them or more are.
    """
    longer = max(max(camera.width, camera.height) for camera in model.cameras.values())
    off = float(np.median(uncertainty_px(model))) / max(1.0, longer / STEREO_SIDE)
    job.measure(camera_uncertainty_px=round(off, 3))
    if off > config.max_camera_px:
        placed = f"{model.num_reg_images()} of {len(photos.paths)} photos are placed by {model.num_points3D()} points"
        known = f"what they look at is known to {off:.1f} px only (one standard deviation)"
        problem = f"the cameras are uncertain: {placed}, and {known}; at most {config.max_camera_px:g} px is allowed"
        raise ScanError(problem, where=str(photos.paths[0].parent), hint=ADVICE)


def load_colmap(seed: int) -> None:
    """Load COLMAP, quiet and seeded. Its handler of crashes takes SIGTERM too: that stays with who had it."""
    before = signal.getsignal(signal.SIGTERM)
    import pycolmap

    if before is not None:
        with suppress(ValueError):  # not the main thread
            signal.signal(signal.SIGTERM, before)
    pycolmap.logging.minloglevel = pycolmap.logging.FATAL.value
    pycolmap.set_random_seed(seed)


def _values(model: Any, names: list[str], config: SfmConfig) -> tuple[CameraSet, PointCloud]:
    """Our cameras and points from a pycolmap Reconstruction, in the order of the names and of the points' ids."""
    placed = {image.name: image for image in model.images.values() if image.has_pose}
    registered = tuple(name for name in names if name in placed)
    poses = np.tile(np.eye(4), (len(registered), 1, 1))
    for pose, name in zip(poses, registered, strict=True):
        pose[:3] = placed[name].cam_from_world().inverse().matrix()
    intrinsics = tuple(lens_of(model.cameras[placed[name].camera_id]) for name in registered)
    unregistered = tuple(name for name in names if name not in placed)
    centers = {placed[name].image_id: pose[:3, 3] for name, pose in zip(registered, poses, strict=True)}
    points, normals, colors = [], [], []
    for index in sorted(model.points3D):
        point = model.points3D[index]
        viewers = sorted({element.image_id for element in point.track.elements})
        if point.error > config.max_error_px or len(viewers) < config.min_views:
            continue
        towards = np.array([centers[viewer] for viewer in viewers]) - point.xyz
        mean = (towards / np.linalg.norm(towards, axis=1, keepdims=True)).mean(0)
        points.append(point.xyz)
        normals.append(mean / np.linalg.norm(mean))
        colors.append(point.color)
    if not points:
        raise ScanError(f"no sparse point was seen by {config.min_views} photos", hint=ADVICE)
    cameras = CameraSet(registered, intrinsics, poses, metric=False, unregistered=unregistered)
    return cameras, PointCloud(np.array(points), np.array(normals), np.array(colors))


def _without_surroundings(cameras: CameraSet, cloud: PointCloud, job: Job) -> PointCloud:
    """The points that can be of the object: those of walls and furniture would choose the depths that are searched."""
    region = object_region(cameras)
    inside = np.ones(len(cloud.points), bool) if region is None else region.holds(cloud.points)
    if inside.all() or not inside.any():
        return cloud
    job.measure(surroundings_share=round(float(1 - inside.mean()), 3))
    job.note(f"left out {int((~inside).sum())} of {len(inside)} sparse points, which lie as far out as the cameras")
    normals = None if cloud.normals is None else cloud.normals[inside]
    return PointCloud(cloud.points[inside], normals, None if cloud.colors is None else cloud.colors[inside])


def _upright(cameras: CameraSet, cloud: PointCloud) -> tuple[CameraSet, PointCloud]:
    return transform_reconstruction(
        cameras, cloud, upright_from_scan(cameras.world_from_cam, cloud.points), metric=False
    )


def transform_reconstruction(
    cameras: CameraSet, cloud: PointCloud, transform: FloatArray, *, scale: float = 1.0, metric: bool
) -> tuple[CameraSet, PointCloud]:
    """Cameras and points after scaling about the origin and then a rigid transform, shape (4, 4)."""
    rotation, shift = transform[:3, :3], transform[:3, 3]
    poses = np.tile(np.eye(4), (len(cameras.names), 1, 1))
    poses[:, :3, :3] = rotation @ cameras.world_from_cam[:, :3, :3]
    poses[:, :3, 3] = scale * cameras.world_from_cam[:, :3, 3] @ rotation.T + shift
    normals = None if cloud.normals is None else cloud.normals @ rotation.T
    placed = replace(cameras, world_from_cam=poses, metric=metric)
    return placed, PointCloud(scale * cloud.points @ rotation.T + shift, normals, cloud.colors)
