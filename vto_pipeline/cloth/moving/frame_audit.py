"""What each frame of a garment in motion is judged by, with code that shares nothing with the solver's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vto_pipeline.cloth.dynamics.residual import elastic_energy
from vto_pipeline.cloth.judge.crossings import crossings_between, self_crossings
from vto_pipeline.cloth.judge.limits import beyond_limits
from vto_pipeline.cloth.judge.strain import RestTriangles, gradients, warp_weft_strains
from vto_pipeline.cloth.model.build import ClothModel, ClothState
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import laid_edge_lengths
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.mesh import TriangleMesh


@dataclass(frozen=True)
class FrameAudit:
    """How one frame came out.

    Args:
        time_s: When it is [s].
        body_crossings: Pairs of triangles of cloth and body that meet.
        self_crossings: Pairs of triangles of the cloth that meet.
        own_crossings: Pairs of triangles of the body itself that meet as it is posed.
        yields_mm: How far its skin has then sunk, where it has most [mm]; cloth is held against the sunken skin.
        penetration_mm: Of the deepest vertex in the body [mm], 0 where none is inside.
        max_stretch: Of the edge that is stretched most, beyond rest [share]. Edges on the bias of a weave also grow
            where it shears, which stretches no thread.
        max_thread_stretch: Of the warp or weft that is stretched most, beyond rest [share].
        p99_thread_stretch: What the more stretched of warp and weft stays below on 99 % of the cloth [share].
        max_shear_deg: Largest angle by which warp and weft are sheared [degrees].
        beyond_limits: Share of the cloth whose warp, weft or shear is beyond what the fabric is known to bear; None
            where that is not known.
        elastic_j, kinetic_j: Energy [J].
        steps: Of the solver, in the attempt that was kept.
        attempts: How often the frame was tried.
        seconds: Wall time [s].
        cpu_seconds: Processor time, which other work on the machine does not raise as much [s].
    """

    time_s: float
    body_crossings: int
    self_crossings: int
    own_crossings: int
    yields_mm: float
    penetration_mm: float
    max_stretch: float
    max_thread_stretch: float
    p99_thread_stretch: float
    max_shear_deg: float
    beyond_limits: dict[str, float | None]
    elastic_j: float
    kinetic_j: float
    steps: int
    attempts: int
    seconds: float
    cpu_seconds: float


def stretch_of_edges(mesh: TriangleMesh, natural: FloatArray) -> FloatArray:
    """Return the stretch of each edge beyond rest [share], shape (E,), where `natural` is its length there [m]."""
    length = laid_edge_lengths(mesh, mesh.vertices[mesh.faces])
    return np.asarray(np.divide(length, natural, out=np.ones_like(length), where=natural > 0.0) - 1.0)


def largest_strains(strain: FloatArray, area: FloatArray) -> tuple[float, float, float]:
    """Return the largest stretch of a thread, what 99 % of the cloth stays below, and the largest shear [degrees].

    Args:
        strain: Of `strain.warp_weft_strains`, shape (T, 3).
        area: At rest [m²], shape (T,).
    """
    most = strain[:, :2].max(axis=1)
    below = np.quantile(most, 0.99, weights=area, method="inverted_cdf")
    return max(0.0, float(most.max())), max(0.0, float(below)), float(np.degrees(np.abs(strain[:, 2]).max()))


def audit_frame(
    model: ClothModel,
    natural: FloatArray,
    laid: RestTriangles,
    fabric: Fabric,
    state: ClothState,
    body: TriangleMesh,
    *,
    own_crossings: int,
    yields: float,
    steps: int,
    attempts: int,
    seconds: float,
    cpu_seconds: float,
) -> FrameAudit:
    """Return how a frame came out.

    Args:
        model: The cloth.
        natural: Lengths of its edges without forces [m], shape (E,).
        laid: Its triangles without forces.
        fabric: What it is made of.
        state: Where it is.
        body: Where that is.
        own_crossings: Of the body as it is posed.
        yields: How far its skin has sunk [m].
        steps, attempts, seconds, cpu_seconds: What it took.
    """
    mesh = TriangleMesh(state.positions, model.faces)
    strain = warp_weft_strains(gradients(mesh.vertices, mesh.faces, laid))
    thread, below, shear = largest_strains(strain, laid.area)
    nearest = float(SurfaceDistance(body).signed(mesh.vertices).distance.min())
    return FrameAudit(
        time_s=state.time,
        body_crossings=len(crossings_between(mesh, body)),
        self_crossings=len(self_crossings(mesh)),
        own_crossings=own_crossings,
        yields_mm=1e3 * yields,
        penetration_mm=1e3 * max(0.0, -nearest),
        max_stretch=float(stretch_of_edges(mesh, natural).max(initial=0.0)),
        max_thread_stretch=thread,
        p99_thread_stretch=below,
        max_shear_deg=shear,
        beyond_limits=beyond_limits(strain, laid.area, fabric),
        elastic_j=elastic_energy(model, state.positions),
        kinetic_j=float(0.5 * np.einsum("i,ij,ij->", model.mass, state.velocities, state.velocities)),
        steps=steps,
        attempts=attempts,
        seconds=seconds,
        cpu_seconds=cpu_seconds,
    )
