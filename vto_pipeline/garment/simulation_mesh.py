"""From the scanned garment to the mesh that is simulated."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from vto_pipeline.geometry.remesh import RemeshConfig, edge_lengths, remesh
from vto_pipeline.geometry.repair import RepairConfig, is_manifold, repair
from vto_pipeline.geometry.topology import face_components
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config


class SimulationMeshConfig(Config):
    """How fine the simulation mesh is."""

    edge_mm: float = Field(10.0, ge=2, le=100, description="wanted edge length [mm]")
    tolerance: float = Field(
        0.2, ge=0, le=1, description="a mesh whose median edge is off by less may be used as it is"
    )
    least_angle_deg: float = Field(20.0, ge=0, le=60, description="a mesh with sharper triangles is remeshed [degree]")


def remesh_for_simulation(garment: TriangleMesh, config: SimulationMeshConfig, job: Job) -> TriangleMesh:
    """Return the garment in near-equilateral triangles of the wanted size, openings kept.

    Raises:
        GarmentError: remeshing lost an opening or a piece.
    """
    reason = good_enough(garment, config)
    if reason and not job.force_all:
        job.leave_out("remeshing", reason)
        return garment
    mended = garment if is_manifold(garment) else repair(garment, RepairConfig(), job)
    return remesh(mended, RemeshConfig(edge_mm=config.edge_mm), job)


def good_enough(mesh: TriangleMesh, config: SimulationMeshConfig) -> str | None:
    """Return why a mesh can be simulated as it is, or None."""
    if not is_manifold(mesh) or face_components(mesh)[0] != 1:
        return None
    median = float(np.median(edge_lengths(mesh))) * 1e3
    if abs(median / config.edge_mm - 1.0) > config.tolerance:
        return None
    sharpest = float(np.rad2deg(least_angles(mesh).min()))
    if sharpest < config.least_angle_deg:
        return None
    return f"edges are {median:.1f} mm at the median and no angle is below {sharpest:.0f}°: used as it is"


def least_angles(mesh: TriangleMesh) -> np.ndarray:
    """Return the least angle of each face [rad], shape (F,); zero for a face without area."""
    corners = mesh.vertices[mesh.faces]
    side = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    a, b, c = np.sort(side, axis=1).T  # the least angle lies opposite the shortest side
    cosine = (b**2 + c**2 - a**2) / np.maximum(2.0 * b * c, 1e-30)
    return np.where(b > 0.0, np.arccos(np.clip(cosine, -1.0, 1.0)), 0.0)
