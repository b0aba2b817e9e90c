"""The render mesh: the garment in full detail after the drape, and the body that wears it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pydantic import Field

from vto_pipeline.geometry.remeshing.decimate import decimate
from vto_pipeline.geometry.remeshing.seams import cut_open
from vto_pipeline.geometry.riding.midpoints import split_in_four
from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import GlbPart
from vto_pipeline.model.settings import Config
from vto_pipeline.model.texture import TexturedMesh
from vto_pipeline.numerics.srgb import decode_srgb
from vto_pipeline.render.tint import SKIN
from vto_pipeline.render.transfer import apply, bind

BODY = "body"
"""Name of the part that wears the others."""


class DressConfig(Config):
    """Settings of the render mesh."""

    max_triangles: int = Field(
        130_000, ge=1_000, le=5_000_000, description="Most triangles, for web viewers; a finer scan is thinned out"
    )
    body: bool = Field(True, description="Whether the body is a part of it")


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
        shown = as_fine_as(garment.mesh, sim_mesh, config.max_triangles)
        moved = replace(shown, vertices=apply(bind(shown, sim_mesh), draped.vertices))
        job.measure(triangles=len(moved.faces))
        return [cut_open("garment", moved, garment.picture)]
    if len(garment.faces) <= config.max_triangles:
        job.leave_out("thinning out", f"{len(garment.faces)} triangles, {config.max_triangles} are allowed")
    detailed = as_fine_as(decimate(garment, config.max_triangles), sim_mesh, config.max_triangles)
    moved = replace(detailed, vertices=apply(bind(detailed, sim_mesh), draped.vertices))
    job.measure(triangles=len(moved.faces))
    if moved.texture is not None:
        return [cut_open("garment", moved, None)]
    return [GlbPart("garment", moved, normals=vertex_normals(moved))]


def as_fine_as(garment: TriangleMesh, sim_mesh: TriangleMesh, most: int) -> TriangleMesh:
    """Return a garment with its triangles split in four until they are about as many as those that were simulated.

    Else it would hide folds that the simulation has: its triangles cannot bend.

    Args:
        garment: To be shown [m].
        sim_mesh: What moves it [m].
        most: Triangles it may have.
    """
    while 2 * len(garment.faces) <= len(sim_mesh.faces) and 4 * len(garment.faces) <= most:
        garment = split_in_four(garment)
    return garment


def body_part(body: TriangleMesh, config: DressConfig) -> GlbPart:
    """Return the body as a part of its own, in its own colours or that of skin.

    Args:
        body: As it stands under the draped garment [m].
        config: Settings.
    """
    if body.colors is not None:
        return GlbPart(BODY, body, normals=vertex_normals(body), roughness=0.6, double_sided=False)
    shape = decimate(TriangleMesh(body.vertices, body.faces), config.max_triangles)
    red, green, blue = (float(value) for value in decode_srgb(np.array(SKIN, dtype=np.uint8)))
    normals = vertex_normals(shape)
    return GlbPart(BODY, shape, normals=normals, base_color=(red, green, blue, 1.0), roughness=0.6, double_sided=False)
