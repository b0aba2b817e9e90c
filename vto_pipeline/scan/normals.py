"""Normals of an unorganised cloud that all point out of the object."""

from __future__ import annotations

import numpy as np

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud


def oriented_normals(cloud: PointCloud, neighbours: int, job: Job) -> FloatArray:
    """The cloud's own normals, or normals of local planes with signs spread along a spanning tree.

    Hoppe et al. 1992. The sign of the whole is the one that points away from the cloud's vertical axis.

    Args:
        cloud: Points [m].
        neighbours: Points a plane is fitted to.
        job: Told how sure the sign is.

    Returns:
        Unit normals, shape (N, 3).
    """
    if cloud.normals is not None:
        return cloud.normals
    import open3d as o3d

    given = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.array(cloud.points)))
    given.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(neighbours))
    given.orient_normals_consistent_tangent_plane(neighbours)
    normals = np.array(given.normals)
    outwards = cloud.points - np.median(cloud.points, axis=0)
    outwards[:, 1] = 0.0
    agree = (normals * outwards).sum(1)
    share = float(np.abs(agree[agree > 0]).sum() / max(np.abs(agree).sum(), 1e-12))
    job.measure(normals_outward_share=round(max(share, 1 - share), 3))
    if max(share, 1 - share) < 0.7:
        job.warn(f"inside and outside are hard to tell: {100 * max(share, 1 - share):.0f} % of the normals agree")
    return normals if share >= 0.5 else -normals
