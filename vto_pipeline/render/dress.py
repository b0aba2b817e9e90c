"""The render mesh: the garment in full detail, after the drape."""

from __future__ import annotations

from dataclasses import replace

from pydantic import Field

from vto_pipeline.geometry.remeshing.decimate import decimate
from vto_pipeline.geometry.remeshing.seams import cut_open
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
        One part, "garment", with normals and the picture, or else the scan's colours; texture coordinates stay.
    """
    if isinstance(garment, TexturedMesh):
        job.leave_out("thinning out", "the picture lies on these triangles; texture.max_triangles bounds them")
        moved = replace(garment.mesh, vertices=apply(bind(garment.mesh, sim_mesh), draped.vertices))
        job.measure(triangles=len(moved.faces))
        return [cut_open("garment", moved, garment.picture)]
    if len(garment.faces) <= config.max_triangles:
        job.leave_out("thinning out", f"{len(garment.faces)} triangles, {config.max_triangles} are allowed")
    detailed = decimate(garment, config.max_triangles)
    moved = replace(detailed, vertices=apply(bind(detailed, sim_mesh), draped.vertices))
    job.measure(triangles=len(moved.faces))
    if moved.texture is not None:
        return [cut_open("garment", moved, None)]
    return [GlbPart("garment", moved, normals=vertex_normals(moved))]
