"""Where photos show the background: beside the garment, and through what was filled."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, label, map_coordinates, uniform_filter

from vto_pipeline.garment.align import PosedPhotos
from vto_pipeline.garment.photographed.sightings import BORDER_PX, of_small_photos
from vto_pipeline.garment.subtraction.color_model import usual_colors
from vto_pipeline.geometry.seen.depth_picture import depth_picture
from vto_pipeline.geometry.topology import submesh
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.mesh import TriangleMesh

NEAR_PX = 30
"""Colours are learnt so near to what is asked: light and wall change farther off."""
LEAST_PIXELS = 300
"""Of background and of cloth whose colours are learnt."""
BINS, LIGHT = 40, 5.0
"""Of the histogram, and its smoothing of cloth along lightness: under an arm it is darker than where it was seen."""
SURE = 1.0
"""Log-likelihood ratio of a colour that tells background from cloth."""
TOLD = 0.7
"""So much of the background, and of the cloth, its colour must tell in a photo."""
ALONE = 0.002
"""What one photo alone says may be off by this: a shadow that looks like the wall [m]."""


class Backdrop(NamedTuple):
    """The background in one photo.

    Args:
        beyond: How far each pixel's middle is from the background's border, positive in the background [px], (H, W).
        camera: Its lens.
        cam_from_world: Its pose [m], shape (4, 4).
    """

    beyond: NDArray[np.float32]
    camera: Intrinsics
    cam_from_world: FloatArray


def find_backdrops(
    garment: TriangleMesh, observed: NDArray[np.bool_], mannequin: TriangleMesh, photos: PosedPhotos
) -> list[Backdrop]:
    """Find the background in those photos whose colours tell it from cloth beside what was filled.

    What was seen of the garment, and the mannequin, hide it for certain; what lies beside everything is it for
    certain. Where only a filling hides it, colour decides, and it must be connected with what is certain.

    Args:
        garment: Its holes filled.
        observed: Which of its vertices a sensor saw, shape (V,).
        mannequin: In the same frame.
        photos: With their cameras in that frame.
    """
    seen, _ = submesh(garment, np.all(observed[garment.faces], axis=1))

    def find(picture: ByteArray, camera: Intrinsics, pose: FloatArray) -> Backdrop | None:
        cam_from_world: FloatArray = np.asarray(np.linalg.inv(pose), dtype=np.float64)
        cloth, form, whole = (
            np.isfinite(depth_picture(thing, camera, cam_from_world)) for thing in (seen, mannequin, garment)
        )
        background = background_of(picture, cloth, form, whole)
        if background is None:
            return None
        inwards, outwards = distance_transform_edt(background), distance_transform_edt(~background)
        beyond = np.where(background, inwards - 0.5, 0.5 - outwards).astype(np.float32)
        return Backdrop(beyond, camera, cam_from_world)

    return [backdrop for backdrop in of_small_photos(photos, (garment, mannequin), find) if backdrop is not None]


def background_of(
    picture: ByteArray, cloth: NDArray[np.bool_], form: NDArray[np.bool_], whole: NDArray[np.bool_]
) -> NDArray[np.bool_] | None:
    """Return which pixels show background, (H, W); None where nothing is asked, or colours do not tell.

    Args:
        picture: sRGB, shape (H, W, 3).
        cloth, form, whole: Where cloth that was seen, the mannequin and the garment with its fillings are, (H, W).
    """
    beside = ~(cloth | form | whole)
    asked = whole & ~cloth & ~form
    if not asked.any():
        return None
    near = _grown(asked, NEAR_PX)
    ours = near & ~_grown(~beside, BORDER_PX)
    theirs = near & ~_grown(~cloth, BORDER_PX)
    if min(ours.sum(), theirs.sum()) < LEAST_PIXELS:
        return None
    around = _grown(asked, 1)
    colors = np.vstack([picture[ours], picture[theirs], picture[around]])
    kind = np.repeat([0, 1, 2], [ours.sum(), theirs.sum(), around.sum()])
    usual = usual_colors(colors, kind == 0, kind == 1, BINS, LIGHT, SURE)
    if np.mean(usual[kind == 0]) < TOLD or np.mean(~usual[kind == 1]) < TOLD:
        return None
    share = np.zeros(asked.shape)
    share[around] = usual[kind == 2]
    background = beside | (asked & (uniform_filter(share, 3) > 0.5))
    piece, _ = label(background)
    return np.asarray(np.isin(piece, np.unique(piece[beside])) & background)


def _grown(mask: NDArray[np.bool_], by: int) -> NDArray[np.bool_]:
    """Return a mask (H, W) with so many more pixels around it."""
    import cv2

    side = 2 * by + 1
    return np.asarray(cv2.dilate(mask.astype(np.uint8), np.ones((side, side), np.uint8)), dtype=bool)


def far_beyond(points: FloatArray, backdrops: Sequence[Backdrop]) -> FloatArray:
    """Return how far points (N, 3) lie in front of background [m], shape (N,); at most 0 where they do not.

    Two photos that say so agree on the lesser distance; one alone may be off.
    """
    most, second = np.full(len(points), -np.inf), np.full(len(points), -np.inf)
    for backdrop in backdrops:
        beyond = _beyond(points, backdrop)
        second = np.maximum(second, np.minimum(most, beyond))
        most = np.maximum(most, beyond)
    return np.asarray(np.maximum(second, most - ALONE))


def _beyond(points: FloatArray, backdrop: Backdrop) -> FloatArray:
    """How far points are across the border of a photo's background [m], (N,); minus infinity beyond the photo."""
    camera, turn = backdrop.camera, backdrop.cam_from_world
    local = points @ turn[:3, :3].T + turn[:3, 3]
    ahead = local[:, 2] > 1e-6
    z = np.where(ahead, local[:, 2], 1.0)
    column, row = camera.fx * local[:, 0] / z + camera.cx, camera.fy * local[:, 1] / z + camera.cy
    shown = ahead & (column >= 0) & (column <= camera.width - 1) & (row >= 0) & (row <= camera.height - 1)
    far = np.full(len(points), -np.inf)
    pixels = map_coordinates(backdrop.beyond, np.stack([row[shown], column[shown]]), order=1)
    far[shown] = pixels * z[shown] / camera.fx
    return far
