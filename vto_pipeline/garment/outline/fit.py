"""Gauss-Newton steps that bring the outline of a mesh onto the edges of photos."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from vto_pipeline.garment.outline.contour import ContourMesh
from vto_pipeline.garment.outline.edges import EdgePhoto
from vto_pipeline.garment.outline.match import nearest_edges
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.numerics.cpu_threads import in_order

REACH_PX = 8.0
"""Pictures are taken as small as makes the reach of the search about this many pixels."""
MOST_STEP = 0.5
"""A point moves in one step by no more than this share of the reach."""
SECTORS = 6
"""Photos from one side share what is wrong with their cameras: only so many sides are taken to err on their own."""
ALIKE = 0.01
"""Along so much of an outline its distance from the edges is one and the same error [share of the form's size]."""
INSIDE_REACH = 0.5
"""So many reaches of the search inside the form, a point is inside it."""
INSIDE_WEIGHT = 0.3
"""Of all scan points, were they all inside, against all points of the outline: cloth inside the form is impossible."""


@dataclass(frozen=True)
class OutlineFit:
    """A placement and how well photos confirm it.

    Args:
        scan_from_form: Rigid or similarity, shape (4, 4).
        support: Share of the visible outline with an edge, weighted by its strength and nearness.
        inside: Share of the scan deeper inside the form than the reach of the search.
        photos: In how many photos enough of the outline is seen.
        length: Of the visible outline, in all photos together, in sizes of the form.
        rms: Distance of the outline from its edges [form's unit].
        covariance: Of rotation vector about the form's middle, shift and logarithm of scale, in the form's unit: how
            much the photos of different sides disagree, and what the outline leaves undetermined; shape (P, P).
    """

    scan_from_form: FloatArray
    support: float
    inside: float
    photos: int
    length: float
    rms: float
    covariance: FloatArray


class _Sums(NamedTuple):
    """What one photo says of a placement, P ways of moving it being free.

    Args:
        normal: Gauss-Newton matrix, shape (P, P).
        gradient: Shape (P,).
        length: Of the outline that it shows [form's unit].
        supported: Of that, what lies on edges.
        squares: Distances from the edges, squared and weighted.
        weight: Of them.
    """

    normal: FloatArray
    gradient: FloatArray
    length: float
    supported: float
    squares: float
    weight: float


class OutlineProblem:
    """All that placements are judged by.

    Args:
        forms: The mannequin for photos of full size, of half, and so on; the last one serves all smaller ones.
        distance: Distance queries of the first.
        scan: Points of the scan, spread evenly, in its unit, shape (N, 3).
        photos: As edges.
    """

    def __init__(
        self, forms: Sequence[ContourMesh], distance: SurfaceDistance, scan: FloatArray, photos: Sequence[EdgePhoto]
    ) -> None:
        form = forms[0]
        self.form, self.forms, self.distance, self.scan, self.photos = form, forms, distance, scan, photos
        self.middle = 0.5 * (form.mesh.vertices.min(axis=0) + form.mesh.vertices.max(axis=0))
        self.lever = 0.5 * form.size
        self._sector = _sectors(photos)

    def step(self, placement: FloatArray, reach: float, free: Sequence[int], move: bool = True) -> OutlineFit:
        """Take one step, or with `move` False none, and judge the placement that it started from.

        Photos are looked at side by side.

        Args:
            placement: scan_from_form, shape (4, 4).
            reach: Farthest edge that belongs to the outline [form's unit].
            free: Which of rotation (0 to 2), shift (3 to 5) and logarithm of scale (6) may change; in the form's axes.
        """
        scale = float(np.cbrt(np.linalg.det(placement[:3, :3])))
        size = len(free)
        found = list(in_order(lambda k: self._sums(self.photos[k], placement, scale, reach, free), len(self.photos)))
        normal, gradient = sum((one.normal for one in found), np.zeros((size, size))), [one.gradient for one in found]
        lengths, supported = sum(one.length for one in found), sum(one.supported for one in found)
        squares, weights = sum(one.squares for one in found), sum(one.weight for one in found)
        photos = sum(one.length > 0.05 * self.form.size for one in found)
        pull = np.sum(gradient, axis=0)
        deep, inside = self._inside(placement, reach, free)
        share = INSIDE_WEIGHT * max(lengths, 1e-9) / len(self.scan)
        damping = 1e-6 * np.trace(normal) / size + 1e-12
        system = normal + share * deep[0] + damping * np.eye(size)
        inverse = np.linalg.inv(system)
        sides = np.zeros((SECTORS, size))
        np.add.at(sides, self._sector, np.stack(gradient))
        covariance = inverse @ (sides.T @ sides) @ inverse * SECTORS / (SECTORS - 1)
        covariance = covariance + squares / max(weights, 1e-12) * ALIKE * self.form.size * inverse
        change = np.zeros(7)
        change[list(free)] = inverse @ (pull + share * deep[1])
        moved = self._moved(placement, change, reach) if move else placement
        rms = float(np.sqrt(squares / weights)) if weights > 0 else np.inf
        support = float(supported / lengths) if lengths > 0 else 0.0
        return OutlineFit(moved, support, inside, photos, float(lengths / self.form.size), rms, covariance)

    def _sums(self, photo: EdgePhoto, placement: FloatArray, scale: float, reach: float, free: Sequence[int]) -> _Sums:
        jacobian, away, length, strength = self._rows(photo, placement, scale, reach)
        jacobian = jacobian[:, free]
        near = np.maximum(1.0 - np.square(away / reach), 0.0)
        weight = length * strength * near**2
        normal, gradient = jacobian.T @ (weight[:, None] * jacobian), jacobian.T @ (weight * away)
        supported, squares = float((length * strength * near).sum()), float((weight * away**2).sum())
        return _Sums(normal, gradient, float(length.sum()), supported, squares, float(weight.sum()))

    def _rows(
        self, photo: EdgePhoto, placement: FloatArray, scale: float, reach: float
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Jacobian (N, 7), distance outward and length of each point [form's unit], strength of its edge."""
        cam_from_form = photo.cam_from_scan @ placement
        near = cam_from_form[:3, :3] @ self.middle + cam_from_form[:3, 3]
        fine = reach * photo.levels[0].camera.fx / max(near[2] / scale, 1e-6)
        halved = int(np.clip(np.floor(np.log2(max(fine / REACH_PX, 1.0)) + 0.5), 0, len(photo.levels) - 1))
        level = photo.levels[halved]
        seen = self.forms[min(halved, len(self.forms) - 1)].contour(cam_from_form, level)
        camera = level.camera
        if len(seen.depth) == 0:
            return np.zeros((0, 7)), np.zeros(0), np.zeros(0), np.zeros(0)
        metres = seen.depth / (scale * camera.fx)  # of a pixel, in the form's unit
        most = max(reach / float(np.median(metres)), 2.0)
        offset, strength = nearest_edges(level.gradient, seen.pixel, seen.outward, most, level.half)
        x = (seen.pixel[:, 0] - camera.cx) / camera.fx
        y = (seen.pixel[:, 1] - camera.cy) / camera.fy
        across = seen.outward * [1.0, camera.fy / camera.fx]  # of a shift in the camera's frame, in pixels
        local = np.column_stack([across, -(across[:, 0] * x + across[:, 1] * y)])
        ahead = local @ (cam_from_form[:3, :3] / scale)  # the same in the form's frame
        arm = seen.point - self.middle
        jacobian = np.hstack([np.cross(arm, ahead), ahead, np.einsum("nd,nd->n", arm, ahead)[:, None]])
        return jacobian, offset * metres, seen.length * metres, strength

    def _inside(
        self, placement: FloatArray, reach: float, free: Sequence[int]
    ) -> tuple[tuple[FloatArray, FloatArray], float]:
        """Normal matrix and pull of the scan's points inside the form, and their share."""
        form_from_scan = np.linalg.inv(placement)
        points = self.scan @ form_from_scan[:3, :3].T + form_from_scan[:3, 3]
        near = self.distance.signed(points)
        deep = near.distance < 0
        outward = self.form.normals[near.face[deep]]
        arm = points[deep] - self.middle
        jacobian = np.hstack([np.cross(arm, outward), outward, np.einsum("nd,nd->n", arm, outward)[:, None]])[:, free]
        away = np.maximum(near.distance[deep], -reach)  # the form is to move inward there
        return (jacobian.T @ jacobian, jacobian.T @ away), float((near.distance < -INSIDE_REACH * reach).mean())

    def _moved(self, placement: FloatArray, change: FloatArray, reach: float) -> FloatArray:
        """The placement after a change in the form's axes, shortened if it moves the form too far at once."""
        farthest = max(self.lever * float(np.linalg.norm(change[:3])), float(np.linalg.norm(change[3:6])))
        farthest = max(farthest, self.lever * abs(float(change[6])))
        change = change * min(1.0, MOST_STEP * reach / max(farthest, 1e-12))
        motion = np.eye(4)
        motion[:3, :3] = Rotation.from_rotvec(change[:3]).as_matrix() * np.exp(change[6])
        motion[:3, 3] = self.middle - motion[:3, :3] @ self.middle + change[3:6]
        return placement @ motion


def _sectors(photos: Sequence[EdgePhoto]) -> IntArray:
    """Side that each photo is taken from, of as many as there are, equally full, shape (C,)."""
    eyes = np.stack([-photo.cam_from_scan[:3, :3].T @ photo.cam_from_scan[:3, 3] for photo in photos])
    across = eyes - eyes.mean(axis=0)
    rank = np.argsort(np.argsort(np.arctan2(across[:, 0], across[:, 2]), kind="stable"), kind="stable")
    return np.asarray(rank * SECTORS // len(photos), dtype=np.int32)
