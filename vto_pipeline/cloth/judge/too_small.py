"""Whether a garment is too small for the body it is on."""

from __future__ import annotations

from vto_pipeline.cloth.judge.strain import cloth_triangles, gradients, principal_strains
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

PULLED_SHARE = 0.02
"""Of the area beyond a limit: less is a pull at a seam or a point of the body."""


def warn_if_too_small(draped: TriangleMesh, rest: RestShape, limit: float, job: Job) -> dict[str, object]:
    """Warn if a large share of the cloth is overstretched, and return the figures.

    Args:
        draped: The garment on the body [m].
        rest: Its rest shape.
        limit: Stretch beyond rest [share].
        job: Warned with the share and the place.

    Returns:
        stretch_limit, over_limit_share (of the area), too_small.
    """
    laid = cloth_triangles(rest.corners(draped.faces))
    strain = principal_strains(gradients(draped.vertices, draped.faces, laid)).max(axis=1)
    over = strain > limit
    share = float(laid.area[over].sum() / laid.area.sum())
    too_small = share > PULLED_SHARE
    if too_small:
        worst = draped.vertices[draped.faces[laid.solid][strain.argmax()]].mean(axis=0)
        job.warn(
            f"too small: {share:.0%} of the cloth is stretched beyond {limit:.0%}, by up to {strain.max():.0%} near "
            f"({worst[0]:.2f}, {worst[1]:.2f}, {worst[2]:.2f})"
        )
    return {"stretch_limit": limit, "over_limit_share": share, "too_small": too_small}
