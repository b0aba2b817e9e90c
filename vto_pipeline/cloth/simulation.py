"""Simulation of cloth among simple colliders, for Python users and benches."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from vto_pipeline.cloth.collision.body.contacts import BodyCollider
from vto_pipeline.cloth.collision.contacts import Collider
from vto_pipeline.cloth.collision.shapes.colliders import Box, Capsule, Ellipsoid, MeshCollider, Plane, Sphere
from vto_pipeline.cloth.collision.shapes.moving import Moving
from vto_pipeline.cloth.dynamics.residual import elastic_energy
from vto_pipeline.cloth.dynamics.step_length import run_at_own_pace
from vto_pipeline.cloth.dynamics.step_refinement import refine_time_step
from vto_pipeline.cloth.dynamics.stepper import Pins, StepConfig, Stepper
from vto_pipeline.cloth.model.build import at_rest, build_cloth
from vto_pipeline.cloth.model.materials import Materials
from vto_pipeline.cloth.model.settings import checked
from vto_pipeline.cloth.placement.collapsed_start import expand_collapsed_triangles
from vto_pipeline.cloth.placement.collision_free_start import find_collision_free_start
from vto_pipeline.cloth.rest.convergence import SettleLimits, relax_to_rest
from vto_pipeline.errors import ConfigError, InputError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.cloth import TraceRow
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.cpu_threads import limited_threads
from vto_pipeline.units import GRAVITY

_REST_MM = 0.1  # error at rest that is asked for when nobody says
_BALANCED = 0.01  # left-over force at rest, as a share of weight

AnyCollider = Sphere | Capsule | Ellipsoid | Box | Plane | MeshCollider | Moving


class SimulateConfig(StepConfig, Materials):
    """Settings of `simulate`."""

    until: str = Field(
        "time", pattern="^(time|rest)$", description='"time" runs all `seconds`; "rest" stops at equilibrium'
    )
    target_error_mm: float | None = Field(
        None,
        gt=0,
        le=100,
        description="Rms error to reach [mm]. Until rest: the predicted motion, by default 0.1. Until time: the "
        "change when steps are halved, by default not checked",
    )
    time_budget_s: float | None = Field(
        None, gt=0, description="Wall time within which steps are halved [s]; none by default"
    )
    threads: int | None = Field(None, ge=1, le=1024, description="Threads; all cores by default")
    finest: int = Field(320, ge=1, le=100000, description="Most steps per 1/60 s that refinement may reach")
    pin_compliance: float | None = Field(
        None, gt=0, le=1, description="How far a pin gives way under a force [m/N]; pins are rigid by default"
    )
    damping: float = Field(0.0, ge=0, le=1000, description="Decay rate of velocities [1/s]")
    skin_mm: float | None = Field(
        None, gt=0, le=100, description="Distance kept from colliders [mm]; by default a quarter of an edge, 1 to 3 mm"
    )
    force_all: bool = Field(False, description="Leave no work out, for comparison")
    gravity: tuple[float, float, float] = Field((0.0, -GRAVITY, 0.0), description="Gravity [m/s²]")


@dataclass(frozen=True)
class Trajectory:
    """Where a simulation ended.

    Args:
        positions: [m], shape (V, 3).
        velocities: [m/s], shape (V, 3).
        report: seconds (wall), prepare_s (what the method made before), method, reason, substeps (usual), steps,
            contact_rounds, simulated_s, energy_j, residual; with "rest" settled; error_mm where it is known; where the
            cloth is kept from itself start_pairs (of triangles that met), start_left (that still did after untangling)
            and self_contact (see `collision.self_collision.counters.CollisionCounters`); warnings, where anything is
            left.
        trace: Error against run time, where it is known.
    """

    positions: FloatArray
    velocities: FloatArray
    report: Mapping[str, object]
    trace: Sequence[TraceRow] = field(default=())


def simulate(
    mesh: TriangleMesh,
    fabric: Fabric,
    *,
    rest: ArrayLike | None = None,
    pinned: Sequence[int] = (),
    pin_path: Callable[[float], FloatArray] | None = None,
    colliders: Sequence[AnyCollider] = (),
    seconds: float,
    settings: Mapping[str, object] | SimulateConfig | None = None,
) -> Trajectory:
    """Let a cloth move under gravity.

    Args:
        mesh: Where it starts [m].
        fabric: What it is made of.
        rest: Rest positions [m], shape (V, 3); the start when None. Flat rest angles.
        pinned: Vertices held where they are, or led.
        pin_path: Where those are at a time [s], in their order: [m], shape (P, 3). Where they start when None. Not for
            pins that give way.
        colliders: What it may lie on.
        seconds: Simulated time; with until "rest" the limit [s].
        settings: Keys of `SimulateConfig`.

    Raises:
        ConfigError: an unknown setting, a value out of range, or settings that do not go together.
        InputError: sizes that do not match, an impossible fabric, or no length of time.
        DivergedError: positions are no longer finite.
    """
    config = checked(SimulateConfig, settings)
    if not 0.0 <= seconds < np.inf:
        raise InputError(f"seconds is {seconds}; expected a time of zero or more")
    shape = RestShape(mesh.vertices if rest is None else np.asarray(rest, dtype=np.float64))
    if config.pin_compliance is not None and pin_path is not None:
        raise ConfigError("pin_compliance is set, and pins on a path do not give way", hint="leave out one of them")
    model = build_cloth(
        mesh,
        shape,
        fabric,
        pinned=tuple(pinned),
        pin_compliance=config.pin_compliance,
        gravity=config.gravity,
        materials=config,
    )
    skin = default_skin(model.edge_length) if config.skin_mm is None else 1e-3 * config.skin_mm
    job = Job(force_all=config.force_all)
    shapes = [_collider(one, job) for one in colliders]
    skins = np.full(len(mesh.vertices), skin)
    positions, crossed = expand_collapsed_triangles(mesh.vertices, shape.positions, mesh.faces, pinned), None
    report: dict[str, object] = {}
    if config.self_collision:
        start = find_collision_free_start(positions, mesh.faces, shape.positions, fabric.thickness, job)
        positions, crossed = start.positions, start.crossed
        report.update(start_pairs=start.crossings, start_left=start.crossings_left)
    state = at_rest(positions)
    pins = None if pin_path is None else Pins(np.asarray(pinned, dtype=np.int64), pin_path)

    def make(substeps: float | None) -> Stepper:
        finer = config if substeps is None else config.model_copy(update={"substeps": substeps})
        return Stepper(
            model,
            shapes,
            skins,
            finer,
            damping=config.damping,
            pins=pins,
            crossed=crossed,
            force_all=config.force_all,
        )

    trace: Sequence[TraceRow] = ()
    with limited_threads(config.threads):
        preparing = time.perf_counter()
        stepper = make(None)
        stepper.prepare(state.positions)
        began = time.perf_counter()
        deadline = np.inf if config.time_budget_s is None else began + config.time_budget_s
        if config.until == "rest":
            error = 1e-3 * (_REST_MM if config.target_error_mm is None else config.target_error_mm)
            settling = relax_to_rest(stepper, state, SettleLimits(error, _BALANCED, seconds, config.finest, deadline))
            state, trace = settling.state, settling.trace
            report.update(settled=settling.settled, error_mm=1e3 * settling.error)
        elif config.target_error_mm is None and config.time_budget_s is None:
            state = run_at_own_pace(stepper, state, seconds)
        else:
            error = 0.0 if config.target_error_mm is None else 1e-3 * config.target_error_mm
            refined = refine_time_step(make, state, seconds, error=error, finest=config.finest, deadline=deadline)
            state, stepper, trace = refined.state, refined.stepper, refined.trace
            report.update(error_mm=1e3 * refined.error)
    report.update(
        seconds=time.perf_counter() - began,
        prepare_s=began - preparing,
        method=stepper.choice.method,
        reason=stepper.choice.reason,
        substeps=stepper.substeps,
        steps=stepper.steps,
        contact_rounds=stepper.contact_spans,
        simulated_s=state.time,
        energy_j=elastic_energy(model, state.positions),
        residual=stepper.residual(state),
    )
    if stepper.self_contact is not None:
        counters = stepper.self_contact.counters
        if counters.uncut:
            job.warn(f"{counters.uncut} contact pairs remain where nothing could give way")
        report.update(self_contact=counters.as_report())
    report.update(warnings=tuple(job.warnings))
    return Trajectory(state.positions, state.velocities, report, trace)


def default_skin(edge_length: float) -> float:
    """Return the distance to keep from surfaces [m]: a quarter edge, at least 1 and at most 3 mm.

    An edge l over a body of radius r sags l²/8r between its ends: at 10 mm over a wrist (30 mm), 0.4 mm.
    """
    return float(np.clip(0.25 * edge_length, 1e-3, 3e-3))


def _collider(shape: AnyCollider, job: Job) -> Collider:
    if isinstance(shape, MeshCollider):
        mesh = shape.mesh
        body = mesh if isinstance(mesh, MovingBody) else MovingBody(mesh.vertices[None], mesh.faces)
        return BodyCollider(body, shape.seconds, shape.friction, job)
    if isinstance(shape, Moving) and isinstance(shape.shape, MeshCollider):
        return Moving(_collider(shape.shape, job), shape.path)
    return shape
