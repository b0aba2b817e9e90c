"""Rest shape for the two questions of a drape: does this garment fit, or how would this size look."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from vto_pipeline.cloth.placement.transfer import transfer_deformation
from vto_pipeline.errors import ConfigError
from vto_pipeline.geometry.remeshing.flat_faces import stretch_flat_faces
from vto_pipeline.geometry.topology import edges
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.garment import Garment, RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config


class GradeConfig(Config):
    """Whether a drape shows the garment's own size or the customer's."""

    mode: Literal["same_garment", "regraded"] = Field(
        "same_garment",
        description="same_garment shows whether it fits; regraded, how this size looks (needs a source body)",
    )


def worn_rest(garment: Garment, body: MovingBody, config: GradeConfig, job: Job) -> RestShape:
    """Return the rest shape that is draped: the garment's own, or one in proportion to the final body.

    Args:
        garment: On the body as it begins; its rest positions lie about that body too.
        body: From the source body to the customer.
        config: Which of the two.
        job: Receives which, and by how much lengths were changed.

    Raises:
        ConfigError: regraded, and the source body is not known.
    """
    if config.mode == "same_garment":
        job.leave_out("regrading", "the garment is draped in its own size")
        job.measure(mode=config.mode)
        return garment.rest
    if len(body.keyframes) == 1:
        raise ConfigError(
            "grade.mode is regraded, which needs the body that the garment was scanned on; none is given",
            hint="give --source-body (in a document: given.mannequin)",
        )
    rest = TriangleMesh(garment.rest.positions, garment.mesh.faces)
    positions = transfer_deformation(rest, TriangleMesh(body.keyframes[0], body.faces), body.final)
    ends = edges(rest)
    was, now = (np.linalg.norm(p[ends[:, 1]] - p[ends[:, 0]], axis=1) for p in (rest.vertices, positions))
    change = np.quantile(now[was > 0.0] / was[was > 0.0], (0.05, 0.5, 0.95)) - 1.0
    job.note(
        f"regraded: rest lengths changed by {change[1]:+.1%} (median), most by {change[0]:+.1%} to {change[2]:+.1%}"
    )
    job.measure(mode=config.mode, length_change_median_share=float(change[1]))
    panels = None if garment.rest.panels is None else stretch_flat_faces(garment.rest.panels, rest, positions)
    return RestShape(positions, garment.rest.rest_angles, garment.rest.mode, regraded=True, panels=panels)
