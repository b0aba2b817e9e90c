"""A garment on a body, at rest."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from pydantic import Field

from vto_pipeline.cloth.audit import audit
from vto_pipeline.cloth.balance import elastic_energy
from vto_pipeline.cloth.build import ClothModel, ClothState, at_rest, build, without_gravity
from vto_pipeline.cloth.clear import clear_of_body
from vto_pipeline.cloth.collision.body import BodyCollider
from vto_pipeline.cloth.collision.self_contact import Tally
from vto_pipeline.cloth.grow import growing
from vto_pipeline.cloth.judge.balance import knows
from vto_pipeline.cloth.materials import Materials
from vto_pipeline.cloth.place import PlaceConfig, place
from vto_pipeline.cloth.settings import checked
from vto_pipeline.cloth.settle import SettleLimits, Settling, settle
from vto_pipeline.cloth.simulation import default_skin
from vto_pipeline.cloth.start import free_start
from vto_pipeline.cloth.stepper import StepConfig, Stepper
from vto_pipeline.cloth.warm_up import warm_up
from vto_pipeline.errors import DivergedError, IntersectingError
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.cloth import Draped
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import Garment, RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

_CALM = 20.0  # 1/s: velocities fade this fast while the body grows, where the way does not matter
_SHOWN = 5  # places named in a message
_JUST = 1e-3  # m beyond the skin: the judge takes cloth no farther from the body than this to lie on it


class DrapeConfig(StepConfig, PlaceConfig, Materials):
    """How a garment is draped."""

    skin_mm: float | None = Field(
        None, gt=0, le=20, description="Distance kept from the body [mm]; by default a quarter edge, 1 to 3 mm"
    )
    friction: float | None = Field(None, ge=0, le=5, description="Against the body; by default the fabric's")
    body_speed: float = Field(
        0.3, gt=0, le=5, description="Speed of the fastest point of the body while it changes [m/s]"
    )
    grow_above_mm: float = Field(
        10.0, ge=0, le=1000, description="Cloth that starts deeper in the body than this has it grow from inside [mm]"
    )
    damping: float = Field(5.0, ge=0, le=1000, description="Rate at which velocities fade [1/s]")
    max_speed: float = Field(1.0, gt=0, le=1000, description="No vertex moves faster [m/s]")
    target_error_mm: float = Field(2.0, gt=0, le=100, description="Predicted motion at which it is at rest, rms [mm]")
    target_residual: float = Field(0.01, ge=0, le=10, description="Or left-over force at which it is, share of weight")
    settle_seconds: float = Field(6.0, gt=0, le=600, description="Cloth time at most until rest [s]")
    finest: int = Field(160, ge=1, le=10000, description="Steps per 1/60 s that are not refined further")
    time_budget_s: float | None = Field(
        None, gt=0, description="Wall time after which to stop settling [s]; none by default"
    )
    clear_rounds: int = Field(
        15, ge=0, le=1000, description="Rounds of thickening the skin where triangles still cross"
    )


def drape(
    garment: Garment | TriangleMesh,
    body: MovingBody | TriangleMesh,
    fabric: Fabric,
    settings: DrapeConfig | Mapping[str, object] | None = None,
    job: Job | None = None,
) -> Draped:
    """Drape a garment on a body.

    When the body moves, the garment is where its first keyframe has it and rides along. When the body is at rest, the
    garment is put in its place first, and where it then cuts deep into the body, the body grows inside it. Where the
    garment crosses itself, it is untangled before. Then all settles under gravity, and a last pass takes the remaining
    crossings with the body out.

    Args:
        garment: The simulation mesh where it is now, and its rest shape; a mesh alone is its own rest shape.
        body: What it lies on.
        fabric: What it is made of.
        settings: Keys of `DrapeConfig`.
        job: For progress, findings and what was left out.

    Returns:
        The garment at its end, the trace of the settling, and the audit. Where it still crosses itself, the job is
        warned, and the audit says where.

    Raises:
        ConfigError: an unknown setting or a value out of range.
        IntersectingError: triangles still cross the body; `partial` holds the mesh as "draped", "audit" and "trace".
        DivergedError: positions are no longer finite; `partial` holds the mesh as it began, as "draped".
    """
    config, job = checked(DrapeConfig, settings), job or Job()
    if isinstance(garment, TriangleMesh):
        garment = Garment(garment, RestShape(garment.vertices))
    if isinstance(body, TriangleMesh):
        body = MovingBody(body.vertices[None], body.faces)
    job.progress(0.0, "compiling the kernels")
    job.measure(compile_s=warm_up())
    began = time.perf_counter()
    deadline = np.inf if config.time_budget_s is None else began + config.time_budget_s

    start = TriangleMesh(body.keyframes[0], body.faces)
    mesh = garment.mesh if len(body.keyframes) > 1 else place(garment.mesh, start, config, job)
    model = build(mesh, garment.rest, fabric, materials=config, job=job)
    work = _Work(model, garment.rest, fabric, config, job)
    state = work.free(at_rest(mesh.vertices))
    try:
        state = work.free(work.grow(state, start), start)
        collider, seconds = work.collider(body)
        stepper = work.stepper(model, collider, config.damping)
        stepper.prepare(state.positions)
        job.note(f"{stepper.choice.method}, {stepper.substeps} steps per 1/60 s: {stepper.choice.reason}")
        state = work.ride(state, stepper, seconds, body.final)
        settling = work.settle(state, stepper, deadline)
        job.progress(0.9, "clearing the body")
        state, pairs = clear_of_body(stepper, settling.state, model.faces, body.final, config.clear_rounds)
    except DivergedError as error:
        error.partial["draped"] = mesh
        raise
    draped = TriangleMesh(state.positions, model.faces, garment.mesh.colors)
    findings = work.judged(draped, body.final, stepper, state, settling.settled)
    error_mm = 1e3 * settling.error if np.isfinite(settling.error) else None
    work.account()
    job.measure(seconds=time.perf_counter() - began, steps=stepper.steps, error_mm=error_mm, **findings)
    if not settling.settled:
        job.warn(
            f"not at rest: {error_mm:.1f} mm still to come" if error_mm else "not at rest, and too early to say how far"
        )
    if findings["self_intersections"]:
        job.warn(
            f"{findings['self_intersections']} pairs of triangles of the garment cross each other, near "
            f"{_named(findings['self_intersection_places'])}"
        )
    if len(pairs):
        raise IntersectingError(
            f"{len(pairs)} pairs of triangles of garment and body still cross, near "
            f"{_named(findings['body_intersection_places'])}",
            hint="is the garment the right way up, and large enough? a larger skin_mm or more clear_rounds may help",
            partial={"draped": draped, "audit": findings, "trace": tuple(settling.trace)},
        )
    return Draped(draped, state.velocities, None, tuple(settling.trace), findings)


class _Work:
    """The phases of one drape, and what they share."""

    def __init__(self, model: ClothModel, rest: RestShape, fabric: Fabric, config: DrapeConfig, job: Job) -> None:
        self._model = model
        self._rest = rest
        self._fabric = fabric
        self._friction = fabric.friction if config.friction is None else config.friction
        self._skin = default_skin(model.edge_length) if config.skin_mm is None else 1e-3 * config.skin_mm
        self._config = config
        self._job = job
        self._crossed = np.zeros(len(model.mass), np.bool_)
        self._tallies: list[Tally] = []

    def free(self, state: ClothState, body: TriangleMesh | None = None) -> ClothState:
        """Return the cloth where it crosses neither itself nor the body; where it could not be freed, it may go on."""
        if not self._config.self_collision:
            return state
        start = free_start(
            state.positions, self._model.faces, self._rest.positions, self._fabric.thickness, self._job, body
        )
        self._crossed = start.crossed
        if start.pairs == 0:
            return state
        return replace(state, positions=start.positions, velocities=np.zeros_like(state.velocities))

    def collider(self, body: MovingBody) -> tuple[BodyCollider, float]:
        """Return the collider, and how long its motion takes [s]."""
        steps = np.linalg.norm(np.diff(body.keyframes, axis=0), axis=2).max(axis=1, initial=0.0)
        seconds = float(len(steps) * steps.max(initial=0.0) / self._config.body_speed)
        return BodyCollider(body, seconds, self._friction, self._job), seconds

    def stepper(self, model: ClothModel, collider: BodyCollider, damping: float) -> Stepper:
        """Return the cloth among its colliders."""
        made = Stepper(
            model,
            [collider],
            np.full(len(model.mass), self._skin),
            self._config,
            damping=damping,
            max_speed=self._config.max_speed,
            crossed=self._crossed,
            force_all=self._job.force_all,
        )
        if made.self_contact is not None:
            self._tallies.append(made.self_contact.tally)
        return made

    def grow(self, state: ClothState, body: TriangleMesh) -> ClothState:
        """Return the cloth outside the body."""
        mesh = TriangleMesh(state.positions, self._model.faces)
        depth = -float(SurfaceDistance(body).signed(mesh.vertices).distance.min())
        if depth <= 1e-3 * self._config.grow_above_mm:
            self._job.leave_out(
                "growing the body inside the garment", f"no cloth deeper in it than {1e3 * max(depth, 0):.1f} mm"
            )
            return state
        self._job.progress(0.05, "growing the body inside the garment")
        collider, seconds = self.collider(growing(body, mesh, self._job))
        stepper = self.stepper(without_gravity(self._model), collider, _CALM)
        grown = self._march(state, stepper, seconds, 0.05, 0.3, "growing the body inside the garment")
        return at_rest(grown.positions)

    def ride(self, state: ClothState, stepper: Stepper, seconds: float, body: TriangleMesh) -> ClothState:
        """Return the cloth after the body's motion."""
        if seconds == 0.0:
            self._job.leave_out("riding along with the body", "the body is at rest")
            return state
        return self.free(self._march(state, stepper, seconds, 0.3, 0.5, "riding along with the body"), body)

    def settle(self, state: ClothState, stepper: Stepper, deadline: float) -> Settling:
        """Return the cloth at rest, or as near to it as allowed."""

        def watch(done: float, error: float) -> None:
            known = f"{1e3 * error:.2f} mm to come" if np.isfinite(error) else "falling into place"
            self._job.progress(0.5 + 0.4 * done, f"settling: {known}")

        limits = SettleLimits(
            error=1e-3 * self._config.target_error_mm,
            residual=self._config.target_residual,
            seconds=self._config.settle_seconds,
            finest=self._config.finest,
            deadline=deadline,
        )
        return settle(stepper, state, limits, watch)

    def judged(
        self, mesh: TriangleMesh, body: TriangleMesh, stepper: Stepper, state: ClothState, settled: bool
    ) -> dict[str, object]:
        """Return the audit."""
        return audit(
            mesh,
            self._rest,
            body,
            settled=settled,
            energy=elastic_energy(self._model, state.positions),
            residual=stepper.residual(state),
            fabric=self._fabric if knows(self._config) else None,
            friction=self._friction,
            touching=float(stepper.skin.max()) + _JUST,
        )

    def account(self) -> None:
        """Tell what the search for contacts of the cloth with itself took and saved."""
        asked, out, reused = (
            sum(getattr(one, name) for one in self._tallies) for name in ("asked", "out_of_reach", "reused")
        )
        if out + reused > 0:
            self._job.leave_out(
                "self-collision search",
                f"{(out + reused) / asked:.0%} of {asked} questions needed none: the cloth was out of its own reach "
                f"({out}), or an earlier search still held ({reused})",
            )
        if asked > 0:
            self._job.measure(
                self_searches=sum(one.searched for one in self._tallies),
                self_searches_left_out=out + reused,
                self_searches_took_s=sum(one.proof_s + one.search_s for one in self._tallies),
                self_searches_saved_s=sum(one.saved_s for one in self._tallies),
            )

    def _march(
        self, state: ClothState, stepper: Stepper, seconds: float, first: float, last: float, what: str
    ) -> ClothState:
        end = state.time + seconds
        while state.time < end - 1e-9:
            state = stepper.run(state, min(0.1, end - state.time))
            self._job.progress(last - (last - first) * (end - state.time) / seconds, what)
        return state


def _named(places: object) -> str:
    """Name some places [m] of those that the judge lists."""
    assert isinstance(places, list)
    chosen = [places[k] for k in np.unique(np.linspace(0, len(places) - 1, _SHOWN).astype(int))] if places else []
    return ", ".join(f"({x:.2f}, {y:.2f}, {z:.2f})" for x, y, z in chosen)
