"""Independent computation of the energy and the residual force of a cloth.

Energies are the formulas of the model, in plain arrays. Forces are differences of those energies, so no derivative of
the solver's is trusted. What a body can bear is taken from distances to its surface.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import diags_array

from vto_pipeline.cloth.judge.bearing import residual_after_all_surfaces, residual_after_one_surface
from vto_pipeline.cloth.judge.curvature import curvature_stiffness
from vto_pipeline.cloth.judge.flanks import flanks
from vto_pipeline.cloth.judge.strain import RestTriangles, gradients, rest_triangles, warp_weft_strains
from vto_pipeline.cloth.model.materials import Materials
from vto_pipeline.geometry.signed_distance import SurfacePoints
from vto_pipeline.geometry.topology import hinge_halves, hinges
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.units import GRAVITY

_STEP = 1e-6  # of an edge: central differences are then right to about 1e-10
_MUCH = 1e-6  # of a vertex's weight: less is not shared out among flanks
_ALIKE = 1e-3  # between directions: less is one flank
_SLIVER = 0.01  # height over longest side of a triangle that counts as that high at least, and does not bend


def covers_all_energies(materials: Materials) -> bool:
    """Return whether the energies of `ElasticEnergies` are all that this model of cloth has."""
    extra = (materials.strain_limit, materials.yield_curvature)
    plain = extra == (None, None) and not materials.hysteresis
    return plain and materials.membrane == "threads" and materials.bending in ("shape_operator", "hinge")


class ElasticEnergies:
    """A cloth of the model "threads", and its energies.

    Args:
        mesh: Its triangles.
        rest: Its shape without forces.
        fabric: Its stiffnesses and mass.
        bending: "shape_operator" or "hinge".

    Attributes:
        hinges: Ends and wings of those that bend, shape (H, 4).
        coupling: M [N·m] of the energy of bending ½ θᵀ M θ, θ being their angles less those at rest, shape (H, H).
    """

    def __init__(self, mesh: TriangleMesh, rest: RestShape, fabric: Fabric, bending: str = "shape_operator") -> None:
        laid = rest.corners(mesh.faces)
        self._rest: RestTriangles = rest_triangles(laid)
        self._faces = mesh.faces[self._rest.solid]
        self._weight = self._rest.area * np.minimum(1.0, _slenderness(laid[self._rest.solid]) / _SLIVER)
        self._stiffness = _plane_stiffness(fabric)
        bends = self._rest.solid & (_slenderness(laid) > _SLIVER)
        if bending == "hinge":
            self.hinges, rigidity = _bending(mesh, laid, bends, fabric)
            self.coupling = diags_array(rigidity).tocsr()
        else:
            self.hinges = hinges(mesh)
            self.coupling = curvature_stiffness(mesh, laid, bends, fabric)
        self._angles = _angles(rest.positions[self.hinges]) if rest.rest_angles else np.zeros(len(self.hinges))
        area = np.zeros(len(mesh.faces))
        area[self._rest.solid] = self._rest.area
        self.mass = np.bincount(mesh.faces.ravel(), np.repeat(fabric.areal_density * area / 3.0, 3), len(mesh.vertices))
        self._step = _STEP * float(np.median(np.sqrt(2.0 * self._rest.area)))

    def energy(self, positions: FloatArray) -> float:
        """Return the energy stored at these positions [m], shape (V, 3) [J]."""
        bent = _angles(positions[self.hinges]) - self._angles
        return float(self._membrane(positions[self._faces]).sum() + 0.5 * bent @ (self.coupling @ bent))

    def moments(self, positions: FloatArray) -> FloatArray:
        """Return the moment that closes each hinge at these positions [m], shape (V, 3) [N·m], shape (H,)."""
        return np.asarray(self.coupling @ (_angles(positions[self.hinges]) - self._angles))

    def forces(self, positions: FloatArray) -> FloatArray:
        """Return the elastic forces on the vertices [N], shape (V, 3)."""
        found = np.zeros_like(positions)
        self._pull(positions[self._faces], self._faces, self._membrane, np.ones(1), found)
        self._pull(positions[self.hinges], self.hinges, _angles, self.moments(positions), found)
        return found

    def _pull(
        self,
        corners: FloatArray,
        stencils: NDArray[np.int32],
        value: Callable[[FloatArray], FloatArray],
        factor: FloatArray,
        forces: FloatArray,
    ) -> None:
        """Subtract from the forces what a factor times the slope of a value makes."""
        for k in range(stencils.shape[1]):
            for d in range(3):
                moved = corners.copy()
                moved[:, k, d] += self._step
                ahead = value(moved)
                moved[:, k, d] -= 2.0 * self._step
                pull = factor * (value(moved) - ahead) / (2.0 * self._step)
                forces[:, d] += np.bincount(stencils[:, k], pull, len(forces))

    def _membrane(self, corners: FloatArray) -> FloatArray:
        local = np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)
        laid = RestTriangles(np.ones(len(corners), np.bool_), self._rest.area, self._rest.inverse)
        strain = warp_weft_strains(gradients(corners.reshape(-1, 3), local, laid))
        return 0.5 * self._weight * np.einsum("ta,ab,tb->t", strain, self._stiffness, strain)


def judged_residual(
    weave: ElasticEnergies,
    positions: FloatArray,
    body: TriangleMesh | None,
    nearest: SurfacePoints | None,
    *,
    friction: float,
    touching: FloatArray,
    free: NDArray[np.bool_],
) -> float:
    """Return the residual force as a share of weight: the acceleration left over, rms over the free mass, in g.

    A vertex near one place of the body is borne as what slides there; in a hollow, the flanks share what they can.

    Args:
        weave: The cloth.
        positions: [m], shape (V, 3).
        body: What it lies on.
        nearest: The places of the body that are nearest to the vertices, with signed distances.
        friction: Coulomb coefficient.
        touching: Distance at which each vertex may be borne by the body [m], shape (V,).
        free: Which vertices to look at, all of them with mass, shape (V,).
    """
    left = weave.forces(positions)
    left[:, 1] -= GRAVITY * weave.mass
    if not free.any():
        return 0.0
    if body is not None and nearest is not None:
        inside = nearest.distance < 0.0
        held = free & (nearest.distance < touching)
        outward = (positions - nearest.point) * np.where(inside, -1.0, 1.0)[:, None]
        outward /= np.maximum(np.abs(nearest.distance), np.finfo(float).tiny)[:, None]
        forces = left.copy()
        left[held] = residual_after_one_surface(forces[held], outward[held], friction)
        much = np.linalg.norm(left, axis=1) > _MUCH * GRAVITY * weave.mass
        (between,) = np.nonzero(held & much)  # two flanks, perhaps
        owner, pushes = flanks(body, positions[between], inside[between], touching[between])
        first = np.searchsorted(owner, np.arange(len(between) + 1))
        for i, start, end in zip(between, first[:-1], first[1:], strict=True):
            if end - start > 1 and np.ptp(pushes[start:end], axis=0).max() > _ALIKE:
                left[i] = residual_after_all_surfaces(forces[i], pushes[start:end], friction)
    share = np.linalg.norm(left[free], axis=1) / (GRAVITY * weave.mass[free])
    return float(np.sqrt(np.average(share**2, weights=weave.mass[free])))


def _plane_stiffness(fabric: Fabric) -> FloatArray:
    """Return the stiffness of an orthotropic sheet in plane stress [N/m], shape (3, 3): warp, weft, shear."""
    coupling = -fabric.poisson / fabric.stretch_warp
    plane = np.array([[1.0 / fabric.stretch_warp, coupling], [coupling, 1.0 / fabric.stretch_weft]])
    stiffness = np.zeros((3, 3))
    stiffness[:2, :2] = np.linalg.inv(plane)
    stiffness[2, 2] = fabric.shear
    return stiffness


def _bending(
    mesh: TriangleMesh, laid: FloatArray, bends: NDArray[np.bool_], fabric: Fabric
) -> tuple[NDArray[np.int32], FloatArray]:
    """Return the hinges between faces that bend, shape (H, 4), and B l²/A of each [N·m], shape (H,).

    Args:
        mesh: The cloth.
        laid: Corners of its faces, laid flat [m], shape (F, 3, 3).
        bends: Which faces do, shape (F,).
        fabric: Bending rigidities.
    """
    found, half = hinges(mesh), hinge_halves(mesh)
    both = bends[half // 3].all(axis=1)
    found, half = found[both], half[both]
    one, two = (_turned(laid, half[:, k]) for k in (0, 1))
    first = rest_triangles(one)
    warp = np.linalg.inv(first.inverse)[:, 0]  # of the two edges that meet in the third corner
    along = (warp[:, 1] - warp[:, 0]) ** 2 / np.sum((one[:, 1] - one[:, 0]) ** 2, axis=1)
    area = first.area + rest_triangles(two).area
    rigidity = fabric.bending_warp * (1.0 - along) + fabric.bending_weft * along
    length_sq = 0.5 * sum(np.sum((corners[:, 1] - corners[:, 0]) ** 2, axis=1) for corners in (one, two))
    return found, rigidity * length_sq / area


def _turned(corners: FloatArray, half: NDArray[np.int32]) -> FloatArray:
    """Return the faces of these half-edges (N,) from that edge on, shape (N, 3, 3)."""
    face, first = np.divmod(half, 3)
    return np.asarray(corners[face[:, None], (first[:, None] + np.arange(3)) % 3])


def _angles(corners: FloatArray) -> FloatArray:
    """Return the angle of each hinge [rad], shape (H,); ends and wings of shape (H, 4, 3)."""
    edge = corners[:, 1] - corners[:, 0]
    edge = edge / np.maximum(np.linalg.norm(edge, axis=1, keepdims=True), np.finfo(float).tiny)
    one = np.cross(edge, corners[:, 2] - corners[:, 0])
    two = np.cross(corners[:, 3] - corners[:, 0], edge)
    return np.arctan2(np.sum(np.cross(one, two) * edge, axis=1), np.sum(one * two, axis=1))


def _slenderness(corners: FloatArray) -> FloatArray:
    sides = np.roll(corners, -1, axis=1) - corners
    longest_sq = np.sum(sides**2, axis=2).max(axis=1, initial=0.0)
    double_area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    return np.divide(double_area, longest_sq, out=np.zeros(len(corners)), where=longest_sq > 0.0)
