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

_CLEAR_SHARE = 0.7
"""So much of the normals has to point away from the axis, or towards it, to tell inside from outside."""

_PROBES, _NEIGHBOURS = 1000, 8
_SQUARE, _ALIKE = 0.85, 0.75
"""Of a file's normals: median cosine to the planes through its points, 0.5 where they have nothing to do with them; and
share of neighbours that point to the same side, 0.5 where the sides are left to chance."""


def oriented_normals(cloud: PointCloud, neighbours: int, job: Job) -> FloatArray:
    """The cloud's own normals, or normals of local planes with the signs that most pairs of neighbours agree on.

    Its own are left aside where they do not stand on the surface, or point to any side of it.

    Signs spread along a tree (Hoppe et al. 1992) turn half a body inside out where a single pair is wrong, as where
    thighs nearly touch; here all pairs vote. The sign of the whole is the one that points away from the cloud's
    vertical axis.

    Args:
        cloud: Points [m].
        neighbours: Points a plane is fitted to.
        job: Receives how sure the sign is; notified where the cloud's own normals are not used.

    Returns:
        Unit normals, shape (N, 3).
    """
    given_normals = _plausible(cloud, neighbours, job)
    if given_normals is not None:
        return given_normals
    import open3d as o3d

    given = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.array(cloud.points)))
    given.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(neighbours))
    normals = np.array(given.normals)
    agree = _outward(cloud.points, normals)
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
    share = _outward_share(cloud.points, normals)
    job.measure(normals_outward_share=round(share, 3))
    if share < _CLEAR_SHARE:
        job.warn(f"inside and outside are hard to tell apart: {100 * share:.0f} % of the normals agree")
    return normals


def _plausible(cloud: PointCloud, neighbours: int, job: Job) -> FloatArray | None:
    """Return the file's own normals, or None where they are not of the surface that its points lie on.

    A surface solved through wrong normals is torn, and nothing else tells.
    """
    if cloud.normals is None:
        return None
    chosen = np.random.default_rng(job.seed).permutation(len(cloud.points))[:_PROBES]
    near = cKDTree(cloud.points).query(cloud.points[chosen], k=min(neighbours, len(cloud.points) - 1) + 1)[1]
    local = cloud.points[near] - cloud.points[near].mean(axis=1, keepdims=True)
    flattest = np.linalg.eigh(np.einsum("nki,nkj->nij", local, local))[1][:, :, 0]
    square = float(np.median(np.abs((flattest * cloud.normals[chosen]).sum(axis=1))))
    beside = cloud.normals[near[:, 1 : _NEIGHBOURS + 1]]
    alike = float(((beside * cloud.normals[chosen, np.newaxis]).sum(axis=2) > 0.0).mean())
    if square < _SQUARE:
        job.note(f"the file's normals are not used: they do not stand on the surface (median cosine {square:.2f})")
        return None
    if alike < _ALIKE:
        job.note(f"the file's normals are not used: only {100 * alike:.0f} % of neighbours point to the same side")
        return None
    if _outward_share(cloud.points, cloud.normals) < 1.0 - _CLEAR_SHARE:
        job.warn("the file's normals point inwards, and so does the surface: turn them over if that is not meant")
    return cloud.normals


def _outward(points: FloatArray, normals: FloatArray) -> FloatArray:
    """Return how far each normal points away from the cloud's vertical axis [m], shape (N,)."""
    outwards = points - np.median(points, axis=0)
    outwards[:, 1] = 0.0
    agree: FloatArray = (normals * outwards).sum(axis=1)
    return agree


def _outward_share(points: FloatArray, normals: FloatArray) -> float:
    """Return the share of the normals that points outwards; those count that lie far out."""
    agree = _outward(points, normals)
    return float(agree[agree > 0].sum() / max(np.abs(agree).sum(), 1e-12))


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
