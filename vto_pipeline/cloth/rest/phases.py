"""The phases of a drape: freeing, growing the body, moving along with it, settling."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from vto_pipeline.cloth.collision.body.yielding import give_way
from vto_pipeline.cloth.collision.self_collision.counters import CollisionCounters, report_counters
from vto_pipeline.cloth.collision.self_collision.pieces import surface_components
from vto_pipeline.cloth.drape_config import DrapeConfig
from vto_pipeline.cloth.dynamics.body_motion import VariableSpeedBody, beside, body_travel, run_body_motion
from vto_pipeline.cloth.dynamics.stepper import Stepper
from vto_pipeline.cloth.model.build import ClothModel, ClothState, at_rest, without_gravity
from vto_pipeline.cloth.placement.body_growth import plan_body_growth
from vto_pipeline.cloth.placement.clear_body import OVERSTRETCHED, clear_body_crossings, edge_stretches
from vto_pipeline.cloth.placement.collision_free_start import find_collision_free_start, freed_of_body
from vto_pipeline.cloth.placement.limbs.limbs import Limbs
from vto_pipeline.cloth.placement.limbs.mittens import in_mittens
from vto_pipeline.cloth.placement.thinning import BodyGrowth
from vto_pipeline.cloth.rest.convergence import SettleLimits, SettlingResult, relax_to_rest
from vto_pipeline.cloth.rest.true_distance import some_positions
from vto_pipeline.cloth.simulation import default_skin
from vto_pipeline.errors import IntersectingError
from vto_pipeline.geometry.intersections import intersecting_faces
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.cloth import TraceRow
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

PLACED, ROUGH, REST = (5e-3, 1000.0), (5e-3, 100.0), (None, 1.0)
"""How nearly cloth comes to rest: the error [m], and times the left-over force that are enough.

