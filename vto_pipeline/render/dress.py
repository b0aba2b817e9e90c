"""The render mesh: the garment in full detail, after the drape."""

from __future__ import annotations

from dataclasses import replace

from pydantic import Field

from vto_pipeline.geometry.remeshing.decimate import decimate
from vto_pipeline.geometry.remeshing.seams import textured_part
from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import GlbPart
from vto_pipeline.model.settings import Config
from vto_pipeline.model.texture import TexturedMesh
from vto_pipeline.render.transfer import apply, bind


class DressConfig(Config):
    """Settings of the render mesh."""

    max_triangles: int = Field(
        130_000, ge=1_000, le=5_000_000, description="Most triangles, for web viewers; a finer scan is thinned out"
    )


def deform_render_mesh(
    garment: TriangleMesh | TexturedMesh, sim_mesh: TriangleMesh, draped: TriangleMesh, config: DressConfig, job: Job
) -> list[GlbPart]:
    """Move the detailed garment as the simulation mesh has moved.

    Args:
        garment: Detailed mesh as scanned [m]; with a picture on it, it keeps its triangles.
        sim_mesh: Simulation mesh as scanned [m].
        draped: The same mesh on the body [m].
        config: Settings.
        job: Takes figures and what was left out.

    Returns:
        One part, "garment", with normals and the scan's picture, or else its colours.
    """
    if isinstance(garment, TexturedMesh):
        job.leave_out("thinning out", "the picture lies on these triangles; texture.max_triangles bounds them")
        moved = apply(bind(garment.mesh, sim_mesh), draped.vertices)
        job.measure(triangles=len(garment.mesh.faces))
        return [textured_part("garment", replace(garment, mesh=replace(garment.mesh, vertices=moved)))]
    if len(garment.faces) <= config.max_triangles:
        job.leave_out("thinning out", f"{len(garment.faces)} triangles, {config.max_triangles} are allowed")
    detailed = decimate(garment, config.max_triangles)
    binding = bind(detailed, sim_mesh)
    mesh = TriangleMesh(apply(binding, draped.vertices), detailed.faces, detailed.colors)
    job.measure(triangles=len(mesh.faces))
    return [GlbPart("garment", mesh, normals=vertex_normals(mesh))]
