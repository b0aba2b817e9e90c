"""Parts of a mannequin that come out too thick in a scan: fingers, hands and arms, and not the trunk.

How far through a part is, is asked along several ways in a cone, as for the shape diameter function (Shapira, Shamir
and Cohen-Or 2008): one alone, at a fingertip, runs along the whole arm.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.geometry.topology import face_normals
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

THIN = 0.1
"""Arms are less far through, trunks and heads more [m]."""
WAYS, ASLANT = 8, 1.0
"""Ways round the normal besides the one along it, and the tangent of their angle to it."""
START = 1e-4
"""They begin so far inside, so that they do not end where they began [m]."""


def thin_parts(mannequin: TriangleMesh) -> NDArray[np.bool_]:
    """Return which faces of a mannequin are on parts less than `THIN` through, shape (F,): the median of all ways is.

    Args:
        mannequin: Oriented outward [m].
    """
    import open3d as o3d

    core: Any = o3d.core  # its stubs know no NumPy array
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        core.Tensor(mannequin.vertices.astype(np.float32)), core.Tensor(mannequin.faces.astype(np.uint32))
    )
    inward = -face_normals(mannequin)
    start = mannequin.vertices[mannequin.faces].mean(axis=1) + START * inward
    ways = _cone(inward)
    rays = np.concatenate([np.broadcast_to(start, ways.shape), ways], axis=-1)
    through = scene.cast_rays(core.Tensor(rays.astype(np.float32)))["t_hit"].numpy()
    return np.asarray(np.median(through, axis=0) < THIN)


def _cone(axis: FloatArray) -> FloatArray:
    """Return unit ways in a cone about each axis (F, 3), itself among them, shape (WAYS + 1, F, 3)."""
    aside = np.cross(axis, np.eye(3)[np.abs(axis).argmin(axis=1)])
    aside /= np.maximum(np.linalg.norm(aside, axis=1, keepdims=True), 1e-12)
    other = np.cross(axis, aside)
    turn = 2.0 * np.pi * np.arange(WAYS)[:, None, None] / WAYS
    slanted = axis + ASLANT * (np.cos(turn) * aside + np.sin(turn) * other)
    return np.concatenate([axis[None], slanted / np.sqrt(1.0 + ASLANT**2)])
