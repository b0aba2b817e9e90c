"""Photos placed by the board that they show, where too few of their features match.

The board's corners cannot be mistaken for one another. A photo that shows a few is placed by them alone. Where photos
were then tells where to look for a feature's match: along a line. On stripes and plain cloth, that finds several times
as many as looking everywhere. From there COLMAP goes on as ever, with the corners as features like any other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.frames import CharucoBoard
from vto_pipeline.model.job import Job
from vto_pipeline.scan.library_message import COLMAP_ERRORS, library_message
from vto_pipeline.scan.photos.board import board_corners
from vto_pipeline.scan.photos.matching.adjust import solve
from vto_pipeline.scan.photos.matching.board_poses import (
    LEAST_CORNERS,
    Placed,
    Sightings,
    beside_corners,
    place_photos,
)
from vto_pipeline.scan.photos.matching.features import descriptors
from vto_pipeline.scan.photos.matching.guided import match_placed
from vto_pipeline.scan.photos.matching.mapping import MIN_PHOTOS, copy_database, incremental
from vto_pipeline.scan.photos.matching.ties import untie

AGREES_PX = 6.0
"""Two photos placed by the board alone see what matches within this of each other's lines [px]."""
MOST = 0.5
"""Share of the matches that one geometry must explain, or it is not searched for long."""
SOFT_PX = 1.0
"""Errors beyond this lose their weight [px]."""


@dataclass(frozen=True)
class _Entered:
    """The board's corners as features of a database.

    Args:
        number: Photo -> COLMAP's number of it.
        places: Photo -> pixels of its features, corners last, COLMAP's way, shape (K, 2).
        rows: Photo -> corner -> its row there.
    """

    number: Mapping[str, int]
    places: Mapping[str, FloatArray]
    rows: Mapping[str, Mapping[int, int]]

    def shared(self, one: str, other: str) -> NDArray[np.uint32]:
        """Return the rows of the corners that two photos show, shape (M, 2)."""
        both = sorted(self.rows[one].keys() & self.rows[other].keys())
        pairs = [(self.rows[one][corner], self.rows[other][corner]) for corner in both]
        return np.array(pairs, dtype=np.uint32).reshape(-1, 2)


def map_from_board(database: Path, folder: Path, board: CharucoBoard, found: Sightings, job: Job) -> Any | None:
    """Reconstruct from the photos that show the board, and those that features then tie to them.

    Args:
        database: Features and matches; not changed.
        folder: Of the photos.
        board: As it was printed.
        found: What each photo shows of it.
        job: Seeds the mapper; notified of how many photos the board places, or why it cannot.

    Returns:
        The pycolmap Reconstruction, of arbitrary scale as any other; None where fewer than 3 photos show the board.
    """
    import pycolmap

    copied = copy_database(database, "board")
    try:
        with pycolmap.Database.open(str(copied)) as opened:
            images = {image.name: image for image in opened.read_all_images()}
            groups: dict[int, list[str]] = {}
            for name in sorted(images.keys() & found.keys()):
                groups.setdefault(images[name].camera_id, []).append(name)
            placed: dict[str, Placed] = {}
            for number, names in groups.items():
                camera = opened.read_camera(number)
                placed |= place_photos(camera, board, {name: found[name] for name in names})
                opened.update_camera(camera)
            if len(placed) < MIN_PHOTOS:
                shown = sum(len(ids) > 0 for ids, _ in found.values())
                job.note(f"the board places {len(placed)} photos: {shown} show any of it. Is it as board.yaml says?")
                return None
            described = descriptors(opened)
            entered = _enter(opened, images, found, placed)
            _match_again(opened, described, board, found, entered, placed, job.seed)
            cache = pycolmap.DatabaseCache.create(opened, pycolmap.DatabaseCacheOptions())
        return _mapped(copied, folder, cache, entered, placed, job)
    except COLMAP_ERRORS as error:
        job.note(f"the photos could not be placed by the board: {library_message(error)}")
        return None


