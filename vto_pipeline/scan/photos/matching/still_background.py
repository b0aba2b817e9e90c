"""Which pixels show the background of a camera that does not move: they stay as they are, in from the picture's edge.

A background with a strong print has features enough for every photo, and hides that the object has few. Known by its
pixels, it can be painted over before features are looked for.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.io.captures.images import read_image
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.frames import PhotoSet
from vto_pipeline.scan.grey import USUAL, best_shares, in_grey

LONGER_SIDE = 1000
"""The photos are compared at this size or below [px]."""
BLUR_PX = 1.0
"""Sensor noise is averaged over this distance [px]."""
QUIET_PERCENT = 25.0
"""So much of the picture is background at least: how much its pixels change from photo to photo is noise [%]."""
NOISES, LEVELS = 4.0, 1.5
"""A pixel stays when it changes by no more than so many times the noise, and these grey levels."""
NEAR_PX = 3
"""So near to the object, a pixel counts as the object's [px]."""
FADE_PX = 15.0
"""The object's colours are carried on so far over the background: a sharp edge would be a feature that moves [px]."""
LOOKED_AT, EVERY = 12, 4
"""Photos, and pixels of their rows and columns, that tell in which grey the object shows best."""
BLANK = 128.0
"""Grey level of the background beyond."""
_FAINTEST = 0.01


def still_pixels(photos: PhotoSet) -> list[NDArray[np.bool_]] | None:
    """Return the pixels of each photo that show a background that stays, each of the photo's own shape (H, W).

    A pixel's usual grey level is its median over all photos, its change the median of the distances from that. What is
    quiet, and like its usual self in this photo, is background where it reaches the picture's edge: in the middle of
    plain cloth that turns nothing changes either. Exposure is levelled by the median ratio to the usual picture.

    Args:
        photos: Taken by a camera that did not move.

    Returns:
        None when they differ in size.
    """
    import cv2

    pictures = [read_image(path) for path in photos.paths]
    height, width = pictures[0].shape[:2]
    if any(picture.shape[:2] != (height, width) for picture in pictures):
        return None
    scale = min(1.0, LONGER_SIDE / max(width, height))
    size = (round(width * scale), round(height * scale))
    small = [cv2.resize(cv2.cvtColor(p, cv2.COLOR_RGB2GRAY), size, interpolation=cv2.INTER_AREA) for p in pictures]
    background = _quiet(np.stack([cv2.GaussianBlur(p, (0, 0), BLUR_PX) for p in small]).astype(np.float32))
    grown = np.ones((2 * NEAR_PX + 1,) * 2, np.uint8)
    masks = [cv2.erode(_from_the_edge(each).astype(np.uint8), grown, borderValue=1) for each in background]
    return [cv2.resize(mask, (width, height), interpolation=cv2.INTER_NEAREST) > 0 for mask in masks]


def grey_beside(photos: PhotoSet, masks: list[NDArray[np.bool_]]) -> FloatArray:
    """Return the shares of red, green and blue that show best what is beside the background, shape (3,).

    The usual ones have failed when this is asked: any gain will do.

    Args:
        photos: Some of which are looked at.
        masks: Of the background, each (H, W).
    """

    def shown(index: int) -> tuple[ByteArray, FloatArray]:
        row, column = np.nonzero(~masks[index][::EVERY, ::EVERY])
        return read_image(photos.paths[index]), EVERY * np.column_stack([column, row]).astype(float)

    some = np.unique(np.linspace(0, len(masks) - 1, min(len(masks), LOOKED_AT)).round().astype(int))
    return best_shares((shown(k) for k in some), least_gain=1.0)[0]


def paint_over(photos: PhotoSet, masks: list[NDArray[np.bool_]], shares: FloatArray, folder: Path) -> PhotoSet:
    """Write the photos with their background painted over, under their own names.

    Args:
        photos: To copy.
        masks: Of the background, each (H, W).
        shares: Of red, green and blue in the grey they are written in; in colour where it is the usual one.
        folder: Empty.
    """
    import cv2

    for path, mask in zip(photos.paths, masks, strict=True):
        colors = read_image(path)
        if tuple(shares) != USUAL:
            colors = np.repeat(in_grey(colors, shares)[..., None], 3, axis=2)
        picture, shown = colors.astype(np.float32), np.repeat(~mask[..., None], 3, axis=2).astype(np.float32)
        weight = cv2.GaussianBlur(shown, (0, 0), FADE_PX)
        carried_on = (cv2.GaussianBlur(picture * shown, (0, 0), FADE_PX) + _FAINTEST * BLANK) / (weight + _FAINTEST)
        painted = np.where(mask[..., None], carried_on, picture).round().astype(np.uint8)
        cv2.imwrite(str(folder / path.name), painted[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 98])
    return PhotoSet(tuple(folder / path.name for path in photos.paths), photos.intrinsics, photos.board)


def _quiet(gray: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return which pixels of grey photos (C, H, W) are what they are in the others, too."""
    usual = np.median(gray, axis=0)
    for _ in range(2):
        lit = usual > LEVELS
        gray = gray / np.array([np.median(one[lit] / usual[lit]) for one in gray], np.float32)[:, None, None]
        usual = np.median(gray, axis=0)
    away = np.abs(gray - usual)
    change = np.median(away, axis=0)
    most = NOISES * float(np.percentile(change, QUIET_PERCENT)) + LEVELS
    return np.asarray((away < most) & (change < most))


def _from_the_edge(still: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return what is connected to the picture's edge, specks of noise filled, shape (H, W)."""
    import cv2

    whole = cv2.medianBlur(still.astype(np.uint8), 5)
    _, labels = cv2.connectedComponents(whole, connectivity=4)
    edge = np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]])
    return np.asarray(np.isin(labels, np.unique(edge[edge > 0])))
