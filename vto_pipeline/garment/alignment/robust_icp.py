"""Registration of a dressed scan to the bare mannequin: cloth may stand off outwards; nothing may be inside.

Iteratively reweighted Gauss-Newton on point-to-plane distances (Chen and Medioni 1992), with the scale as seventh
unknown where the scan has none. A point outside counts by Tukey's biweight within a band, which shrinks; a point inside
counts fully however deep, so that the scan is pushed out.
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
MOST_GROWTH = 0.05
"""Largest change of the scale's logarithm in one step."""


@dataclass(frozen=True)
class MannequinAlignment:
    """A placement and how well it explains the scan.

    Args:
        mannequin_from_surface: Shape (4, 4), rigid, or with a scale.
        merit: Share of the scan, weighted by how closely it lies on the mannequin: 1 on it, 0 beyond the band, less
            than nothing inside. Times the scaled area, it compares placements of different scale: a share alone would
            be largest for a scan that has shrunk to a point of the surface.
        bare: Which points lie on bare mannequin, shape (N,).
        inside: Share of the points deeper inside the mannequin than the last band and the noise explain.
        rms: Of the bare points' distances [m].
        noise: Of the scan, standard deviation [m], from points inside: cloth never lies there.
        normal_matrix: Gauss-Newton matrix of the bare points about their middle: rotation, translation, and the
            scale's logarithm where it was free, shape (6, 6) or (7, 7).
    """

    mannequin_from_surface: FloatArray
    merit: float
    bare: NDArray[np.bool_]
    inside: float
    rms: float
    noise: float
    normal_matrix: FloatArray

    @property
    def scale(self) -> float:
        """Lengths on the mannequin over lengths in the scan."""
        return scale_of(self.mannequin_from_surface)


def scale_of(similarity: FloatArray) -> float:
    """Return the scale of a similarity transform, shape (4, 4)."""
    return float(np.cbrt(np.linalg.det(similarity[:3, :3])))


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
    free_scale: bool = False,
) -> MannequinAlignment:
    """Refine one placement.

    Args:
        points: Scan points, shape (N, 3).
        normals: Their unit normals, shape (N, 3).
        distance: Distance queries against the mannequin.
        mannequin_normals: Of its faces, shape (F, 3).
        start: mannequin_from_surface, shape (4, 4).
        bands: Band of each iteration [m], shrinking.
        free_scale: Whether the scale is unknown.
    """
    placement = start
    for band in bands:
        moved, away, plane, facing = _compare(points, normals, distance, mannequin_normals, placement)
        weight = _weights(away, facing, band)
        middle = np.average(moved, axis=0, weights=weight + 1e-12)
        jacobian = _jacobian(moved - middle, plane, free_scale)
        matrix = jacobian.T @ (weight[:, None] * jacobian)
        damping = 1e-9 * np.trace(matrix) + 1e-12  # nothing near enough to pull: stay
        step = -np.linalg.solve(matrix + damping * np.eye(len(matrix)), jacobian.T @ (weight * away))
        placement = _moved_by(step, middle) @ placement
    moved, away, plane, facing = _compare(points, normals, distance, mannequin_normals, placement)
    return _evaluate(moved, away, plane, facing, placement, float(bands[-1]), free_scale)


def _jacobian(from_middle: FloatArray, plane: FloatArray, free_scale: bool) -> FloatArray:
    """Return the change of each point's distance by rotation, translation, and scale, shape (N, 6) or (N, 7)."""
    moves = [np.cross(from_middle, plane), plane]
    if free_scale:
        moves.append(np.einsum("nd,nd->n", from_middle, plane)[:, None])
    return np.hstack(moves)


def _compare(
    points: FloatArray, normals: FloatArray, distance: SurfaceDistance, mannequin_normals: FloatArray, at: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return moved points, their signed distances, the mannequin's normals there, and the cosines between normals."""
    moved = points @ at[:3, :3].T + at[:3, 3]
    nearest = distance.signed(moved)
    plane = mannequin_normals[nearest.face]
    turned = normals @ at[:3, :3].T / scale_of(at)
    return moved, nearest.distance, plane, np.einsum("nd,nd->n", turned, plane)


def _weights(away: FloatArray, facing: FloatArray, band: float) -> FloatArray:
    tukey = np.square(1.0 - np.square(np.minimum(np.abs(away) / band, 1.0)))
    bare = np.where(facing > FACING, tukey, 0.0)
    deep = np.minimum(DEEPEST * band / np.maximum(-away, band), 1.0)
    return np.where(away < -band / 2.0, np.maximum(deep, bare), bare)


def _moved_by(step: FloatArray, middle: FloatArray) -> FloatArray:
    """Return the motion by a rotation vector and the scale's logarithm about `middle`, and a translation, (4, 4)."""
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_rotvec(step[:3]).as_matrix() * np.exp(
        np.clip(step[6:].sum(), -MOST_GROWTH, MOST_GROWTH)
    )
    motion[:3, 3] = middle - motion[:3, :3] @ middle + step[3:6]
    return motion


def _evaluate(
    moved: FloatArray,
    away: FloatArray,
    plane: FloatArray,
    facing: FloatArray,
    placement: FloatArray,
    band: float,
    free_scale: bool,
) -> MannequinAlignment:
    over = np.clip(away / band, -DEEPEST, 1.0)
    bare = (np.abs(away) < band) & (facing > FACING)
    on, count = moved[bare], 7 if free_scale else 6
    jacobian = _jacobian(on - on.mean(axis=0), plane[bare], free_scale) if len(on) else np.zeros((0, count))
    rms = float(np.sqrt(np.mean(np.square(away[bare])))) if len(on) else np.inf
    noise = scan_noise(away[facing > FACING], DEEPEST * band)
    inside = float(np.mean(away < -max(band, 4.0 * noise)))
    merit = float(1.0 - np.mean(np.square(over)))
    return MannequinAlignment(placement, merit, bare, inside, rms, noise, jacobian.T @ jacobian)
