"""Cloth among simple colliders, from Python: what benches and outside checks call."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from vto_pipeline.cloth.balance import elastic_energy
from vto_pipeline.cloth.build import at_rest, build
from vto_pipeline.cloth.collision.body import BodyCollider
from vto_pipeline.cloth.collision.contacts import Collider
from vto_pipeline.cloth.collision.shapes import Capsule, MeshCollider, Plane, Sphere
from vto_pipeline.cloth.settings import checked
from vto_pipeline.cloth.settle import SettleLimits, settle
from vto_pipeline.cloth.stepper import StepConfig, Stepper
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.cloth import TraceRow
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.threads import limited_threads
from vto_pipeline.units import GRAVITY

AnyCollider = Sphere | Capsule | Plane | MeshCollider


class SimulateConfig(StepConfig):
    """Settings of `simulate`."""

    until: str = Field(
        "time", pattern="^(time|rest)$", description='"time": run all `seconds`; "rest": stop at equilibrium'
    )
    target_error_mm: float = Field(
        0.1, gt=0, le=100, description="Predicted motion at which the cloth is at rest, rms [mm]"
    )
    time_budget_s: float | None = Field(None, gt=0, description="Wall time after which to stop [s]; none by default")
    threads: int | None = Field(None, ge=1, le=1024, description="Threads; all cores by default")
    finest: int = Field(320, ge=1, le=100000, description="Steps per 1/60 s that are not refined further, with rest")
    damping: float = Field(0.0, ge=0, le=1000, description="Rate at which velocities fade [1/s]")
    skin_mm: float | None = Field(
        None, gt=0, le=100, description="Distance kept from colliders [mm]; by default a quarter edge, 1 to 3 mm"
    )
    gravity: tuple[float, float, float] = Field((0.0, -GRAVITY, 0.0), description="[m/s²]")


@dataclass(frozen=True)
class Trajectory:
    """Where a simulation ended.

    Args:
        positions: [m], shape (V, 3).
        velocities: [m/s], shape (V, 3).
        report: seconds (wall), steps, contact_rounds, simulated_s, energy_j, residual, and with "rest" settled and
            error_mm.
        trace: Error against run time, with "rest".
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
    colliders: Sequence[AnyCollider] = (),
    seconds: float,
    settings: Mapping[str, object] | SimulateConfig | None = None,
) -> Trajectory:
    """Let a cloth move under gravity.

    Args:
        mesh: Where it starts [m].
        fabric: What it is made of.
        rest: Rest positions [m], shape (V, 3); the start when None. Flat rest angles.
        pinned: Vertices held where they are.
        colliders: What it may lie on.
        seconds: Simulated time; with until "rest" the limit [s].
        settings: Keys of `SimulateConfig`.

    Raises:
        ConfigError: an unknown setting or a value out of range.
        InputError: sizes that do not match, or an impossible fabric.
        DivergedError: positions are no longer finite.
    """
    config = checked(SimulateConfig, settings)
    shape = RestShape(mesh.vertices if rest is None else np.asarray(rest, dtype=np.float64))
    model = build(mesh, shape, fabric, pinned=tuple(pinned), gravity=config.gravity)
    skin = default_skin(model.edge_length) if config.skin_mm is None else 1e-3 * config.skin_mm
    stepper = Stepper(
        model,
        [_collider(one) for one in colliders],
        np.full(len(mesh.vertices), skin),
        config,
        damping=config.damping,
    )
    state = at_rest(mesh.vertices)
    began = time.perf_counter()
    report: dict[str, object] = {}
    trace: Sequence[TraceRow] = ()
    with limited_threads(config.threads):
        if config.until == "rest":
            limits = SettleLimits(
                error=1e-3 * config.target_error_mm,
                residual=0.0,
                seconds=seconds,
                finest=config.finest,
                deadline=np.inf if config.time_budget_s is None else began + config.time_budget_s,
            )
            settling = settle(stepper, state, limits)
            state, trace = settling.state, settling.trace
            report.update(settled=settling.settled, error_mm=1e3 * settling.error)
        else:
            state = stepper.run(state, seconds)
    report.update(
        seconds=time.perf_counter() - began,
        steps=stepper.steps,
        contact_rounds=stepper.rounds,
        simulated_s=state.time,
        energy_j=elastic_energy(model, state.positions),
        residual=stepper.residual(state),
    )
    return Trajectory(state.positions, state.velocities, report, trace)


def default_skin(edge_length: float) -> float:
    """Return the distance to keep from surfaces [m]: a quarter edge, at least 1 and at most 3 mm.

    An edge l over a body of radius r sags l²/8r between its ends: at 10 mm over a wrist (30 mm), 0.4 mm.
    """
    return float(np.clip(0.25 * edge_length, 1e-3, 3e-3))


def _collider(shape: AnyCollider) -> Collider:
    if isinstance(shape, MeshCollider):
        return BodyCollider(MovingBody(shape.mesh.vertices[None], shape.mesh.faces), 0.0, shape.friction)
    return shape
