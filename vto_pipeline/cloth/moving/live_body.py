"""A body whose next place is set frame by frame, as a collider: each vertex of the cloth keeps to its own part."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.cloth.collision.body.nearest import Nearest, SurfaceTree
from vto_pipeline.cloth.collision.body.triangle_planes import INSIDE, sides, triangle_planes
from vto_pipeline.cloth.collision.body.walk import faces_around, walk
from vto_pipeline.cloth.collision.contacts import Contacts, ContactSpan, surface_contacts
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.spatial import bvh
from vto_pipeline.numerics.spatial.pseudonormals import pseudonormals, update_pseudonormals

_ANYWHERE = 1e3  # m: the first search has no limit


class LiveBody:
    """The body, and where on it each vertex of the cloth was last.

    Args:
        body: As the garment lies on it.
        positions: Of the cloth [m], shape (V, 3).
        friction: Coulomb coefficient.

    Attributes:
        vertices: Where the body is [m], shape (B, 3).
        after: Where it goes in the next span [m], shape (B, 3); to be set.
        depth: How deep the deepest vertex was in its part of the body, when contacts were last found [m].
    """

    def __init__(self, body: TriangleMesh, positions: FloatArray, friction: float) -> None:
        self.vertices = self.after = np.array(body.vertices)
        self.depth = 0.0
        self._faces = body.faces
        self._friction = friction
        self._normals = pseudonormals(self.vertices, body.faces)
        self._around = faces_around(body.faces, len(body.vertices))
        tree = SurfaceTree(self.vertices, body.faces, bvh.build(self.vertices, body.faces))
        count = len(positions)
        self._on = tree.nearest(positions, np.full(count, _ANYWHERE), np.full(count, -1, np.int32)).triangle

    def contacts(self, positions: FloatArray, span: ContactSpan) -> Contacts:
        """See `Collider.contacts`; planes are carried as `PathCollider` carries them."""
        found, side, distance = self._beneath(positions)
        self.depth = float(distance[side == INSIDE].max(initial=0.0))
        away, point, normal, near = triangle_planes(
            self.vertices, self.after, self._faces, self._normals, positions, positions, side, *found
        )
        planes = surface_contacts(away, point, normal, near & (away < span.travel), self._friction, span)
        lift = span.skin[:, None, None] * planes.normal
        return planes._replace(point=planes.point + lift, offset=planes.offset - span.skin[:, None])

    def arrive(self) -> None:
        """Be where the span ended."""
        self.vertices = self.after
        update_pseudonormals(self._normals, self.vertices, self._faces)

    def led_out(self, positions: FloatArray) -> FloatArray:
        """Return places of the cloth [m], shape (V, 3): those inside their part of the body are now on its skin."""
        found, side, _ = self._beneath(positions)
        inside, out = side == INSIDE, positions.copy()
        corners = self.vertices[self._faces[found.triangle[inside]]]
        out[inside] = np.einsum("nk,nkd->nd", found.weights[inside], corners)
        return out

    def _beneath(self, positions: FloatArray) -> tuple[Nearest, NDArray[np.int8], FloatArray]:
        """Return the nearest place of each vertex's part of the body, on which side of it that is, and how far off."""
        found = Nearest(*walk(positions, self._on, self.vertices, self._faces, *self._around))
        self._on = found.triangle
        return found, *sides(self.vertices, self._faces, self._normals, positions, *found)
