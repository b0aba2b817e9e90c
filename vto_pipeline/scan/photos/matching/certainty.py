"""How certain cameras are: what the sightings leave open, seen where the photos look.

Photos whose features all lie on a board agree on it to a fraction of a pixel, and may yet show what stands beside it
many pixels from where their cameras say. The normal matrix of the adjustment tells so (Triggs et al. 2000, "Bundle
adjustment - a modern synthesis", sections 6 and 9).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import bsr_matrix, coo_matrix, csr_matrix

from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.scan.object_sphere import object_sphere

SOFT_PX = 1.0
"""Errors beyond this lose their weight [px]."""
FRAMES = 4
"""How often the frame is chosen anew in which certain cameras move least: one photo that may be anywhere has no say."""


def uncertainty_px(model: Any) -> FloatArray:
    """Return how far off each photo may show the place that all look at, one standard deviation [px], shape (C,).

    All cameras may move as one: that changes nothing, and is chosen so that the centres of those that are certain move
    least.

    Args:
        model: A pycolmap Reconstruction; its photos in the order of their numbers. Lenses are taken as bent as they
            are; their focal lengths are as uncertain as the rest.
    """
    ids = sorted(number for number, image in model.images.items() if image.has_pose)
    poses = np.stack([model.images[number].cam_from_world().inverse().matrix() for number in ids])
    points = np.array([model.points3D[number].xyz for number in sorted(model.points3D)])
    sphere = object_sphere(poses)
    middle = np.median(points, axis=0) if sphere is None else sphere.center
    unit = np.median(np.linalg.norm(poses[:, :, 3] - middle, axis=1))  # so that no number is much larger than others
    cameras = _Cameras(model, ids, (poses[:, :, 3] - middle) / unit, poses[:, :, :3].transpose(0, 2, 1))
    photo, point, rays = _sightings(model, ids)

    slope, by_point, miss = cameras.slopes(photo, ((points - middle) / unit)[point], rays)
    weight = 1.0 / (1.0 + (miss**2).sum(axis=1) / SOFT_PX**2)  # as of Cauchy's loss
    normal = _without_points(cameras.spread(photo, slope), by_point, point, weight)
    spare = max(2 * len(photo) - len(normal) - 3 * len(points) + 7, 1)
    variance = (weight * (miss**2).sum(axis=1)).sum() / spare
    moves = cameras.as_one()
    loose = variance * np.linalg.inv(normal + moves @ moves.T)
    weights = np.ones(len(cameras.places))
    for _ in range(FRAMES):
        covariance = _least_moved(loose, moves, cameras.places, weights)
        spread = np.diag(covariance)[cameras.places].reshape(-1, 3).sum(axis=1)
        weights = np.repeat(1.0 / np.maximum(spread, 1e-12 * spread.max()), 3)

    each = np.arange(len(ids), dtype=np.int32)
    there = cameras.spread(each, cameras.slopes(each, np.zeros((len(ids), 3)), np.zeros((len(ids), 2)))[0]).toarray()
    return np.asarray(np.sqrt(((there @ covariance) * there).sum(axis=1).reshape(-1, 2).sum(axis=1)))


class _Cameras:
    """What can change of C photos: turn and place of each, then the focal length of each lens.

    Args:
        model: A pycolmap Reconstruction.
        ids: Numbers of the photos.
        centers: Where they were taken, shape (C, 3).
        turns: World to camera, shape (C, 3, 3).
    """

    def __init__(self, model: Any, ids: list[int], centers: FloatArray, turns: FloatArray) -> None:
        lenses = [model.images[number].camera_id for number in ids]
        self.centers, self.turns = centers, turns
        self.focal = np.array([model.cameras[lens].focal_length for lens in lenses])
        self.lens = np.unique(lenses, return_inverse=True)[1]
        self.places = (6 * np.arange(len(ids))[:, None] + [3, 4, 5]).ravel().astype(np.int32)
        self.count = 6 * len(ids) + int(self.lens.max()) + 1

    def slopes(
        self, photo: IntArray, points: FloatArray, rays: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return how a shown place changes with turn, place and focal length (S, 2, 7), and with its point (S, 2, 3);
        and how far it is from where it was seen (S, 2) [px].

        Args:
            photo: That shows it, shape (S,).
            points: That it shows, shape (S, 3).
            rays: Where it was seen, at a focal length of 1, shape (S, 2).
        """
        focal = self.focal[photo, None, None]
        local = np.einsum("sij,sj->si", self.turns[photo], points - self.centers[photo])
        shown = local[:, :2] / local[:, 2:]
        by_local = focal * np.dstack([np.broadcast_to(np.eye(2), (len(photo), 2, 2)), -shown]) / local[:, 2, None, None]
        by_turn = np.cross(local[:, None, :], by_local)
        by_point = by_local @ self.turns[photo]
        slope = np.concatenate([by_turn, -by_point, focal * shown[:, :, None]], axis=2)
        return slope, by_point, focal[:, 0] * (shown - rays)

    def spread(self, photo: IntArray, slope: FloatArray) -> csr_matrix:
        """Return slopes (S, 2, 7) as rows of all that can change, shape (2 S, P)."""
        column = np.column_stack([6 * photo[:, None] + np.arange(6), 6 * len(self.turns) + self.lens[photo]])
        column = np.repeat(column, 2, axis=0)
        row = np.broadcast_to(np.arange(len(column))[:, None], column.shape)
        return coo_matrix((slope.ravel(), (row.ravel(), column.ravel())), (len(column), self.count)).tocsr()

    def as_one(self) -> FloatArray:
        """Return the seven ways in which all cameras move and grow as one, shape (P, 7)."""
        moves = np.zeros((self.count, 7))
        for k, (center, turn) in enumerate(zip(self.centers, self.turns, strict=True)):
            moves[6 * k : 6 * k + 3, :3] = -turn
            moves[6 * k + 3 : 6 * k + 6] = np.column_stack([np.cross(np.eye(3), center).T, np.eye(3), center])
        return moves


