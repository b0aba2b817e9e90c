"""Rigid registration of a dressed scan to the bare mannequin: cloth may stand off outwards; nothing may be inside.

Iteratively reweighted Gauss-Newton on point-to-plane distances (Chen and Medioni 1992). A point outside counts by
Tukey's biweight within a band, which shrinks; a point inside counts fully however deep, so that the scan is pushed out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.arrays import FloatArray

FACING = 0.5
"""Least cosine between a scan normal and the mannequin's for the point to count as bare mannequin."""
DEEPEST = 3.0
"""Bands beyond which a deeper point inside costs no more, so that stray points decide nothing."""


@dataclass(frozen=True)
class MannequinAlignment:
    """A placement and how well it explains the scan.

    Args:
        mannequin_from_surface: Shape (4, 4), rigid.
        cost: Mean truncated squared distance over band², the lower the better.
        bare: Which points lie on bare mannequin, shape (N,).
        inside: Share of the points deeper inside the mannequin than the last band and the noise explain.
        rms: Of the bare points' distances [m].
        noise: Of the scan, standard deviation [m], from points inside: cloth never lies there.
        normal_matrix: Gauss-Newton matrix of the bare points about their middle, rotation first, shape (6, 6).
    """

    mannequin_from_surface: FloatArray
    cost: float
    bare: NDArray[np.bool_]
    inside: float
    rms: float
    noise: float
    normal_matrix: FloatArray


def scan_noise(distance: FloatArray, deepest: float) -> float:
    """Return the standard deviation of a scan about the mannequin [m], infinite when nothing lies inside.

    From the points inside: cloth never lies there, so that they are the bare parts' noise alone, folded at zero.

    Args:
        distance: Signed distances to the mannequin [m], shape (N,).
        deepest: Points deeper than this are no noise [m].
    """
    inside = -distance[(distance < 0.0) & (distance > -deepest)]
    return float(np.median(inside)) / 0.6745 if len(inside) else np.inf


def robust_icp(
    points: FloatArray,
    normals: FloatArray,
    distance: SurfaceDistance,
    mannequin_normals: FloatArray,
    start: FloatArray,
    bands: FloatArray,
) -> MannequinAlignment:
    """Refine one placement.

    Args:
        points: Scan points [m], shape (N, 3).
        normals: Their unit normals, shape (N, 3).
        distance: Distance queries against the mannequin.
        mannequin_normals: Of its faces, shape (F, 3).
        start: mannequin_from_surface, shape (4, 4).
        bands: Band of each iteration [m], shrinking.
    """
    placement = start
    for band in bands:
        moved, away, plane, facing = _compare(points, normals, distance, mannequin_normals, placement)
        weight = _weights(away, facing, band)
        middle = moved.mean(axis=0)
        jacobian = np.hstack([np.cross(moved - middle, plane), plane])
        matrix = jacobian.T @ (weight[:, None] * jacobian)
        damping = 1e-9 * np.trace(matrix) + 1e-12  # nothing near enough to pull: stay
        step = -np.linalg.solve(matrix + damping * np.eye(6), jacobian.T @ (weight * away))
        placement = _moved_by(step, middle) @ placement
    moved, away, plane, facing = _compare(points, normals, distance, mannequin_normals, placement)
    return _evaluate(moved, away, plane, facing, placement, float(bands[-1]))


def _compare(
    points: FloatArray, normals: FloatArray, distance: SurfaceDistance, mannequin_normals: FloatArray, at: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return moved points, their signed distances, the mannequin's normals there, and the cosines between normals."""
    moved = points @ at[:3, :3].T + at[:3, 3]
    nearest = distance.signed(moved)
    plane = mannequin_normals[nearest.face]
    return moved, nearest.distance, plane, np.einsum("nd,nd->n", normals @ at[:3, :3].T, plane)


def _weights(away: FloatArray, facing: FloatArray, band: float) -> FloatArray:
    tukey = np.square(1.0 - np.square(np.minimum(np.abs(away) / band, 1.0)))
    bare = np.where(facing > FACING, tukey, 0.0)
    deep = np.minimum(DEEPEST * band / np.maximum(-away, band), 1.0)
    return np.where(away < -band / 2.0, np.maximum(deep, bare), bare)


def _moved_by(step: FloatArray, middle: FloatArray) -> FloatArray:
    """Return the rigid motion by a rotation vector about `middle` and a translation, shape (4, 4)."""
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_rotvec(step[:3]).as_matrix()
    motion[:3, 3] = middle - motion[:3, :3] @ middle + step[3:]
    return motion


def _evaluate(
    moved: FloatArray, away: FloatArray, plane: FloatArray, facing: FloatArray, placement: FloatArray, band: float
) -> MannequinAlignment:
    over = np.clip(away / band, -DEEPEST, 1.0)
    bare = (np.abs(away) < band) & (facing > FACING)
    on = moved[bare]
    jacobian = np.hstack([np.cross(on - on.mean(axis=0), plane[bare]), plane[bare]]) if len(on) else np.zeros((0, 6))
    rms = float(np.sqrt(np.mean(np.square(away[bare])))) if len(on) else np.inf
    noise = scan_noise(away[facing > FACING], DEEPEST * band)
    inside = float(np.mean(away < -max(band, 4.0 * noise)))
    return MannequinAlignment(
        placement, float(np.mean(np.square(over))), bare, inside, rms, noise, jacobian.T @ jacobian
    )
