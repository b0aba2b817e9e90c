"""Fit of a body in a garment as voxel solids, for all shifts at once and each quarter turn.

Body and garment, its openings closed, are solids of cubes. Cubes of body inside the garment count for it, cubes of
cloth inside the body against it; the sum over all shifts is a correlation (by FFT). No landmark is needed, so a skirt
is as good as a shirt.
"""

from __future__ import annotations

from itertools import permutations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfftn, next_fast_len, rfftn

from vto_pipeline.cloth.placement.voxels import solid_cubes
from vto_pipeline.geometry.topology import close_openings
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

_ANOTHER = 0.08  # m: places nearer in height are the same to a limb


class VoxelPlacement(NamedTuple):
    """The best place of a garment, turned in one way.

    Args:
        turn: The rotation about the origin, shape (3, 3).
        shift: To the best place after that [m], shape (3,).
        score: There: cubes of body inside less what of the cloth is inside the body, as a share of the garment's cubes.
        score_in_place: The same without shift.
    """

    turn: FloatArray
    shift: FloatArray
    score: float
    score_in_place: float

    def placed(self, garment: TriangleMesh) -> TriangleMesh:
        """Return a garment there."""
        return TriangleMesh(garment.vertices @ self.turn.T + self.shift, garment.faces)


def quarter_turns() -> list[FloatArray]:
    """Return the 24 rotations that map the axes on each other, the identity first; each of shape (3, 3)."""
    turns = []
    for axes in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            turn = np.zeros((3, 3))
            turn[range(3), axes] = signs
            if np.linalg.det(turn) > 0.0:
                turns.append(turn)
    return turns


class BodyCubes:
    """A body as cubes, of each size once, for all garments and sizes of them that are tried on it.

    Args:
        mesh: The body [m].
        cube: Side of the cubes, where they are fine [m].
        penalty: Weight of cloth inside the body against body inside the garment.
    """

    def __init__(self, mesh: TriangleMesh, cube: float, penalty: float) -> None:
        self.mesh = mesh
        self.cube = cube
        self._penalty = penalty
        self.low: FloatArray = mesh.vertices.min(axis=0)
        self._made: dict[float, NDArray[np.bool_]] = {}

    def of_side(self, cube: float) -> NDArray[np.bool_]:
        """Return which cubes of this side [m], counted from `low`, are inside."""
        if cube not in self._made:
            self._made[cube] = solid_cubes(self.mesh, self.low, cube)
        return self._made[cube]

    def fit(self, garment: TriangleMesh, coarser: float = 1.0) -> VoxelFit:
        """Return the fit of a garment [m] on it, in cubes so many times as large."""
        return VoxelFit(garment, self, coarser * self.cube, self._penalty)


class VoxelFit:
    """A body and a garment as cubes.

    Args:
        garment: Where it stands [m].
        body: To be worn by.
        cube: Side of the cubes [m].
        penalty: Weight of cloth inside the body against body inside the garment.
    """

    def __init__(self, garment: TriangleMesh, body: BodyCubes, cube: float, penalty: float) -> None:
        self._cube = cube
        self._body_low, self._body = body.low, body.of_side(cube)
        # garment cubes lie on the body's lattice, so that the shifts found include "none"
        low = garment.vertices.min(axis=0)
        self._low = self._body_low + np.floor((low - self._body_low) / cube) * cube
        inside = solid_cubes(close_openings(garment), self._low, cube)
        cloth = np.zeros_like(inside)
        points = np.vstack([garment.vertices, garment.vertices[garment.faces].mean(axis=1)])
        cloth[tuple(((points - self._low) / cube).astype(np.int64).T)] = True
        self._worth = (inside & ~cloth).astype(np.float64) - penalty * cloth
        self._whole = max(int((inside | cloth).sum()), 1)

    def best_placement(self, turn: FloatArray) -> VoxelPlacement:
        """Return the best place of the garment after a quarter turn."""
        return self.best_placements(turn, 1)[0]

    def best_placements(
        self, turn: FloatArray, count: int, near: FloatArray | None = None, within: tuple[float, ...] = ()
    ) -> list[VoxelPlacement]:
        """Return the best places of the garment after a quarter turn, best first, each at another height.

        Args:
            turn: The rotation about the origin, shape (3, 3).
            count: How many at most.
            near: The shift about which to look [m], shape (3,); None: everywhere.
            within: How far from it along each axis [m].
        """
        worth, low = self._turned(turn)
        size = [next_fast_len(int(a + b)) for a, b in zip(self._body.shape, worth.shape, strict=True)]
        score = irfftn(rfftn(self._body.astype(np.float64), size) * np.conj(rfftn(worth, size)), size)
        counts = [(np.arange(n) + n - b) % n - n + b for n, b in zip(size, self._body.shape, strict=True)]
        shifts = [self._body_low[k] + counts[k] * self._cube - low[k] for k in range(3)]
        stay: IntArray = np.round((low - self._body_low) / self._cube).astype(np.int64)
        overlaps = ((stay < np.array(self._body.shape)) & (stay > -np.array(worth.shape))).all()
        here = float(score[tuple(stay % np.array(size))]) if overlaps else 0.0
        open_to = np.round(score, 6)
        if near is not None:
            for k, axis in enumerate(np.ix_(*shifts)):
                far = np.abs(axis - near[k]) > within[k] + 0.5 * self._cube
                open_to = np.where(far, -np.inf, open_to)
        found: list[VoxelPlacement] = []
        while len(found) < count and np.isfinite(open_to).any():
            best = np.unravel_index(int(np.argmax(open_to)), score.shape)
            shift = np.array([shifts[k][best[k]] for k in range(3)])
            found.append(VoxelPlacement(turn, shift, float(score[best] / self._whole), here / self._whole))
            open_to[:, np.abs(shifts[1] - shift[1]) < _ANOTHER, :] = -np.inf
        return found

    def _turned(self, turn: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the garment's cubes after a quarter turn, and their lowest corner [m]."""
        axes = np.abs(turn).argmax(axis=1)
        back = tuple(axis for axis in range(3) if turn[axis].sum() < 0.0)
        ends = np.stack([self._low, self._low + self._cube * np.array(self._worth.shape)]) @ turn.T
        return np.flip(self._worth.transpose(axes), back), ends.min(axis=0)
