"""What the garment would be without forces."""

from __future__ import annotations

from pydantic import Field

from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config


class RestShapeConfig(Config):
    """How the rest shape is found."""

    mode: str = Field("as_scanned", pattern="^as_scanned$", description="as_scanned: lengths and areas as they are")
    rest_angles: bool = Field(False, description="Keep the scan's folds as creases; else the cloth is flat at rest")


def rest_shape(mesh: TriangleMesh, config: RestShapeConfig, job: Job) -> RestShape:
    """Return the rest shape of a garment.

    Taken as scanned, a garment that hung on a form sags a second time by as much as its weight had stretched it.

    Args:
        mesh: Simulation mesh, where it was scanned [m].
        config: The mode.
        job: Told what was assumed.
    """
    job.note("rest shape taken as scanned: the stretch under its own weight stays in it")
    return RestShape(mesh.vertices, config.rest_angles, config.mode)
