"""Which share of the cloth is drawn or sheared farther than its fabric is known to bear."""

from __future__ import annotations

import numpy as np

from vto_pipeline.cloth.judge.strain import cloth_triangles, gradients, warp_weft_strains
from vto_pipeline.cloth.judge.too_small import PULLED_SHARE
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh


def fabric_limits(fabric: Fabric) -> dict[str, float | None]:
    """Return what warp, weft [share] and shear [rad] are known to bear; None where that is not known."""
    return {"warp": fabric.elongation_warp, "weft": fabric.elongation_weft, "shear": fabric.shear_angle}


def beyond_limits(strain: FloatArray, area: FloatArray, fabric: Fabric) -> dict[str, float | None]:
    """Return the share of the cloth that is beyond what its fabric is known to bear.

    Args:
        strain: Of `strain.warp_weft_strains`, shape (T, 3).
        area: At rest [m²], shape (T,).
        fabric: What it is made of.

    Returns:
        Share of the area for "warp", "weft" and "shear"; None where the limit is not known.
    """
    size = np.column_stack([strain[:, :2], np.abs(strain[:, 2])])
    return {
        name: None if limit is None else float(area[size[:, column] > limit].sum() / area.sum())
        for column, (name, limit) in enumerate(fabric_limits(fabric).items())
    }


def warn_beyond_limits(draped: TriangleMesh, rest: RestShape, fabric: Fabric, job: Job) -> dict[str, object]:
    """Warn if a large share of the cloth is beyond what its fabric is known to bear, and return the figures.

    Args:
        draped: The garment on the body [m].
        rest: Its rest shape.
        fabric: What it is made of.
        job: Warned, or told that nothing is known.

    Returns:
        fabric_limits (warp and weft as shares, shear in radians) and beyond_limits (shares of the area), each for
        warp, weft and shear; None where the limit is not known.
    """
    laid = cloth_triangles(rest.corners(draped.faces))
    strain = warp_weft_strains(gradients(draped.vertices, draped.faces, laid))
    limits, beyond = fabric_limits(fabric), beyond_limits(strain, laid.area, fabric)
    tell_beyond(limits, beyond, fabric.name, job)
    return {"fabric_limits": limits, "beyond_limits": beyond}


def tell_beyond(
    limits: dict[str, float | None], beyond: dict[str, float | None], name: str, job: Job, when: str = ""
) -> None:
    """Warn of each limit that more than a pull at a seam is beyond; note it where no limit of a thread is known.

    Args:
        limits: Of `fabric_limits`.
        beyond: Of `beyond_limits`.
        name: Of the fabric.
        job: Warned.
        when: Said at the end, such as " in a frame".
    """
    if limits["warp"] is None and limits["weft"] is None:
        job.note(f"{name}: how far its threads may be stretched is not known, so nothing is judged by it")
    for thread, share in beyond.items():
        if share is not None and share > PULLED_SHARE:
            limit = limits[thread] or 0.0
            told = f"{np.degrees(limit):.0f} degrees" if thread == "shear" else f"{limit:.1%}"
            job.warn(f"beyond what {name} is known to bear, {told} of {thread}: {share:.0%} of the cloth{when}")
