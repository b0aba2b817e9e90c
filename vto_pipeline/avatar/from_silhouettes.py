"""A body from a front and a side photo: breadths and depths give what ANSUR II can make of them, with its uncertainty.

Two outlines do not determine girths: even perfect ones leave 13 to 21 mm of mean error at chest, waist and hip. So an
interval is reported.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.ndimage import binary_fill_holes, label

from vto_pipeline.avatar.from_measurements import MeasurementsConfig, fit_measurements
from vto_pipeline.avatar.population import complete
from vto_pipeline.errors import AvatarError
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.body import Avatar, Measurements
from vto_pipeline.model.frames import Silhouettes
from vto_pipeline.model.job import Job
from vto_pipeline.model.settings import Config

_TOE_AHEAD, _FOOT_ASIDE = 0.105, 0.10
"""How far the lowest visible point is nearer to the camera than the body, as a share of stature: toes, outer foot."""
_BORDER = 0.03
_MIN_SHARE = 0.3
_LEVELS = {"waist_breadth": "navel_height", "hip_breadth": "hip_height"}
_DEPTHS = {"chest_depth": "chest_height", "waist_depth": "navel_height", "hip_depth": "hip_height"}


class SilhouettesConfig(Config):
    """Settings of the fit to two photos."""

    sex: Literal["female", "male", "neutral"] = Field(
        default="neutral", description="whose statistics complete the body"
    )
    distance_m: float = Field(default=2.5, gt=0.5, le=20, description="from the camera to the body's axis [m]")
    camera_height_m: float = Field(default=1.0, ge=0, le=3, description="of the lens above the floor [m]")
    width_sigma_mm: float = Field(
        default=8.0, gt=0, le=100, description="uncertainty of a breadth or depth read off the outline [mm]"
    )


@dataclass(frozen=True)
class Outline:
    """One view's silhouette, upright.

    Args:
        mask: Where the body is, shape (H, W).
        top: Row of the crown.
        metres: Size of a pixel at the body's axis [m].
    """

    mask: NDArray[np.bool_]
    top: int
    metres: float

    def width(self, height: float, stature: float) -> float:
        """Return the width [m] of the run through the body's middle at a height [m]; arms held off are other runs."""
        row = self.mask[int(np.clip(self.top + round((stature - height) / self.metres), 0, len(self.mask) - 1))]
        runs, count = label(row)
        if count == 0:
            raise AvatarError(f"the outline has no body at a height of {height:.2f} m")
        columns = np.arange(len(row))
        middle = float(np.median(np.nonzero(self.mask)[1]))
        nearest = runs[np.argmin(np.where(row, np.abs(columns - middle), np.inf))]
        return float((runs == nearest).sum()) * self.metres


def fit_silhouettes(
    silhouettes: Silhouettes,
    front_image: ByteArray,
    side_image: ByteArray,
    config: SilhouettesConfig | None = None,
    job: Job | None = None,
) -> Avatar:
    """Return the likeliest body behind two outlines.

    Args:
        silhouettes: Names of the photos, for messages, and the stature [m].
        front_image: sRGB, shape (H, W, 3): plain backdrop, the whole body, arms held off.
        side_image: The same from the side.
        config: Settings.
        job: Receives `<girth>_m` and `<girth>_interval_mm` (half the 95 % interval) for chest, waist and hip.

    Raises:
        AvatarError: no body stands out from the backdrop.
    """
    config, job = config or SilhouettesConfig(), job or Job()
    stature = silhouettes.stature
    front = _outline(front_image, stature, _TOE_AHEAD, str(silhouettes.front), config)
    side = _outline(side_image, stature, _FOOT_ASIDE, str(silhouettes.side), config)
    expected = complete(Measurements({"stature": stature}, sex=config.sex)).values
    seen = {name: front.width(expected[level], stature) for name, level in _LEVELS.items()}
    seen |= {name: side.width(expected[level], stature) for name, level in _DEPTHS.items()}
    sigmas = dict.fromkeys(seen, config.width_sigma_mm * 1e-3)
    tape = Measurements({"stature": stature, **seen}, sigmas, config.sex)
    likely = complete(tape)
    for name in ("chest_girth", "waist_girth", "hip_girth"):
        job.measure(
            **{
                f"{name}_m": round(likely.values[name], 4),
                f"{name}_interval_mm": round(1.96 * likely.sigmas[name] * 1e3, 1),
            }
        )
    job.note("girths behind two outlines are intervals, not points; measure by tape where it matters")
    return fit_measurements(tape, MeasurementsConfig(), job)


def _outline(image: ByteArray, stature: float, nearer: float, where: str, config: SilhouettesConfig) -> Outline:
    mask = _foreground(image, where)
    rows = np.nonzero(mask.any(axis=1))[0]
    # what stands nearer than the axis appears lower than the floor there
    ahead = nearer * stature
    below = config.camera_height_m * ahead / (config.distance_m - ahead)
    return Outline(mask, int(rows[0]), (stature + below) / (rows[-1] + 1 - rows[0]))


def _foreground(image: ByteArray, where: str) -> NDArray[np.bool_]:
    """Separate body and backdrop: colour distance from the border, cut where both classes are tightest (Otsu 1979)."""
    picture = image.astype(np.float64)
    rim = max(2, int(_BORDER * min(image.shape[:2])))
    border = np.concatenate(
        [picture[:rim].reshape(-1, 3), picture[:, :rim].reshape(-1, 3), picture[:, -rim:].reshape(-1, 3)]
    )
    away = np.linalg.norm(picture - np.median(border, axis=0), axis=2)
    parts, count = label(away > _otsu(away.ravel()))
    if count == 0:
        raise AvatarError("nothing stands out from the backdrop", where=where)
    sizes = np.bincount(parts.ravel())[1:]
    mask: NDArray[np.bool_] = binary_fill_holes(parts == 1 + int(np.argmax(sizes)))
    tall = np.nonzero(mask.any(axis=1))[0]
    if len(tall) < _MIN_SHARE * len(mask):
        raise AvatarError(
            f"the largest thing before the backdrop is {len(tall)} of {len(mask)} pixels tall",
            where=where,
            hint="the whole body should fill the picture's height, before a plain backdrop",
        )
    return mask


def _otsu(values: FloatArray) -> float:
    counts, edges = np.histogram(values, bins=256)
    centers = (edges[1:] + edges[:-1]) / 2
    low = np.cumsum(counts)
    high = low[-1] - low
    sums = np.cumsum(counts * centers)
    with np.errstate(divide="ignore", invalid="ignore"):
        between = low * high * (sums / low - (sums[-1] - sums) / high) ** 2
    return float(centers[int(np.nanargmax(between))])
