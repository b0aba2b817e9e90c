"""From matched features to cameras and sparse points: COLMAP's global mapper, with the incremental one as fallback."""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.job import Job
from vto_pipeline.scan.library_message import COLMAP_ERRORS, library_message
from vto_pipeline.scan.photos.matching.ties import untie

MIN_PHOTOS = 3
"""Smaller models are chance."""
STRAIGHT = 0.04
"""A lens that moves what the picture's corner shows by no more than this share is taken as it was found."""
CLEARLY, FEWER = 1.05, 0.98
"""One that bends more must be needed: without it the error is so many times as large, or so much of the sightings is
left. Where points are few, a bent lens and a wrong focal length explain them as well as the true ones."""


def map_photos(database: Path, folder: Path, count: int, job: Job) -> Any | None:
    """Reconstruct with the global mapper; if it leaves photos out, try the incremental one and keep the better model.

    Photos that too few points tie to the others count as not placed.

    A lens that bends much is refined only where photos need it; else it keeps what is known of it, or is straight.

    Pan et al. 2024 (GLOMAP); Schönberger and Frahm 2016 (COLMAP). Solved by one thread: with more, the sums of the
    bundle adjustment, and so the last bits of every camera, change from run to run.

    Args:
        database: Features and verified matches.
        folder: Of the photos, for the points' colours.
        count: Number of photos.
        job: Seeds the mappers; notified when one of them fails.

    Returns:
        The pycolmap Reconstruction with the most photos, the least error among equals; None when there is none.
    """
    found = _best(database, folder, count, job, bent=True)
    if found is None or bend(found) <= STRAIGHT:
        return found
    straight = _best(database, folder, count, job, bent=False)
    if straight is None or not _explains_as_much(straight, found):
        return found
    job.note(f"took the lens as straight: one that moves the corners by {100 * bend(found):.0f} % explains no more")
    return straight


def lens_of(camera: Any) -> Intrinsics:
    """Return a pycolmap Camera as ours: COLMAP counts pixels from the corner of the first one, we from its centre."""
    focal, cx, cy, k1 = camera.params
    return Intrinsics(camera.width, camera.height, focal, focal, cx - 0.5, cy - 0.5, k1)


def bend(model: Any) -> float:
    """Return by what share of its distance from the middle the lens moves what a corner of the picture shows."""
    found = 0.0
    for camera in model.cameras.values():
        focal, cx, cy, k1 = camera.params
        reach_sq = max(cx, camera.width - cx) ** 2 + max(cy, camera.height - cy) ** 2
        found = max(found, abs(k1) * reach_sq / focal**2)
    return found


def _explains_as_much(model: Any, other: Any) -> bool:
    """Return whether a model places more photos than another, or as many with about as many sightings and no larger
    error."""
    if model.num_reg_images() != other.num_reg_images():
        return bool(model.num_reg_images() > other.num_reg_images())
    if model.compute_num_observations() < FEWER * other.compute_num_observations():
        return False
    return bool(model.compute_mean_reprojection_error() <= CLEARLY * other.compute_mean_reprojection_error())


def _best(database: Path, folder: Path, count: int, job: Job, bent: bool) -> Any | None:
    """Return the model with the most photos, the least error among equals."""
    models: list[Any] = []
    for name, mapper in (("global", _global), ("incremental", incremental)):
        if max((model.num_reg_images() for model in models), default=0) < count:
            try:
                found = mapper(copy_database(database, name if bent else f"{name}_straight"), folder, job.seed, bent)
                models += [untie(model) for model in found]
            except COLMAP_ERRORS as error:
                job.note(f"the {name} mapper failed: {library_message(error)}")
    return max(models, key=_merit, default=None)


def _merit(model: Any) -> tuple[int, float]:
    return model.num_reg_images(), -model.compute_mean_reprojection_error()


def copy_database(database: Path, name: str) -> Path:
    """Return a copy in a folder of that name: each mapper writes to its own, for calibration changes the cameras in it.

    An earlier one is replaced. Copied by SQLite: what was committed may still lie in the write-ahead log, which a copy
    of the file would miss.
    """
    shutil.rmtree(database.parent / name, ignore_errors=True)
    (database.parent / name).mkdir()
    copied = database.parent / name / database.name
    with closing(sqlite3.connect(database)) as source, closing(sqlite3.connect(copied)) as target:
        source.backup(target)
    return copied


def _global(database: Path, folder: Path, seed: int, bent: bool) -> list[Any]:
    import pycolmap

    if not pycolmap.calibrate_view_graph(database, pycolmap.ViewGraphCalibrationOptions(random_seed=seed)):
        return []
    options = pycolmap.GlobalPipelineOptions(num_threads=1, random_seed=seed, min_model_size=MIN_PHOTOS)
    options.mapper.num_threads = 1
    options.mapper.random_seed = seed
    for part in (options.mapper.rotation_averaging, options.mapper.global_positioning, options.mapper.retriangulation):
        part.random_seed = seed
    options.mapper.bundle_adjustment.ceres.solver_options.num_threads = 1
    options.mapper.bundle_adjustment.refine_extra_params = bent
    models = pycolmap.global_mapping(database, folder, database.parent, options)
    return [models[key] for key in sorted(models)]


def incremental(database: Path, folder: Path, seed: int, bent: bool, start: Path | None = None) -> list[Any]:
    """Return the models of COLMAP's incremental mapper.

    Args:
        database: Features and verified matches.
        folder: Of the photos.
        seed: Of the mapper.
        bent: Whether the lens is refined.
        start: Folder of a model to go on from.
    """
    import pycolmap

    options = pycolmap.IncrementalPipelineOptions(num_threads=1, random_seed=seed, min_model_size=MIN_PHOTOS)
    options.mapper.num_threads = 1
    options.mapper.random_seed = options.triangulation.random_seed = seed
    options.ba_refine_extra_params = bent
    if start is not None:
        options.multiple_models, options.min_num_matches = False, 1  # its pairs are known to be good
    models = pycolmap.incremental_mapping(database, folder, database.parent, options, str(start or ""))
    return [models[key] for key in sorted(models)]