def _enter(opened: Any, images: Mapping[str, Any], found: Sightings, placed: Mapping[str, Placed]) -> _Entered:
    """Add the corners that agree with the board to the features of a database."""
    places: dict[str, FloatArray] = {}
    rows: dict[str, dict[int, int]] = {}
    for name, image in images.items():
        features = np.array(opened.read_keypoints(image.image_id))
        places[name], rows[name] = features[:, :2].astype(np.float64), {}
        if name in placed:
            ids, pixels = (part[placed[name].corners] for part in found[name])
            corners = np.zeros((len(ids), features.shape[1]), np.float32)
            corners[:, :2] = pixels + 0.5
            if features.shape[1] >= 6:
                corners[:, [2, 5]] = 1.0  # of unit size
            opened.update_keypoints(image.image_id, np.vstack([features, corners]))
            rows[name] = {int(corner): len(features) + row for row, corner in enumerate(ids)}
            places[name] = np.vstack([places[name], pixels + 0.5])
    return _Entered({name: image.image_id for name, image in images.items()}, places, rows)


def _match_again(
    opened: Any,
    described: Mapping[str, NDArray[np.uint8]],
    board: CharucoBoard,
    found: Sightings,
    entered: _Entered,
    placed: Mapping[str, Placed],
    seed: int,
) -> None:
    """Match by what is known of two photos: where both were, or else one geometry for most of their matches so far."""
    import pycolmap

    options = pycolmap.TwoViewGeometryOptions()
    options.ransac.random_seed, options.ransac.min_inlier_ratio = seed, MOST
    cameras = {image.name: opened.read_camera(image.camera_id) for image in opened.read_all_images()}
    pairs = list(combinations(sorted(entered.number, key=lambda name: entered.number[name]), 2))
    own = {name: entered.places[name][: len(described[name])] for name in placed}
    world, margin = board_corners(board), 1.5 * board.square_m  # past the edge of the board, which is one square on
    chosen = {
        name: beside_corners(cameras[name], pose, world[found[name][0][pose.corners]], margin, own[name])
        for name, pose in placed.items()
    }
    guided = match_placed(pairs, cameras, described, own, chosen, placed, AGREES_PX)
    opened.clear_two_view_geometries()
    for one, other in pairs:
        first, second = entered.number[one], entered.number[other]
        if one in placed and other in placed:
            geometry = pycolmap.TwoViewGeometry()
            geometry.config = pycolmap.TwoViewGeometryConfiguration.CALIBRATED
            rows = guided.get((one, other), np.empty((0, 2), np.uint32))
            kept, enough = np.vstack([rows, entered.shared(one, other)]), LEAST_CORNERS
        else:
            rows = np.array(opened.read_matches(first, second), dtype=np.uint32).reshape(-1, 2)
            geometry = pycolmap.estimate_calibrated_two_view_geometry(
                cameras[one], entered.places[one], cameras[other], entered.places[other], rows, options
            )
            kept, enough = np.array(geometry.inlier_matches, dtype=np.uint32).reshape(-1, 2), options.min_num_inliers
        if len(kept) >= enough:
            geometry.inlier_matches = kept
            opened.write_two_view_geometry(first, second, geometry)


def _mapped(
    database: Path, folder: Path, cache: Any, entered: _Entered, placed: Mapping[str, Placed], job: Job
) -> Any | None:
    """Start a model with the photos that the board places, and go on from it."""
    import pycolmap

    start = database.parent / "start"
    start.mkdir()
    model = pycolmap.Reconstruction()
    model.load(cache)
    for name, pose in placed.items():
        image = model.images[entered.number[name]]
        world = pycolmap.Rigid3d(pycolmap.Rotation3d(pose.rotation), pose.shift)
        assert image.frame is not None
        image.frame.set_cam_from_world(image.camera_id, world)
        model.register_frame(image.frame_id)
    options = pycolmap.IncrementalPipelineOptions(num_threads=1, random_seed=job.seed)
    options.triangulation.random_seed, options.min_num_matches = job.seed, LEAST_CORNERS
    model = pycolmap.triangulate_points(model, database, folder, start, options=options)
    solve(model, SOFT_PX, bent=False)
    model.write(start)
    models = incremental(database, folder, job.seed, bent=False, start=start)
    model = max([*models, model], key=lambda one: one.num_reg_images())
    sure = [entered.number[name] for name in placed if _corners_left(model, entered, name) >= LEAST_CORNERS]
    model = untie(model, sure)
    job.measure(board_placed=len(sure))
    job.note(f"the board places {len(sure)} photos, and features tie {model.num_reg_images() - len(sure)} to them")
    return model if model.num_reg_images() >= MIN_PHOTOS else None


def _corners_left(model: Any, entered: _Entered, name: str) -> int:
    """Return how many of the board's corners a photo still shows as points of a model."""
    image = model.images[entered.number[name]]
    if not image.has_pose:
        return 0
    return sum(image.point2D(row).has_point3D() for row in entered.rows[name].values())
