"""A body that is posed when it is asked for, as a collider."""

from __future__ import annotations

import numpy as np

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

    Attributes:
        crosses_itself: Whether parts of the body pass through each other now; to be set from frame to frame.
    """

    def __init__(self, path: BodyPath, friction: float, job: Job) -> None:
        self._path = path
        self.crosses_itself = False
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

    def _fit(self, span: ContactSpan) -> tuple[FloatArray, FloatArray]:
        """Return the vertices at start and end of a span, with what can be touched at the start.

        Where parts of the body pass through each other, only their union can be touched, as at rest: cloth that is
        caught between them is led out of both. Which faces that leaves changes from span to span.
        """
        if not self.crosses_itself and self._surface.part is None:
            return super()._fit(span)
        before = self.at(span.start)
        if not np.array_equal(before, self._fitted_to) or (self._surface.part is None) == self.crosses_itself:
            known = self.recollection
            self._fitted_to = before
            self._surface = self._touchable_surface() if self.crosses_itself else self._full_surface()
            self.recollection = known
        return before, self.at(span.end)

    @property
    def recollection(self) -> Recollection:
        """What the last search for contacts left for the next, by faces of the whole body; may be set back to it."""
        part = self._surface.part
        guess, flank = (
            known if part is None else np.where(known >= 0, part.parent[known], -1).astype(np.int32)
            for known in (self._guess, self._flank)
        )
        return Recollection(guess, self._distance, flank, self._first)

    @recollection.setter
    def recollection(self, before: Recollection) -> None:
        part = self._surface.part
        self._guess, self._distance, self._flank, self._first = before
        if part is not None:
            place = np.full(len(self.faces), -1, np.int32)
            place[part.parent[::-1]] = np.arange(len(part.parent), dtype=np.int32)[::-1]
            self._guess, self._flank = (
                np.where(known >= 0, place[known], -1).astype(np.int32) for known in (before.guess, before.flank)
            )
