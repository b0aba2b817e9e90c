"""The way out of a body for cloth inside it, even if the body is open or crosses itself."""

from __future__ import annotations

import numpy as np

from vto_pipeline.cloth.untangle.contours import Crossings
from vto_pipeline.cloth.untangle.rows import SeparationRows, separation_rows
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import face_normals, submesh
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

_BEFORE = 1e-4  # m before a face, where it is asked whether that is still inside


class OutermostFaces:
    """A body's outermost faces. Those that lie inside it, where its parts overlap, show no way out and are left out.

    Args:
        body: Oriented outward.
    """

    def __init__(self, body: TriangleMesh) -> None:
        before = body.vertices[body.faces].mean(axis=1) + _BEFORE * face_normals(body)
        outermost = SurfaceDistance(body).signed(before).distance >= 0.0
        skin = submesh(body, outermost)[0] if outermost.any() else body
        self._distance = SurfaceDistance(skin)
        self._normals = face_normals(skin)
        self._body = body

    def rows(self, positions: FloatArray, crossing: Crossings, thickness: float, step: float) -> list[SeparationRows]:
        """Return rows that lead the cloth out.

        Args:
            positions: Of the cloth [m], shape (V, 3).
            crossing: Of cloth and body; the body's vertices come after those of the cloth.
            thickness: Distance to keep [m].
            step: How far to go at once [m].
        """
        free = len(positions)
        found = self._distance.signed(positions)
        near = np.flatnonzero(found.distance < thickness + step).astype(np.int32)
        depth = found.distance[near]
        away = (positions[near] - found.point[near]) / np.where(np.abs(depth) > 1e-9, depth, np.inf)[:, None]
        outward = np.where((np.abs(depth) > 1e-9)[:, None], away, self._normals[found.face[near]])
        level = np.minimum(thickness, depth + step) + np.einsum("nd,nd->n", found.point[near], outward)
        parts = [separation_rows(near[:, None], np.ones((len(near), 1)), outward, level, positions, free)]

        everything = np.vstack([positions, self._body.vertices])
        of_body = crossing.edge[:, 0] >= free
        n = np.flatnonzero(of_body)  # edges of the body through the cloth, which goes where the body's skin looks
        out = self._normals[self._distance.nearest(crossing.point[n]).face]
        sign = np.where(np.einsum("nd,nd->n", crossing.normal[n], out) > 0.0, 1.0, -1.0)
        out = sign[:, None] * crossing.normal[n]
        height = np.einsum("nkd,nd->nk", everything[crossing.edge[n]] - crossing.point[n, None], out)
        top = height.argmax(axis=1)
        parts.append(
            separation_rows(
                np.column_stack([crossing.edge[n, top], crossing.face[n]]),
                np.column_stack([-np.ones(len(n)), crossing.weights[n]]),
                out,
                np.minimum(thickness, step - height.max(axis=1)),
                everything,
                free,
            )
        )
        n = np.flatnonzero(~of_body)
        n = n[(found.distance[crossing.edge[n]] >= 0.0).all(axis=1)]  # edges of the cloth across a ridge of the body
        parts.append(
            separation_rows(
                crossing.edge[n],
                np.column_stack([1.0 - crossing.share[n], crossing.share[n]]),
                crossing.normal[n],
                np.einsum("nd,nd->n", crossing.point[n], crossing.normal[n]) + max(thickness, 0.25 * step),
                everything,
                free,
            )
        )
        return parts
