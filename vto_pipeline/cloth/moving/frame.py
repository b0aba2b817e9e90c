"""One frame of a garment on a moving body: the steps to it, and what is done where they fail.

A frame is taken from where the last one ended. If triangles of the cloth then meet the body, the skin of their vertices
thickens and the frame is tried again; if the cloth overstretches or blows up, it is tried again in half the steps. The
skin thins out again as the body moves on, to what the drape needed. Cloth that then still passes through the body or
through itself is untangled: contacts would keep it as it is from frame to frame.

What cloth must not meet is the body as it gives way. Where that leaves a free place as posed, cloth is kept out of the
posed skin, too, if further attempts bring it out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import ceil
from typing import Any, NamedTuple

import numpy as np

from vto_pipeline.cloth.collision.body.contacts import Recollection
from vto_pipeline.cloth.collision.body.yielding import YieldingBody
from vto_pipeline.cloth.collision.response.active_set import ActiveSet
from vto_pipeline.cloth.dynamics.body_motion import beside
from vto_pipeline.cloth.dynamics.methods import FRAME
from vto_pipeline.cloth.dynamics.stepper import Stepper
from vto_pipeline.cloth.model.build import ClothModel, ClothState
from vto_pipeline.cloth.moving.config import FollowConfig
from vto_pipeline.cloth.moving.frame_audit import stretch_of_edges
from vto_pipeline.cloth.moving.path_collider import PathCollider
from vto_pipeline.cloth.moving.skins import draped_skin, thickened
from vto_pipeline.cloth.simulation import default_skin
from vto_pipeline.cloth.untangle import Untangled, untangle
from vto_pipeline.errors import DivergedError
from vto_pipeline.geometry.intersections import intersecting_faces, self_intersections
from vto_pipeline.geometry.topology import laid_edge_lengths
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import Garment
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.motion import BodyPath

_THINS_S = 0.5  # s in which the skin loses half of what it is thicker by,
_PACE_M_S = 0.2  # while the body moves as fast; more slowly where it is slower: held, it needs what it needed
_CLEAR_M = 5e-4  # from the body, of what is untangled
_GENTLY = 0.1  # of an edge: how far a round of that pushes first; folds that close on cloth have no room for more
_FINER = 2  # times as many steps where the cloth overstretches


class Moment(NamedTuple):
    """All that the next frame follows from.

    Args:
        state: The cloth.
        skin: Distance each vertex keeps from the body [m], shape (V,).
        contacts: The contacts of the last step.
        seen: What the last search for contacts left.
    """

    state: ClothState
    skin: FloatArray
    contacts: ActiveSet
    seen: Recollection

    def arrays(self) -> dict[str, Any]:
        """Return it as plain arrays."""
        return {
            "positions": self.state.positions,
            "velocities": self.state.velocities,
            "time": self.state.time,
            "skin": self.skin,
            **{f"slider_{k}": slider for k, slider in enumerate(self.state.sliders)},
            **{f"contact_{name}": value for name, value in self.contacts._asdict().items()},
            **{f"seen_{name}": value for name, value in self.seen._asdict().items()},
        }


def moment_from(arrays: Mapping[str, Any]) -> Moment:
    """Return what `Moment.arrays` gave."""
    sliders = tuple(arrays[f"slider_{k}"] for k in range(sum(name.startswith("slider_") for name in arrays)))
    return Moment(
        ClothState(arrays["positions"], arrays["velocities"], float(arrays["time"]), sliders),
        arrays["skin"],
        ActiveSet(*(arrays[f"contact_{name}"] for name in ActiveSet._fields)),
        Recollection(*(arrays[f"seen_{name}"] for name in Recollection._fields)),
    )


class Reached(NamedTuple):
    """How a frame was reached.

    Args:
        steps: Taken, in the attempt that was kept.
        attempts: How many there were.
        why: What went wrong in the last of them, in words; empty where nothing did.
    """

    steps: int
    attempts: int
    why: str = ""


class FrameStepper:
    """A garment among its colliders, stepped from frame to frame.

    Args:
        model: The cloth.
        garment: Where it starts, at rest on the body as that begins.
        path: The body.
        fabric: What the garment is made of.
        config: All settings.
        job: For what was repaired and left out.

    Attributes:
        now: Where it is.
        natural: Lengths of its edges without forces [m], shape (E,).
        body: What it is on.
    """

    now: Moment

    def __init__(
        self, model: ClothModel, garment: Garment, path: BodyPath, fabric: Fabric, config: FollowConfig, job: Job
    ) -> None:
        self._model = model
        self.natural = laid_edge_lengths(garment.mesh, garment.rest.corners(model.faces))
        self._config = config
        skin = default_skin(model.edge_length) if config.skin_mm is None else 1e-3 * config.skin_mm
        self.body = YieldingBody(path, skin, beside(path.at(0.0), garment.mesh))
        self._path = self.body.path
        self._skin = draped_skin(garment.mesh, self.body_at(0.0), skin)
        friction = fabric.friction if config.friction is None else config.friction
        self._collider = PathCollider(self._path, friction, job)
        self._stepper = Stepper(
            model, [self._collider], self._skin.copy(), config, damping=config.damping, force_all=job.force_all
        )
        positions = garment.mesh.vertices.copy()
        self._stepper.prepare(positions)
        job.note(f"{self._stepper.choice.method}: {self._stepper.choice.reason}")
        self._substeps = self._stepper.substeps
        begins = float(stretch_of_edges(garment.mesh, self.natural).max(initial=0.0))
        self._stretched = config.stretch_limit + max(0.0, begins)
        self.now = Moment(
            ClothState(positions, np.zeros_like(positions), 0.0, ()),
            self._skin.copy(),
            self._stepper.contact_memory,
            self._collider.recollection,
        )

    def body_at(self, time: float) -> TriangleMesh:
        """Return the body at a time [s], sunken where its parts press on each other."""
        return TriangleMesh(self._path.at(time), self._path.faces)

    def go_to(self, frame: int) -> Reached:
        """Take the garment from one frame to the next, this one, where `now` then is.

        Where no attempt is clean, the one with the fewest crossings is untangled. Where all of them overstretch the
        cloth or blow it up, it stays where it was, and `why` says so.
        """
        time = self._path.time(frame)
        begin, body = self.now, self.body_at(time)
        self._collider.crosses_itself = self.body.crosses_itself(frame)
        travel, skin = self._travel(begin, time), begin.skin.copy()
        substeps = self._steps_by_travel(travel, time - begin.state.time)
        best: tuple[tuple[int, int], Moment, int] | None = None
        why, tried, left = "", 0, 0.5 ** (min(time - begin.state.time, travel / _PACE_M_S) / _THINS_S)
        for attempt in range(1, self._config.attempts + 1):
            tried = attempt
            self._set(begin._replace(skin=skin), substeps)
            taken = self._stepper.steps
            try:
                state = self._stepper.run(begin.state, time - begin.state.time)
            except DivergedError as error:
                why, substeps = error.problem, self._finer(substeps)
                continue
            cloth = TriangleMesh(state.positions, self._model.faces)
            stretch = float(stretch_of_edges(cloth, self.natural).max(initial=0.0))
            crossing, in_posed = intersecting_faces(cloth, body), self.body.crossing_with_room(cloth, frame)
            if stretch > self._stretched:
                why, substeps = f"an edge has {1.0 + stretch:.1f} times its length at rest", self._finer(substeps)
                continue
            count = len(crossing) + len(self_intersections(cloth)), len(in_posed)
            if best is None or count < best[0]:
                thinner = self._skin + left * (skin - self._skin)
                moment = Moment(state, thinner, self._stepper.contact_memory, self._collider.recollection)
                best = count, moment, self._stepper.steps - taken
            elif best[0][0] == 0:  # clear of the body: still thicker skin leads to nothing better
                break
            if count == (0, 0):
                break
            before, meeting = skin, self._model.faces[np.concatenate([crossing, in_posed])[:, 0]]
            skin = thickened(before, np.unique(meeting), state.positions, body)
            if np.array_equal(skin, before):  # no room: the next attempt would be this one again
                break
        if best is None:
            self.now = begin
            return Reached(0, tried, why)
        count, self.now, steps = best
        if count[0] > 0:
            self._untangle(body)
        return Reached(steps, tried)

    def _untangle(self, body: TriangleMesh) -> None:
        """Move the cloth out of the body and of itself, as little as needed, and keep its speed."""
        state = self.now.state

        def found(step: float | None) -> Untangled:
            return untangle(state.positions, self._model.faces, body=body, thickness=_CLEAR_M, step=step)

        best = found(_GENTLY * self._model.edge_length)
        if best.crossings_left > 0:
            best = min(best, found(None), key=lambda one: one.crossings_left)
        self.now = self.now._replace(state=replace(state, positions=best.positions))

    def _finer(self, substeps: float) -> float:
        return min(_FINER * substeps, max(self._config.finest, substeps))

    def _set(self, moment: Moment, substeps: float) -> None:
        self._stepper.skin = moment.skin
        self._stepper.contact_memory = moment.contacts
        self._collider.recollection = moment.seen
        self._stepper.substeps = substeps

    def _travel(self, begin: Moment, time: float) -> float:
        """Return how far the body near the cloth moves until then [m]."""
        start, end = self._path.at(begin.state.time), self._path.at(time)
        near = beside(start, TriangleMesh(begin.state.positions, self._model.faces))
        return float(np.linalg.norm(end - start, axis=1)[near].max(initial=0.0))

    def _steps_by_travel(self, travel: float, seconds: float) -> float:
        """Return the steps per 1/60 s in which the body near the cloth moves no farther than it may in each."""
        needed = ceil(travel / (1e-3 * self._config.body_step_mm)) * FRAME / seconds
        return float(np.clip(needed, self._substeps, max(self._config.finest, self._substeps)))
