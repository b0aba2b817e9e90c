"""A rigidly moving collider."""

from __future__ import annotations

from dataclasses import dataclass

from vto_pipeline.cloth.collision.contacts import Collider, Contacts, ContactSpan
from vto_pipeline.cloth.collision.shapes.colliders import MeshCollider
from vto_pipeline.cloth.collision.shapes.pose import Path
from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import FloatArray


@dataclass(frozen=True)
class Moving:
    """A collider on its path: its own frame is where the path has it.

    In that frame the collider rests and the cloth comes at it, so whatever holds for a collider at rest holds here:
    cloth cannot pass through it however thin and fast it is, and a mesh keeps its tree.

    Args:
        shape: What moves; given about the origin its path turns it around.
        path: How.
    """

    shape: Collider | MeshCollider
    path: Path

    def contacts(self, positions: FloatArray, span: ContactSpan) -> Contacts:
        """See `Collider.contacts`."""
        if isinstance(self.shape, MeshCollider):
            raise InputError("a moving mesh must be given as a BodyCollider", hint="Moving(BodyCollider(...), path)")
        begin, end = self.path.at(span.start), self.path.at(span.end)
        here = begin.own(positions)
        there = end.own(positions if span.move is None else positions + span.move)
        found = self.shape.contacts(here, span._replace(move=there - here))
        for carry, k in ((begin, 0), (end, 1)):
            found.point[:, :, k] = carry.world(found.point[:, :, k])
            found.normal[:, :, k] = carry.world_direction(found.normal[:, :, k])
        return found
