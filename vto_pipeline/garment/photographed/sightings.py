"""Where on the mannequin the photos show cloth, and where they show it bare."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vto_pipeline.garment.align import PosedPhotos
from vto_pipeline.garment.subtraction.color_model import color_evidence
from vto_pipeline.garment.subtraction.variety import picture_variety, variety_evidence
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.geometry.seen.depth_picture import depth_picture, pixels_of
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import submesh, surface_area
from vto_pipeline.io.captures.images import read_image
from vto_pipeline.io.captures.undistort import undistorted
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.cpu_threads import in_order

MAX_PHOTOS, MAX_SIDE = 60, 800
"""More photos are thinned evenly; larger ones are scaled down to this longer side [px]."""
SPACING = 0.008
"""Between points of the mannequin [m]."""
BORDER_PX = 3
"""Pixels so near to where one thing hides another may show either."""
CLIPPED = 253
"""From here on a channel is taken for clipped: under lamps the palest flowers are as white as the form."""
LEAST_COSINE = 0.2
"""Of the angle between the mannequin's normal and the line of sight."""
BEHIND = 0.01
"""A point of the mannequin is hidden where something is nearer by more than this [m]."""
LEAST_PIXELS = 300
"""Of garment and of mannequin in a photo whose colours are learnt."""
SURE = 1.0
"""Log-likelihood ratio of a colour that tells cloth from mannequin."""
CLOTH_TOLD, FORM_TOLD = 0.8, 0.4
"""So much of the garment, and of what shows of the mannequin, must be told in a photo: part of what shows of
the mannequin may be cloth that the surface lacks."""
AROUND_PX = 32
"""So much around what is asked about is looked at, too."""
VARIETY_PX = 15
"""Side of the square in which colours vary: a few centimetres of cloth."""
LEAST_VIEWS = 2
"""Photos that must show a point."""
MOST = 4.0
"""One photo counts no more than this log-likelihood ratio."""


T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Sightings:
    """Points of the mannequin that no part of the garment hides, N of them.

    Args:
        points: Evenly spread [m], shape (N, 3).
        cloth: Which of them show cloth, shape (N,).
        area: That each stands for [m²].
    """

    points: FloatArray
    cloth: NDArray[np.bool_]
    area: float

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.points)

    def under(self, points: FloatArray, distance: SurfaceDistance) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return which points (N, 3) lie over mannequin that photos show bare, and which over cloth, shape (N,) each.

        Args:
            points: [m].
            distance: To the mannequin.
        """
        if len(self.points) == 0:
            return np.zeros(len(points), dtype=bool), np.zeros(len(points), dtype=bool)
        foot = distance.nearest(points).point
        away, which = self._tree.query(foot, distance_upper_bound=np.sqrt(self.area))
        shown = np.isfinite(away)
        clothed = np.append(self.cloth, False)[which]
        return shown & ~clothed, shown & clothed


def look_at_mannequin(
    garment: TriangleMesh, observed: NDArray[np.bool_], mannequin: TriangleMesh, photos: PosedPhotos, job: Job
) -> Sightings | None:
    """Ask the photos what they show where the garment leaves the mannequin bare.

    In each photo the colours of cloth are those of its observed part, and the mannequin's those of what shows of it;
    each photo by itself, since exposure and white balance change.

    Args:
        garment: The finished garment.
        observed: Which of its vertices a sensor saw, shape (V,).
        mannequin: In the same frame.
        photos: With their cameras in that frame.
        job: Receives what was left out, and how many photos told.

    Returns:
        What they show; None where cloth and mannequin hardly differ in colour, or too little of either shows.
    """
    area = surface_area(mannequin)
    count = max(int(area / SPACING**2), 1)
    points, normals, _ = sample_surface(mannequin, count, job.seed)
    seen_cloth, _ = submesh(garment, np.all(observed[garment.faces], axis=1))

    def ask(picture: ByteArray, camera: Intrinsics, pose: FloatArray) -> tuple[NDArray[np.int_], FloatArray] | None:
        cam_from_world: FloatArray = np.asarray(np.linalg.inv(pose), dtype=np.float64)
        form = depth_picture(mannequin, camera, cam_from_world)
        cloth = depth_picture(garment, camera, cam_from_world)
        observed_cloth = depth_picture(seen_cloth, camera, cam_from_world)
        evidence = _evidence(
            picture,
            _eroded(np.isfinite(cloth) & (observed_cloth <= cloth) & (cloth < form)),
            _eroded(form < cloth - BEHIND),  # it pokes through cloth that is pressed on
        )
        return None if evidence is None else _read(points, normals, pose, camera, form, evidence)

    score, views, told, read = np.zeros(count), np.zeros(count, dtype=int), 0, 0
    for found in of_small_photos(photos, (garment, mannequin), ask):
        read += 1
        if found is not None:
            told += 1
            shows, ratio = found
            score[shows] += ratio
            views[shows] += 1
    if told < LEAST_VIEWS:
        reason = "in the photos too little of the mannequin shows, or it is of the cloth's colours"
        job.leave_out("cloth beside the openings", reason)
        return None
    enough = views >= LEAST_VIEWS
    mean = score[enough] / views[enough]
    job.note(f"{told} of {read} photos tell cloth from mannequin by colour")
    return Sightings(points[enough], mean > SURE, area / count)


def of_small_photos(
    photos: PosedPhotos, things: Sequence[TriangleMesh], ask: Callable[[ByteArray, Intrinsics, FloatArray], T]
) -> Iterator[T]:
    """Yield what is asked of photos, in their order; they are read side by side.

    Args:
        photos: With their cameras.
        things: What is asked about: no more of a photo is looked at than shows these, and a little around.
        ask: Of a photo without distortion and of limited size, its lens and its pose (world_from_cam).
    """
    at = {path.name: path for path in photos.paths}
    usable = [k for k, name in enumerate(photos.cameras.names) if name in at]
    chosen = np.unique(np.linspace(0, len(usable) - 1, min(len(usable), MAX_PHOTOS)).round().astype(int))

    def read(number: int) -> T:
        k = usable[chosen[number]]
        pose = photos.cameras.world_from_cam[k]
        picture, camera = _small(at[photos.cameras.names[k]], photos.cameras.intrinsics[k])
        return ask(*_cropped(picture, camera, pose, things), pose)

    return in_order(read, len(chosen))


def _cropped(
    picture: ByteArray, camera: Intrinsics, pose: FloatArray, things: Sequence[TriangleMesh]
) -> tuple[ByteArray, Intrinsics]:
    """Return what of a photo shows things, and its camera; the whole photo where they reach behind it."""
    cam_from_world: FloatArray = np.asarray(np.linalg.inv(pose), dtype=np.float64)
    pixel = np.vstack([pixels_of(thing, camera, cam_from_world) for thing in things])
    if not np.all(pixel[:, 2] > 0.0):
        return picture, camera
    end = np.array([camera.width, camera.height])
    low = np.clip(np.floor(pixel[:, :2].min(axis=0)) - AROUND_PX, 0, end).astype(int)
    high = np.clip(np.ceil(pixel[:, :2].max(axis=0)) + AROUND_PX + 1, 0, end).astype(int)
    if not np.all(low < high):
        return picture, camera
    (left, top), (right, bottom) = low, high
    width, height = int(right - left), int(bottom - top)
    part = replace(camera, width=width, height=height, cx=camera.cx - left, cy=camera.cy - top)
    return np.ascontiguousarray(picture[top:bottom, left:right]), part


def _small(path: Path, lens: Intrinsics) -> tuple[ByteArray, Intrinsics]:
    """Return a photo without distortion, scaled down, and its camera."""
    import cv2

    picture = undistorted(read_image(path), lens)
    camera = lens.resized(picture.shape[1], picture.shape[0]).without_distortion()
    scale = min(1.0, MAX_SIDE / max(picture.shape[:2]))
    if scale == 1.0:
        return picture, camera
    camera = camera.resized(max(round(scale * camera.width), 1), max(round(scale * camera.height), 1))
    smaller = cv2.resize(picture, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
    return np.asarray(smaller, dtype=np.uint8), camera


def _eroded(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return a mask (H, W) without its border."""
    import cv2

    side = 2 * BORDER_PX + 1
    return np.asarray(cv2.erode(mask.astype(np.uint8), np.ones((side, side), np.uint8), borderValue=0)) > 0


