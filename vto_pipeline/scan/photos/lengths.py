"""Metric scale from lengths that the user states, between points that are marked in photos."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from vto_pipeline.errors import ScanError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.camera import CameraSet
from vto_pipeline.model.job import Job
from vto_pipeline.model.settings import Config
from vto_pipeline.scan.photos.triangulation import triangulate_points

Sightings = dict[str, tuple[float, float]]
"""Photo's name -> pixel (x, y) at which a point is seen in it."""


CONTRADICTION = 0.02
"""Lengths that differ by more than this share from their common scale are a mistake."""


class StatedLength(Config):
    """A known distance between two points, each marked in two photos or more."""

    metres: float = Field(gt=0, le=100, description="Straight distance between the points [m]")
    one: Sightings = Field(min_length=2, description="Photo: [x, y] of the first point, in two photos or more [px]")
    other: Sightings = Field(min_length=2, description="The same of the second point")


def scale_from_lengths(
    cameras: CameraSet, lengths: tuple[StatedLength, ...], max_error_px: float, job: Job
) -> tuple[float, float]:
    """Return metres per unit, and its standard error as a share.

    Args:
        cameras: Up to scale.
        lengths: At least one.
        max_error_px: A point whose marks miss each other by more is refused [px].
        job: Receives the residuals of the marks.

    Raises:
        ScanError: a photo that is named has no pose, the marks of a point do not meet, or the lengths contradict.
    """
    ratios, errors = [], []
    for length in lengths:
        places, spreads = zip(
            *(_place(cameras, marks, max_error_px) for marks in (length.one, length.other)), strict=True
        )
        apart = float(np.linalg.norm(places[0] - places[1]))
        ratios.append(length.metres / apart)
        errors.append(float(np.hypot(*spreads)) / apart)
    weights = 1.0 / np.square(errors)
    scale = float(np.average(ratios, weights=weights))
    error = float(1.0 / np.sqrt(weights.sum()))
    off = np.abs(np.array(ratios) / scale - 1.0)
    if len(ratios) > 1 and off.max() > CONTRADICTION:
        listed = ", ".join(
            f"{length.metres:g} m gives {ratio:.4g}" for length, ratio in zip(lengths, ratios, strict=True)
        )
        raise ScanError(
            f"the stated lengths contradict each other by {100 * off.max():.1f} % (metres per unit: {listed})",
            hint="are they all straight distances in metres, between the points that are marked?",
        )
    job.measure(stated_lengths=len(lengths))
    return scale, max(error, float(off.std()))


def _place(cameras: CameraSet, marks: Sightings, max_error_px: float) -> tuple[FloatArray, float]:
    """Return where a marked point is, shape (3,), and how uncertain that is: a pixel, seen from its distance."""
    index = {name: number for number, name in enumerate(cameras.names)}
    unknown = [name for name in marks if name not in index]
    if unknown:
        placed = "could not be placed" if set(unknown) <= set(cameras.unregistered) else "is not among the photos"
        raise ScanError(f"a length is marked in {unknown[0]}, which {placed}", hint="mark it in other photos")
    found: list[tuple[np.ndarray, FloatArray]] = [(np.empty(0, np.int32), np.empty((0, 2)))] * len(cameras.names)
    for name, pixel in marks.items():
        found[index[name]] = (np.zeros(1, np.int32), np.array([pixel], dtype=float))
    _, points = triangulate_points(found, cameras, max_error_px)
    if len(points) == 0:
        raise ScanError(
            f"the marks in {', '.join(marks)} are not of one point: their rays pass each other by more than "
            f"{max_error_px:g} px, or are parallel",
            hint="mark the same spot in photos from different sides; pixel (0, 0) is the upper left one",
        )
    seen = [index[name] for name in marks]
    away = np.linalg.norm(points[0] - cameras.world_from_cam[seen, :3, 3], axis=1)
    one_pixel = float(np.median(away / [cameras.intrinsics[number].fx for number in seen]))
    return points[0], one_pixel / float(np.sqrt(len(seen)))
