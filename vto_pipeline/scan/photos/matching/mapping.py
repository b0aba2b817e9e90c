"""From matched features to cameras and sparse points: COLMAP's global mapper, with the incremental one as fallback."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

from vto_pipeline.model.job import Job
from vto_pipeline.scan.library_message import COLMAP_ERRORS, library_message

MIN_PHOTOS = 3
"""Smaller models are chance."""


def map_photos(database: Path, folder: Path, count: int, job: Job) -> Any | None:
    """Reconstruct with the global mapper; if it leaves photos out, try the incremental one and keep the better model.

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
    models: list[Any] = []
    for name, mapper in (("global", _global), ("incremental", _incremental)):
        if max((model.num_reg_images() for model in models), default=0) < count:
            try:
                models += mapper(_copy(database, name), folder, job.seed)
            except COLMAP_ERRORS as error:
                job.note(f"the {name} mapper failed: {library_message(error)}")
    return max(models, key=_merit, default=None)


def _merit(model: Any) -> tuple[int, float]:
    return model.num_reg_images(), -model.compute_mean_reprojection_error()


def _copy(database: Path, name: str) -> Path:
    """Each mapper writes to its own database: calibration changes the cameras in it.

    Copied by SQLite: what was committed may still lie in the write-ahead log, which a copy of the file would miss.
    """
    (database.parent / name).mkdir()
    copied = database.parent / name / database.name
    with closing(sqlite3.connect(database)) as source, closing(sqlite3.connect(copied)) as target:
        source.backup(target)
    return copied


def _global(database: Path, folder: Path, seed: int) -> list[Any]:
    import pycolmap

    if not pycolmap.calibrate_view_graph(database, pycolmap.ViewGraphCalibrationOptions(random_seed=seed)):
        return []
    options = pycolmap.GlobalPipelineOptions(num_threads=1, random_seed=seed, min_model_size=MIN_PHOTOS)
    options.mapper.num_threads = 1
    options.mapper.random_seed = seed
    for part in (options.mapper.rotation_averaging, options.mapper.global_positioning, options.mapper.retriangulation):
        part.random_seed = seed
    options.mapper.bundle_adjustment.ceres.solver_options.num_threads = 1
    models = pycolmap.global_mapping(database, folder, database.parent, options)
    return [models[key] for key in sorted(models)]


def _incremental(database: Path, folder: Path, seed: int) -> list[Any]:
    import pycolmap

    options = pycolmap.IncrementalPipelineOptions(num_threads=1, random_seed=seed, min_model_size=MIN_PHOTOS)
    options.mapper.num_threads = 1
    options.mapper.random_seed = options.triangulation.random_seed = seed
    models = pycolmap.incremental_mapping(database, folder, database.parent, options)
    return [models[key] for key in sorted(models)]
