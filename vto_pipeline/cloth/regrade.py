"""The two questions a drape answers: does this very garment fit, or how would it look made in the customer's size."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from vto_pipeline.cloth.reshape import reshape
from vto_pipeline.errors import ConfigError
from vto_pipeline.geometry.topology import edges
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.garment import Garment, RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config


class GradeConfig(Config):
    """What is asked of a drape."""

    mode: Literal["same_garment", "regraded"] = Field(
        "same_garment",
        description="same_garment: does it fit; regraded: how would it look in this size (needs a source body)",
    )


def worn_rest(garment: Garment, body: MovingBody, config: GradeConfig, job: Job) -> RestShape:
    """Return the rest shape that is draped: the garment's own, or one in proportion to the body as it ends.

    Args:
        garment: On the body as it begins; its rest positions lie about that body too.
        body: From what the garment was on to the customer.
        config: Which of the two.
        job: Told which, and by how much lengths were changed.

    Raises:
        ConfigError: regraded, and what the garment was on is not known.
    """
    if config.mode == "same_garment":
        job.leave_out("regrading", "the question is whether this very garment fits")
        job.measure(mode=config.mode)
        return garment.rest
    if len(body.keyframes) == 1:
        raise ConfigError(
            "grade.mode is regraded: in proportion to the body that the garment was on, and none is given",
            hint="give --source-body (in a document: given.mannequin)",
        )
    rest = TriangleMesh(garment.rest.positions, garment.mesh.faces)
    positions = reshape(rest, TriangleMesh(body.keyframes[0], body.faces), body.final)
    ends = edges(rest)
    was, now = (np.linalg.norm(p[ends[:, 1]] - p[ends[:, 0]], axis=1) for p in (rest.vertices, positions))
    change = np.quantile(now[was > 0.0] / was[was > 0.0], (0.05, 0.5, 0.95)) - 1.0
    job.note(
        f"regraded: rest lengths changed by {change[1]:+.1%} (median), most by {change[0]:+.1%} to {change[2]:+.1%}"
    )
    job.measure(mode=config.mode, length_change_median_share=float(change[1]))
    return RestShape(positions, garment.rest.rest_angles, garment.rest.mode, regraded=True)