In place, to see where it lies across the body before it goes on; roughly, for a finer mesh to go on; and as is asked.
The first two do not depend on what is: friction keeps cloth where its way has led it.
What is in place has forces of ten times its weight while wrinkles snap here and there: the exact stiffness of the last
steps is faster at ending that."""

_GROWING = "growing the body inside the garment"
_TURNS = 5  # of coming to rest and being cleared
_LARGER = 1.02  # times its size: what starts so was enlarged, not just bent
ENLARGED = 1.15
"""Times its size: a place is found for it a fifth larger, or more; what is worn snugly is stretched less."""
_LONG = 0.5  # steps per 1/60 s on the way to rest: backward Euler takes the more motion out, the longer they are
_PADDING = 0.25  # of an edge: so far one may cut into what both of its ends lie on
_CALM = 20.0  # 1/s: velocities fade this fast while the body grows, where the way does not matter


class Phases:
    """What the phases of one drape share.

    Args:
        model: The cloth.
        rest: Its shape without forces.
        fabric: What it is made of.
        config: All settings.
        job: For progress, findings and what was left out.

    Attributes:
        crossings_left: Pairs of triangles that still met after it was last freed.
        some: What is kept of the positions [m], shape (V, 3), at each look: some of the vertices, shape (S, 3).
    """

    def __init__(self, model: ClothModel, rest: RestShape, fabric: Fabric, config: DrapeConfig, job: Job) -> None:
        self._model = model
        self._rest = rest
        self._fabric = fabric
        self._friction = fabric.friction if config.friction is None else config.friction
        self._skin = default_skin(model.edge_length) if config.skin_mm is None else 1e-3 * config.skin_mm
        self._config = config
        self._job = job
        self.crossings_left = 0
        self.some = some_positions(len(model.mass))
        self._crossed = np.zeros(len(model.mass), np.bool_)
        self._counters: list[CollisionCounters] = []
        self._colliders: list[VariableSpeedBody] = []

    def resolve_crossings(self, state: ClothState, body: TriangleMesh | None = None) -> ClothState:
        """Return the cloth where it crosses neither itself nor the body; where it could not be freed, it may go on."""
        if not self._config.self_collision:
            return state
        start = find_collision_free_start(
            state.positions, self._model.faces, self._rest.positions, self._fabric.thickness, self._job, body
        )
        self.crossings_left, self._crossed = start.crossings_left, start.crossed
        if start.crossings == 0:
            return state
        return replace(state, positions=start.positions, velocities=np.zeros_like(state.velocities))

    def give_way(self, body: MovingBody, cloth: TriangleMesh) -> MovingBody:
        """Return the body, which leaves room for the cloth where its own parts press on each other on its way."""
        if len(body.keyframes) == 1:
            return body
        found, deepest = give_way(body, self._skin, beside(body.keyframes[0], cloth))
        if deepest > 0.0:
            self._job.note(f"the body gives way by up to {1e3 * deepest:.1f} mm where its own parts press on the cloth")
        return found

    def collider(self, body: MovingBody, cloth: TriangleMesh) -> VariableSpeedBody:
        """Return the body, which moves as fast as it may about the cloth."""
        seconds = body_travel(body, cloth) / self._config.body_speed
        return VariableSpeedBody(body, seconds, self._friction, self._job)

    def stepper(
        self, model: ClothModel, collider: VariableSpeedBody, damping: float, config: DrapeConfig | None = None
    ) -> Stepper:
        """Return the cloth among its colliders, by all its settings or by others."""
        config = self._config if config is None else config
        made = Stepper(
            model,
            [collider],
            np.full(len(model.mass), self._skin),
            config,
            damping=damping,
            max_speed=config.max_speed,
            crossed=self._crossed,
            force_all=self._job.force_all,
        )
        self._colliders.append(collider)
        if made.self_contact is not None:
            self._counters.append(made.self_contact.counters)
        return made

    def grow_body(self, state: ClothState, body: TriangleMesh) -> ClothState:
        """Return the cloth outside the body.

        Raises:
            IntersectingError: a limb goes through cloth, wherever the garment is led; or the cloth jams.
        """
        mesh = TriangleMesh(state.positions, self._model.faces)
        depth = -float(SurfaceDistance(body).signed(mesh.vertices).distance.min())
        if depth <= 1e-3 * self._config.grow_above_mm:
            self._job.leave_out(_GROWING, f"no cloth is deeper inside than {1e3 * max(depth, 0):.1f} mm")
            return state
        self._job.progress(0.05, _GROWING)
        growth = plan_body_growth(body, mesh, self._job, self._fabric.thickness)
        growth.refuse_pierced()
        while True:
            try:
                return self._grown_clear(growth, body)
            except IntersectingError as error:
                if growth.otherwise is None or self._times_its_size(mesh) > ENLARGED:
                    raise  # what is far too small jams again from any beginning
                growth = growth.otherwise
                self._job.note(f"{error.problem}: begun again from a thinner body")

    def _grown_clear(self, growth: BodyGrowth, body: TriangleMesh) -> ClothState:
        """Return the cloth clear of the body as it ends; where that cannot be, it may cross.

        What is finer than the cloth grows out between its vertices. It is moved off, else pushed off by a thicker skin.
        Where that fails, too, the body grows again, and its vertices and edges keep out of the cloth. It does not where
        that is far too small, and would jam after minutes.

        Raises:
            IntersectingError: it jams on the way.
        """
        grown, stepper = self._grown(growth, self._config)
        if not self._config.self_collision or self._config.body_features:
            return grown
        rest, faces = self._rest.positions, self._model.faces
        freed = freed_of_body(grown.positions, faces, rest, self._fabric.thickness, body)
        if freed is not None:
            return replace(grown, positions=freed)
        cleared, left = clear_body_crossings(stepper, grown, rest, faces, body, self._config.clear_rounds)
        if len(left) == 0:
            return at_rest(cleared.positions)
        if self._times_its_size(growth.garment) > ENLARGED:
            return grown
        self._job.progress(0.05, f"{_GROWING}, closely")
        try:
            return self._grown(growth, self._config.model_copy(update={"body_features": True}))[0]
        except IntersectingError:  # it jams before what it went through
            return grown

    def _grown(self, growth: BodyGrowth, config: DrapeConfig) -> tuple[ClothState, Stepper]:
        """Return the cloth outside the body as it ends, and among its colliders.

        Raises:
            IntersectingError: it jams on the way.
        """
        times = self._times_its_size(growth.garment)
        if times > _LARGER:
            growth = growth.from_smaller(times)
        thin = TriangleMesh(growth.body.keyframes[0], growth.body.faces)
        state = self.resolve_crossings(at_rest(growth.garment.vertices), thin)
        padding = _PADDING * self._model.edge_length
        collider = self.collider(in_mittens(growth.body, growth.thinning.limbs, padding), growth.garment)
        stepper = self.stepper(without_gravity(self._model), collider, _CALM, config)
        stepper.prepare(state.positions)
        stepper.accelerate(True)
        grown = run_body_motion(
            stepper,
            state,
            collider,
            self._skin,
            lambda done: self._job.progress(0.05 + 0.25 * done, _GROWING),
            only_grows=True,
        )
        return at_rest(grown.positions), stepper

    def _times_its_size(self, garment: TriangleMesh) -> float:
        """Return how many times its edges are as long as at rest, by their median, in the garment's triangles."""
        return float(np.median(edge_stretches(garment.vertices, self._rest.positions, self._model.faces)))

    def follow_body(
        self, state: ClothState, stepper: Stepper, collider: VariableSpeedBody, body: TriangleMesh
    ) -> ClothState:
        """Return the cloth after the body's motion."""
        what = "moving along with the body"
        if collider.ends == 0.0:
            self._job.leave_out(what, "the body is at rest")
            return state
        at_full_pace = collider.ends
        state = run_body_motion(
            stepper, state, collider, self._skin, lambda done: self._job.progress(0.3 + 0.2 * done, what)
        )
        self._job.note(
            f"the body took {collider.ends:.2f} s to change, in simulated time; {at_full_pace:.2f} s unslowed"
        )
        return self.resolve_crossings(state, body)

    def settle(
        self,
        state: ClothState,
        stepper: Stepper,
        body: TriangleMesh,
        deadline: float,
        nearly: tuple[float | None, float] = PLACED,
    ) -> SettlingResult:
        """Return the cloth at rest, or as near to it as allowed; it may cross the body.

        Args:
            state: Where to begin.
            stepper: The cloth among its colliders.
            body: Where it is now.
            deadline: `time.perf_counter` at which to stop.
            nearly: How nearly.
        """

        def watch(done: float, error: float) -> None:
            known = f"{1e3 * error:.2f} mm of motion predicted" if np.isfinite(error) else "falling into place"
            self._job.progress(0.5 + 0.4 * done, f"settling: {known}")

        error, times = nearly
        limits = SettleLimits(
            error=1e-3 * self._config.target_error_mm if error is None else error,
            residual=times * self._config.target_residual,
            seconds=self._config.settle_seconds,
            finest=self._config.finest,
            deadline=deadline,
        )

        def is_caught(positions: FloatArray) -> bool:
            """Return whether what never came free of the body is stretched about it as no cloth can be."""
            faces = self._model.faces
            if self.crossings_left == 0:
                return False
            if edge_stretches(positions, self._rest.positions, faces).max(initial=0.0) < OVERSTRETCHED:
                return False
            return len(intersecting_faces(TriangleMesh(positions, faces), body)) > 0

        stepper.prepare(state.positions)
        if self._config.substeps is None and stepper.has_exact_rest:
            stepper.substeps = min(stepper.substeps, _LONG)
        fallen = _falls_off(body, state.positions, self._model.faces)
        return relax_to_rest(stepper, state, limits, watch, is_caught, fallen, self.some)

    def settle_and_clear(
        self,
        state: ClothState,
        stepper: Stepper,
        body: TriangleMesh,
        deadline: float,
        passes: Sequence[tuple[float | None, float]] = (PLACED, REST),
        *,
        clears: bool = True,
    ) -> SettlingResult:
        """Return the cloth at rest and clear of the body, or as near to it as allowed.

        Args:
            state: Where to begin.
            stepper: The cloth among its colliders.
            body: Where it is now.
            deadline: `time.perf_counter` at which to stop.
            passes: How nearly, for each coming to rest; what was pushed off the body does so again.
            clears: Whether it is cleared.
        """
        trace: list[TraceRow] = []
        looks: list[FloatArray] = []
        began, rounds = time.perf_counter(), self._config.clear_rounds if clears else 0
        for turn in range(_TURNS):
            spent = time.perf_counter() - began
            settling = self.settle(state, stepper, body, deadline, passes[min(turn, len(passes) - 1)])
            trace += [replace(row, seconds=spent + row.seconds) for row in settling.trace]
            looks += settling.looks
            settling.trace, settling.looks = trace, looks
            if settling.caught:  # a thicker skin only stretches it more
                break
            self._job.progress(0.9, "clearing the body")
            state, crossing = clear_body_crossings(
                stepper, settling.state, self._rest.positions, self._model.faces, body, rounds
            )
            lies_clear = state is settling.state
            settling.state = state
            if not lies_clear:  # nobody has looked at it since it was moved
                settling.settled, settling.error = False, np.inf
            if len(crossing) > 0 and rounds > 0:  # nor will waiting clear it
                settling.settled, settling.error = False, np.inf
                break
            if lies_clear and (settling.jammed or turn + 1 >= len(passes)):
                break
        return settling

    def report_collision_work(self, before: Sequence[Phases] = ()) -> None:
        """Tell what keeping the cloth apart took, and what was left out of it, here and on coarser meshes before."""
        every = (*before, self)
        counters = [count for one in every for count in one._counters]
        report_counters(counters, [collider for one in every for collider in one._colliders], self._job)


def _falls_off(body: TriangleMesh, positions: FloatArray, faces: IntArray) -> Callable[[FloatArray], str]:
    """Return what tells which cloth is lower than anything that can hold it, by its positions [m], shape (V, 3).

    That is where the body ends; or where its legs part, for a piece that begins above: what slides past its hips ends
    at its feet. A piece that is not joined to the rest falls alone, and would never come to rest.
    """
    piece = surface_components(faces, len(positions)).of_vertex
    size = np.bincount(piece)

    def tops(positions: FloatArray) -> FloatArray:
        top = np.full(len(size), -np.inf)
        np.maximum.at(top, piece, positions[:, 1])
        return top

    ends = float(body.vertices[:, 1].min())
    parting = max(Limbs(body).parting, ends)
    lowest = np.where(tops(positions) > parting, parting, ends)

    def fallen(positions: FloatArray) -> str:
        lost = tops(positions) < lowest
        if not lost.any():
            return ""
        return "the garment" if lost.all() else f"a piece of {size[lost].max()} of the garment's {len(piece)} vertices"

    return fallen
