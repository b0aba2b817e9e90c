"""Motion of a body, slowed down to what the cloth on it can follow."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.cloth.collision.body.contacts import BodyCollider
from vto_pipeline.cloth.dynamics.stepper import Stepper
from vto_pipeline.cloth.model.build import ClothState
from vto_pipeline.errors import IntersectingError
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

_WINDOW = 0.05  # s of cloth time between changes of speed
_SLOWEST = 0.125  # of full speed
_CAREFUL = 0.03  # of full speed: the slowest where parts of the body go through cloth in one step
_LONGEST = 1.0 / _SLOWEST  # times as long as at full speed, what only grows: only where it is careful is it slower
_BRAKE, _PICK_UP = 0.5, 1.25  # of the speed, where contact is deep and where it is not
_AGAIN = 0.25  # of the speed, where a part went through
_SHALLOW = 0.25  # of what counts as deep: between the two, the speed is kept
_BESIDE = 0.15  # m: the body this near the cloth, where it begins or ends, sets the speed
_JAMMED = 1000.0  # weights left over: cloth that is led about by a body has some hundreds
_WINDOWS, _FALL = 3, 0.8  # in a row with no less, and the share that it has to fall below meanwhile


class VariableSpeedBody(BodyCollider):
    """A moving body whose motion can be slowed and hurried while it goes on.

    Args:
        body: The keyframes.
        seconds: How long the motion takes at full speed [s].
        friction: Coulomb coefficient.
        job: For what was repaired and left out.
    """

    def __init__(self, body: MovingBody, seconds: float, friction: float, job: Job | None = None) -> None:
        self._full = seconds
        self._since = self._gone = 0.0
        super().__init__(body, seconds, friction, job)

    @property
    def ends(self) -> float:
        """When the motion ends at the present speed [s]."""
        return self._seconds

    def at(self, time: float) -> FloatArray:
        """Return the body's vertices at a time [s] not before the last change of speed, shape (V, 3) [m]."""
        return super().at(self._progress(time) * self._seconds)

    def set_speed(self, time: float, speed: float) -> None:
        """Go on from this time [s], before the end, at a share of full speed."""
        self._since, self._gone = time, self._progress(time)
        self._seconds = time + (1.0 - self._gone) * self._full / speed

    def depth(self, time: float, positions: FloatArray) -> float:
        """Return how deep in the body at a time [s] the deepest vertex is that was inside when contacts were found."""
        inside = self.contained_vertices(len(positions))
        if not inside.any():
            return 0.0
        surface = SurfaceDistance(TriangleMesh(self.at(time), self.faces))
        return max(0.0, -float(surface.signed(positions[inside]).distance.min()))

    def _progress(self, time: float) -> float:
        """Return what share of the motion is done at a time [s]."""
        if time >= self._seconds:
            return 1.0
        return self._gone + (1.0 - self._gone) * (time - self._since) / (self._seconds - self._since)


def run_body_motion(
    stepper: Stepper,
    state: ClothState,
    body: VariableSpeedBody,
    deep: float,
    watch: Callable[[float], None],
    only_grows: bool = False,
) -> ClothState:
    """Return the cloth when the body's motion is over; where cloth is deep in the body, that waits for it.

    Where its vertices and edges are kept out of the cloth, too, and a part of it goes through all the same, as fingers
    that spread do, that is taken back and gone again more slowly.

    Args:
        stepper: The cloth among its colliders, the body one of them.
        state: Where to begin, at the motion's begin.
        body: Slowed as need be.
        deep: Cloth deeper in the body than this is behind [m].
        watch: Receives the share of the motion that is done.
        only_grows: Whether jammed cloth will not come free, as it does when arms that pressed on it go up again.

    Raises:
        IntersectingError: the body only grows and the cloth is jammed: what is left over of its forces is far above its
            weight, and does not fall. Or parts of the body would go through it at all but the slowest pace, for long.
            Steps take minutes then, and lead nowhere. `partial` holds it there as "draped".
    """
    speed, left, passed, longest = 1.0, [0.0], _gone_through(stepper), _LONGEST * body.ends
    while state.time < body.ends - 1e-9:
        before, known = state, stepper.contact_memory
        state = stepper.run(state, min(_WINDOW, body.ends - state.time))
        if _gone_through(stepper) > passed and speed > _CAREFUL:
            passed, speed = _gone_through(stepper), max(_AGAIN * speed, _CAREFUL)
            state, stepper.contact_memory = before, known
            body.set_speed(state.time, speed)
            continue
        passed = _gone_through(stepper)
        watch(state.time / body.ends)
        left.append(stepper.residual(state))
        if only_grows and stepper.has_exact_rest and is_jammed(left):  # others leave forces that are no jam's
            raise IntersectingError(
                f"the cloth is jammed as the body grows, with forces of {left[-1]:.0f} times its weight",
                hint="it lies between parts of the body, or its layers are entangled: give it nearer to how it is worn",
                partial={"draped": TriangleMesh(state.positions, stepper.faces)},
            )
        if only_grows and state.time > longest:
            raise IntersectingError(
                "parts of the body would go through the cloth as it grows, however slowly",
                hint="it is too small for this body, or its mesh too coarse: give a larger size, or a finer mesh",
                partial={"draped": TriangleMesh(state.positions, stepper.faces)},
            )
        depth = body.depth(state.time, state.positions)
        change = _BRAKE if depth > deep else _PICK_UP if depth < _SHALLOW * deep else 1.0
        speed = float(np.clip(speed * change, min(speed, _SLOWEST), 1.0))
        if state.time < body.ends - 1e-9:
            body.set_speed(state.time, speed)
    return state


def _gone_through(stepper: Stepper) -> int:
    """Return how many pairs of features of cloth and moving bodies have met that no shorter step kept apart."""
    return 0 if stepper.self_contact is None else stepper.self_contact.counters.uncut


def is_jammed(left: Sequence[float]) -> bool:
    """Return whether what is left over of the forces, as shares of weight, after each window, is high and stays so."""
    last = left[-_WINDOWS:]
    return len(last) == _WINDOWS and min(last) > _JAMMED and last[-1] >= _FALL * last[0]


def body_travel(body: MovingBody, cloth: TriangleMesh) -> float:
    """Return how far the fastest point of the body near the cloth moves [m].

    Args:
        body: The keyframes.
        cloth: On the body as it begins [m].
    """
    steps = np.linalg.norm(np.diff(body.keyframes, axis=0), axis=2)[:, beside(body.keyframes[0], cloth)]
    fastest = steps.max(axis=1, initial=0.0)
    return float(len(steps) * fastest.max(initial=0.0))


def beside(vertices: FloatArray, cloth: TriangleMesh) -> NDArray[np.int64]:
    """Return which vertices of a body [m], shape (V, 3), are so near the cloth that they set its pace, shape (N,)."""
    return np.flatnonzero(SurfaceDistance(cloth).nearest(vertices).distance < _BESIDE)
