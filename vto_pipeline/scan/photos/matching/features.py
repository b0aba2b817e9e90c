"""SIFT features of photos and their verified matches, in a COLMAP database."""

from __future__ import annotations

from collections import defaultdict
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from vto_pipeline.errors import ScanError
from vto_pipeline.io.captures.images import read_image_size
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.frames import PhotoSet
from vto_pipeline.model.job import Job
from vto_pipeline.model.settings import Config
from vto_pipeline.scan.library_message import COLMAP_ERRORS, library_message
from vto_pipeline.scan.photos.matching.fixed_camera import Pair, moving_matches, still_features

GUESSED_FOCAL = 1.2
"""COLMAP's guess where EXIF says nothing, in longer sides of the picture."""

SURE, FAINT = 0.0067, 0.0015
"""Contrast a SIFT feature must have: the usual, and for plain fabric."""


MIN_AGREEMENT = 0.7
"""Share of two photos' matches that one geometry must explain. A match has passed the test of ratios and of both
directions: where a third of them contradict, a print repeats, or the background did not turn with the object."""

SEARCHED = 0.6
"""A geometry that fewer of the matches agree with is not searched for long: it would be dropped, with some to spare."""


class Matched(NamedTuple):
    """What matching found.

    Args:
        pairs: Number of pairs of photos that one two-view geometry explains.
        fixed_camera: Whether the camera did not move, so that the background was left out.
    """

    pairs: int
    fixed_camera: bool


class FeatureConfig(Config):
    """Settings of features and matching."""

    max_side_px: int = Field(default=2400, ge=200, le=10_000, description="Larger photos are scaled down to this [px]")
    max_features: int = Field(default=8192, ge=100, le=50_000, description="Features kept per photo")
    all_pairs_up_to: int = Field(default=60, ge=2, le=1000, description="Photos up to which all pairs are matched")
    window: int = Field(
        default=8, ge=1, le=100, description="Above that, photos are matched up to this far in order, and at doublings"
    )


def detect(photos: PhotoSet, database: Path, contrast: float, config: FeatureConfig) -> list[int]:
    """Find SIFT features (Lowe 2004) in every photo.

    The photos are entered in the database before the features: entered by the extractor's threads, they would be
    numbered in the order these happen to end, and nothing after would be reproducible.

    Args:
        photos: Photos; those with the same starting intrinsics share one camera.
        database: New file.
        contrast: SIFT's peak threshold.
        config: Settings.

    Returns:
        Features per photo.

    Raises:
        ScanError: COLMAP cannot read the photos.
    """
    import pycolmap

    folder = photos.paths[0].parent
    names = [path.name for path in photos.paths]
    pycolmap.Database.open(str(database)).close()
    for (width, height, known), group in _groups(photos).items():
        reader = pycolmap.ImageReaderOptions(camera_model="SIMPLE_RADIAL")
        if known is not None:
            reader.camera_params = f"{known.fx},{known.cx + 0.5},{known.cy + 0.5},{known.k1}"
        else:
            reader.camera_params = f"{GUESSED_FOCAL * max(width, height)},{width / 2},{height / 2},0"
        try:
            pycolmap.import_images(database, folder, pycolmap.CameraMode.SINGLE, group, reader)
        except COLMAP_ERRORS as error:
            problem = f"COLMAP cannot take {', '.join(group)}: {library_message(error)}"
            raise ScanError(problem, where=str(folder), hint="save them again as plain JPEG or PNG") from error
    options = pycolmap.FeatureExtractionOptions(max_image_size=config.max_side_px, use_gpu=False)
    options.sift.max_num_features = config.max_features
    options.sift.peak_threshold = contrast
    try:
        pycolmap.extract_features(database, folder, names, extraction_options=options, device=pycolmap.Device.cpu)
    except COLMAP_ERRORS as error:
        problem = f"no features could be extracted from {len(names)} photos: {library_message(error)}"
        raise ScanError(problem, where=str(folder)) from error
    with pycolmap.Database.open(str(database)) as opened:
        counts = {image.name: opened.num_keypoints_for_image(image.image_id) for image in opened.read_all_images()}
    return [counts.get(name, 0) for name in names]


