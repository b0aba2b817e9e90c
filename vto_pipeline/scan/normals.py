"""Outward normals of an unorganised point cloud."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import cg
from scipy.spatial import cKDTree

from vto_pipeline.errors import ScanError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud

_VOTERS, _NEAR_VOTERS = 50_000, 8
"""Points of a larger cloud that vote, and how many of those near it each of the others follows."""

_CLOSE, _STEPS = 1e-4, 20_000
"""Relative residual of the votes' solution, of which only signs are used, and the most steps it may take."""


def oriented_normals(cloud: PointCloud, neighbours: int, job: Job) -> FloatArray:
    """The cloud's own normals, or normals of local planes with the signs that most pairs of neighbours agree on.

    Signs spread along a tree (Hoppe et al. 1992) turn half a body inside out where a single pair is wrong, as where
    thighs nearly touch; here all pairs vote. The sign of the whole is the one that points away from the cloud's
    vertical axis.

    Args:
        cloud: Points [m].
        neighbours: Points a plane is fitted to.
        job: Receives how sure the sign is.

    Returns:
        Unit normals, shape (N, 3).
    """
    if cloud.normals is not None:
        return cloud.normals
    import open3d as o3d

    given = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.array(cloud.points)))
    given.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(neighbours))
    normals = np.array(given.normals)
    outwards = cloud.points - np.median(cloud.points, axis=0)
    outwards[:, 1] = 0.0
    agree = (normals * outwards).sum(1)
    voters = np.arange(len(normals))
    if len(voters) > _VOTERS:
        voters = np.sort(np.random.default_rng(job.seed).choice(voters, _VOTERS, replace=False))
    votes = _voted(cloud.points[voters], normals[voters], agree[voters], neighbours)
    normals[voters] *= np.where(votes < 0.0, -1.0, 1.0)[:, None]
    if len(voters) < len(normals):
        column = cKDTree(cloud.points[voters]).query(cloud.points, k=_NEAR_VOTERS)[1]
        row = np.repeat(np.arange(len(normals)), _NEAR_VOTERS)
        votes = _agreement(cloud.points, normals, row, voters[column.ravel()]).reshape(-1, _NEAR_VOTERS).sum(axis=1)
        votes[voters] = 1.0
        normals *= np.where(votes < 0.0, -1.0, 1.0)[:, None]
    agree = (normals * outwards).sum(1)
    share = float(agree[agree > 0].sum() / max(np.abs(agree).sum(), 1e-12))
    job.measure(normals_outward_share=round(share, 3))
    if share < 0.7:
        job.warn(f"inside and outside are hard to tell apart: {100 * share:.0f} % of the normals agree")
    return normals


def _voted(points: FloatArray, normals: FloatArray, agree: FloatArray, neighbours: int) -> FloatArray:
    """Return a number whose sign says how to turn each normal, shape (N,).

    It minimises the sum of |w| (x - sgn(w) y)^2 over pairs of neighbours: the smallest eigenvectors of a signed graph's
    Laplacian (Kunegis et al. 2010), of which the right side picks those that point outwards.

    Args:
        points: [m], shape (N, 3).
        normals: Unit, of any sign, shape (N, 3).
        agree: How far each points outwards [m], shape (N,).
        neighbours: Of each point.
    """
    count = len(points)
    neighbours = min(neighbours, count - 1)
    near = cKDTree(points).query(points, k=neighbours + 1)[1]
    row, column = np.repeat(np.arange(count), neighbours), near[:, 1:].ravel()
    pairs = csr_matrix((_agreement(points, normals, row, column), (row, column)), (count, count))
    pairs = pairs + pairs.T
    root = np.sqrt(np.asarray(abs(pairs).sum(axis=1)).ravel())
    scale = diags(1.0 / np.maximum(root, 1e-9))
    # a vote fades over as many steps to a neighbour as lead from one side of the cloud to the other
    hold = neighbours / (2 * np.pi * count)
    system = (1.0 + hold) * diags(np.ones(count)) - scale @ pairs @ scale
    solved, left = cg(system, root * agree, rtol=_CLOSE, maxiter=_STEPS)
    if left:
        raise ScanError("inside and outside of the cloud cannot be told apart", hint="give the points normals")
    signs: FloatArray = solved
    return signs


def _agreement(
    points: FloatArray, normals: FloatArray, row: NDArray[np.int64], column: NDArray[np.int64]
) -> FloatArray:
    """Return how far the normals of pairs of points are alike (1) or opposite (-1), shape (P,).

    Less, as far as the points do not lie in each other's plane: what lies across a gap does not count.
    """
    step = points[column] - points[row]
    step /= np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-12)  # one point may be there twice
    weight: FloatArray = (normals[row] * normals[column]).sum(1)
    for end in (row, column):
        weight *= 1.0 - np.abs((normals[end] * step).sum(1))
    return weight