def _evidence(picture: ByteArray, cloth: NDArray[np.bool_], form: NDArray[np.bool_]) -> NDArray[np.float32] | None:
    """Return the log-likelihood ratio of cloth against mannequin on what shows of the mannequin, NaN elsewhere, (H, W);
    None where the photo shows too little of either, or their colours do not tell them apart. Clipped pixels tell none.

    Colours tell, or how they vary from place to place: what tells better decides alone. A form in the shadow of a hem
    may be as grey as a print, but no print is of one colour.
    """
    exposed = (picture < CLIPPED).all(axis=2)
    cloth, form = cloth & exposed, form & exposed
    if cloth.sum() < LEAST_PIXELS or form.sum() < LEAST_PIXELS:
        return None
    colors = np.vstack([picture[cloth], picture[form]])
    is_cloth = np.arange(len(colors)) < cloth.sum()
    variety = np.concatenate([picture_variety(picture, shown, VARIETY_PX)[shown] for shown in (cloth, form)])
    kinds = (color_evidence(colors, is_cloth, ~is_cloth), variety_evidence(variety, is_cloth, ~is_cloth))
    told = [(float(np.mean(kind[is_cloth] > SURE)), float(np.mean(kind[~is_cloth] < -SURE))) for kind in kinds]
    telling = [k for k, (of_cloth, of_form) in enumerate(told) if of_cloth >= CLOTH_TOLD and of_form >= FORM_TOLD]
    if not telling:
        return None
    ratio = kinds[max(telling, key=lambda k: sum(told[k]))]
    evidence = np.full(cloth.shape, np.float32(np.nan), dtype=np.float32)
    evidence[form] = np.clip(ratio[~is_cloth], -MOST, MOST)
    return evidence


def _read(
    points: FloatArray,
    normals: FloatArray,
    pose: FloatArray,
    camera: Intrinsics,
    depth: FloatArray,
    evidence: NDArray[np.float32],
) -> tuple[NDArray[np.int_], FloatArray]:
    """Return which points (N, 3) a photo shows, shape (K,), and the evidence there, shape (K,)."""
    local = (points - pose[:3, 3]) @ pose[:3, :3]
    z = np.where(local[:, 2] > 0.0, local[:, 2], np.inf)
    away = np.linalg.norm(local, axis=1)
    facing = -np.einsum("nd,nd->n", points - pose[:3, 3], normals) / away > LEAST_COSINE
    column = np.rint(camera.fx * local[:, 0] / z + camera.cx).astype(int)
    row = np.rint(camera.fy * local[:, 1] / z + camera.cy).astype(int)
    inside = facing & (local[:, 2] > 0.0) & (column >= 0) & (column < camera.width) & (row >= 0) & (row < camera.height)
    which = np.flatnonzero(inside)
    there = row[which], column[which]
    ratio = evidence[there]
    shows = np.isfinite(ratio) & (z[which] < depth[there] + BEHIND)
    return which[shows], ratio[shows].astype(float)