def match(photos: PhotoSet, database: Path, config: FeatureConfig, job: Job, *, camera_stays: bool = False) -> Matched:
    """Match features between photos, and keep the pairs that one two-view geometry explains.

    Where the camera did not move, the background is left out first.

    Matched by one thread: with two, the library now and then loses all matches of a pair, also where each thread has a
    database of its own, and every camera changes. Verified by all threads.

    Args:
        photos: Photos.
        database: Holds their features.
        config: Settings.
        job: Seeds the RANSAC; notified when the camera did not move.
        camera_stays: Whether that is known, few as the features of its background may be.

    Raises:
        ScanError: COLMAP cannot match them.
    """
    import pycolmap

    pairs = database.with_name("pairs.txt")
    pairs.write_text("".join(f"{a} {b}\n" for a, b in _pairs([path.name for path in photos.paths], config)))
    verification = pycolmap.TwoViewGeometryOptions()
    verification.ransac.random_seed = job.seed
    verification.ransac.min_inlier_ratio = SEARCHED
    matching = pycolmap.FeatureMatchingOptions(use_gpu=False, num_threads=1, skip_geometric_verification=True)
    listed = pycolmap.ImportedPairingOptions(match_list_path=pairs)
    try:
        pycolmap.match_image_pairs(database, matching, listed, device=pycolmap.Device.cpu)
        moving = _drop_background(database, photos, job, camera_stays)
        if moving is not None:
            pairs.write_text("".join(f"{one} {other}\n" for one, other in moving))
        pycolmap.verify_matches(database, pairs, verification)
    except COLMAP_ERRORS as error:
        problem = f"the features of {len(photos.paths)} photos could not be matched: {library_message(error)}"
        raise ScanError(problem, where=str(photos.paths[0].parent)) from error
    kept = 0
    with pycolmap.Database.open(str(database)) as opened:
        for pair, inliers in zip(*opened.read_two_view_geometry_num_inliers(), strict=True):
            first, second = pycolmap.pair_id_to_image_pair(pair)
            if inliers >= MIN_AGREEMENT * len(opened.read_matches(first, second)):
                kept += inliers > 0
            else:
                opened.delete_two_view_geometry(first, second)
    return Matched(kept, moving is not None)


def descriptors(opened: Any) -> dict[str, NDArray[np.uint8]]:
    """Return the descriptors of each photo of an open database, shape (K, 128)."""
    return {image.name: opened.read_descriptors(image.image_id).data for image in opened.read_all_images()}


def _drop_background(database: Path, photos: PhotoSet, job: Job, camera_stays: bool) -> list[Pair] | None:
    """Take the matches of a background that stays out of the database.

    Returns:
        The pairs of photos that still match; None where the camera moved, and nothing was changed.
    """
    import pycolmap

    with pycolmap.Database.open(str(database)) as opened:
        numbers = {image.name: image.image_id for image in opened.read_all_images()}
        names = {number: name for name, number in numbers.items()}
        places = {name: opened.read_keypoints(number)[:, :2].astype(np.float64) for name, number in numbers.items()}
        matches: dict[Pair, NDArray[Any]] = {}
        for pair, rows in zip(*opened.read_all_matches(), strict=True):
            one, other = pycolmap.pair_id_to_image_pair(pair)
            matches[names[one], names[other]] = rows
        longer_side = float(max(max(read_image_size(path)) for path in photos.paths))
        found = still_features(places, matches, longer_side)
        job.measure(still_share=round(found.share, 3))
        if not (found.fixed_camera or camera_stays):
            return None
        job.note(f"the camera did not move: {100 * found.share:.0f} % of the features are background, and left out")
        opened.clear_two_view_geometries()
        opened.clear_matches()
        left = moving_matches(places, matches, found.still, longer_side)
        for (first, second), moving in left.items():
            if len(moving):
                opened.write_matches(numbers[first], numbers[second], moving)
    return [pair for pair, moving in left.items() if len(moving)]


def _groups(photos: PhotoSet) -> dict[tuple[int, int, Intrinsics | None], list[str]]:
    """Names of photos that were taken by the same camera, as far as EXIF and size tell."""
    groups = defaultdict(list)
    for path, known in zip(photos.paths, photos.intrinsics, strict=True):
        groups[(*read_image_size(path), known)].append(path.name)
    return dict(groups)


def _pairs(names: list[str], config: FeatureConfig) -> list[tuple[str, str]]:
    """Every pair of a small set; of a large one, near ones in the order round the circle, and those 2^k apart."""
    count = len(names)
    if count <= config.all_pairs_up_to:
        return list(combinations(names, 2))
    steps = {*range(1, config.window + 1), *(2**k for k in range(count.bit_length() - 1))}
    chosen = {tuple(sorted((i, (i + step) % count))) for i in range(count) for step in steps}
    return [(names[i], names[j]) for i, j in sorted(chosen)]