def _sightings(model: Any, ids: list[int]) -> tuple[IntArray, IntArray, FloatArray]:
    """Return photo (S,), point (S,) and ray at a focal length of 1 (S, 2) of each sighting."""
    place = {number: index for index, number in enumerate(ids)}
    photo, point, rays = [], [], []
    for row, number in enumerate(sorted(model.points3D)):
        for element in model.points3D[number].track.elements:
            image = model.images[element.image_id]
            photo.append(place[element.image_id])
            point.append(row)
            rays.append(model.cameras[image.camera_id].cam_from_img(image.point2D(element.point2D_idx).xy))
    return np.array(photo, np.int32), np.array(point, np.int32), np.array(rays, dtype=float).reshape(-1, 2)


def _least_moved(covariance: FloatArray, moves: FloatArray, places: IntArray, weights: FloatArray) -> FloatArray:
    """Return a covariance (P, P) after moving all as one, along its columns of moves (P, 7), so that some parameters
    change least, by least squares with weights (Baarda's S-transformation, 1973)."""
    held = np.eye(len(covariance))
    root = np.sqrt(weights)[:, None]
    held[:, places] -= moves @ np.linalg.pinv(root * moves[places]) * root.T
    return np.asarray(held @ covariance @ held.T)


def _without_points(cameras: csr_matrix, by_point: FloatArray, point: IntArray, weight: FloatArray) -> FloatArray:
    """Return the normal matrix of the cameras, their points free to follow (its Schur complement), shape (P, P)."""
    count = int(point.max()) + 1
    weights = np.repeat(weight, 2)
    own = np.zeros((count, 3, 3))
    np.add.at(own, point, np.einsum("s,sij,sik->sjk", weight, by_point, by_point))
    free = np.linalg.pinv(own, rcond=1e-9, hermitian=True)
    ends = np.arange(count + 1)
    among = bsr_matrix((free, ends[:-1], ends), (3 * count, 3 * count))
    column = np.repeat(3 * point[:, None] + np.arange(3), 2, axis=0)
    row = np.broadcast_to(np.arange(len(column))[:, None], column.shape)
    points = coo_matrix((by_point.ravel(), (row.ravel(), column.ravel())), (len(column), 3 * count)).tocsr()
    weighted = cameras.multiply(weights[:, None]).tocsr()
    mixed = points.T @ weighted
    return np.asarray((cameras.T @ weighted - mixed.T @ among @ mixed).toarray())
