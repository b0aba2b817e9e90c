"""A body that is posed when it is asked for, as a collider."""

from __future__ import annotations

from vto_pipeline.cloth.collision.body.contacts import BodyCollider, Recollection
from vto_pipeline.cloth.collision.contacts import Contacts, ContactSpan
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.job import Job
from vto_pipeline.model.motion import BodyPath


class PathCollider(BodyCollider):
    """A body on its path; it never counts as at rest.

    Args:
        path: Where it is at any time.
        friction: Coulomb coefficient.
        job: For what was repaired.
    """

    def __init__(self, path: BodyPath, friction: float, job: Job) -> None:
        self._path = path
        super().__init__(MovingBody(path.at(0.0)[None], path.faces), float("inf"), friction, job)

    def at(self, time: float) -> FloatArray:
        """Return the body's vertices at a time [s], shape (V, 3) [m]."""
        return self._path.at(time)

    def contacts(self, positions: FloatArray, span: ContactSpan) -> Contacts:
        """See `Collider.contacts`; each plane is carried as the body carries the vertex that lies a skin above it.

        Friction would else give cloth the way of the skin below, which is shorter where the body turns: a shirt would
        fall behind by the share that its distance is of the radius.
        """
        found = super().contacts(positions, span)
        lift = span.skin[:, None, None] * found.normal
        return found._replace(point=found.point + lift, offset=found.offset - span.skin[:, None])

    def _changes(self) -> bool:
        return True

    @property
    def recollection(self) -> Recollection:
        """What the last search for contacts left for the next; may be set back to it."""
        return Recollection(self._guess, self._distance, self._flank, self._first)

    @recollection.setter
    def recollection(self, before: Recollection) -> None:
        self._guess, self._distance, self._flank, self._first = before
