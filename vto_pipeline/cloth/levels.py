"""Coarse to fine: a garment comes to rest on coarser meshes of itself first, where the way is cheap.

A step costs more than in proportion to the vertices, and a fine mesh has as far to go as a coarse one. So what is a
matter of the way (the body growing, riding along, falling into place) is done once, on the coarsest mesh. Each finer
one starts from where the one before lies and has no more to settle than what that one could not show: smaller folds,
and the stiffness of its own triangles. After Zhang, Dumas, Fei, Jacobson, James & Kaufman 2022, "Progressive simulation
for cloth quasistatics".
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import NamedTuple

from vto_pipeline.cloth.build import ClothModel, at_rest, build
from vto_pipeline.cloth.coarser import Coarser, coarser
from vto_pipeline.cloth.drape_config import DrapeConfig
from vto_pipeline.cloth.phases import Phases
from vto_pipeline.cloth.settle import Settling
from vto_pipeline.cloth.stepper import Stepper
from vto_pipeline.errors import GarmentError, InputError
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.cloth import TraceRow
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import Garment
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

_FEWER = 4  # times fewer vertices on the next coarser mesh: edges twice as long
_FIRST = 0.5  # of the progress, and of the time there is: the coarser meshes


class Reached(NamedTuple):
    """How a garment came to rest on one mesh.

    Args:
        model: The cloth.
        phases: What it went through.
        stepper: The cloth among its colliders.
        settling: How it went.
    """

    model: ClothModel
    phases: Phases
    stepper: Stepper
    settling: Settling


def come_to_rest(
    garment: Garment, body: MovingBody, fabric: Fabric, config: DrapeConfig, job: Job, deadline: float
) -> Reached:
    """Return the garment at rest on the body as it ends; the trace begins with those of the coarser meshes.

    Args:
        garment: Where it starts, about the body as it begins.
        body: What it lies on.
        fabric: What it is made of.
        config: All settings.
        job: For progress, findings and what was left out.
        deadline: `time.perf_counter` at which to stop settling.

    Raises:
        InputError, ConfigError: as `build` and `Stepper.prepare`.
        DivergedError: positions are no longer finite.
    """
    began = time.perf_counter()
    model = build(garment.mesh, garment.rest, fabric, materials=config, job=job)
    ladder = _ladder(garment, config.coarsen_above, job)
    trace: list[TraceRow] = []
    start = ladder[-1].garment if ladder else garment
    for level in range(len(ladder), 0, -1):
        coarse = build(start.mesh, start.rest, fabric, materials=config)
        count, part = len(start.mesh.vertices), _part(job, 1 - level / len(ladder), 1 / len(ladder))
        now = time.perf_counter()
        found = _settled(coarse, start, body, fabric, config, part, now + _FIRST * (deadline - now), began, level)
        trace += found.settling.trace
        job.warnings += [f"on {count} vertices: {text}" for text in part.warnings]
        job.note(
            f"came to rest on {count} vertices first: {time.perf_counter() - now:.1f} s, {found.stepper.steps} steps"
        )
        finer = ladder[level - 2].garment if level > 1 else garment
        x = ladder[level - 1].finer(found.settling.state.positions)
        start = Garment(TriangleMesh(x, finer.mesh.faces), finer.rest)
        body = MovingBody(body.keyframes[-1:], body.faces)
    reached = _settled(model, start, body, fabric, config, job, deadline, began, 0)
    reached.settling.trace[:0] = trace
    return reached


def _ladder(garment: Garment, most: int, job: Job) -> list[Coarser]:
    """Return the coarser garments, each of a quarter of the vertices, until one has no more than `most`."""
    made: list[Coarser] = []
    what = "coming to rest on a coarser mesh first"
    while (count := len(garment.mesh.vertices)) > most:
        try:
            made.append(coarser(garment, count // _FEWER))
        except (InputError, GarmentError) as error:
            job.leave_out(what, f"{count} vertices cannot be made {count // _FEWER}: {error.problem}")
            return made
        garment = made[-1].garment
    if not made:
        job.leave_out(what, f"{count} vertices, and it pays above {most} (coarsen_above)")
    return made


def _part(job: Job, done: float, share: float) -> Job:
    """Return a job whose progress is a part of the first half of the whole one's."""
    return Job(
        lambda part, text: job.progress(_FIRST * (done + share * part), f"on a coarser mesh: {text}"),
        job.scratch,
        job.seed,
        job.force_all,
    )


def _settled(
    model: ClothModel,
    garment: Garment,
    body: MovingBody,
    fabric: Fabric,
    config: DrapeConfig,
    job: Job,
    deadline: float,
    began: float,
    level: int,
) -> Reached:
    """Return the garment at rest on one mesh."""
    phases = Phases(model, garment.rest, fabric, config, job)
    first = TriangleMesh(body.keyframes[0], body.faces)
    state = phases.free(at_rest(garment.mesh.vertices))
    state = phases.free(phases.grow(state, first), first)
    collider = phases.collider(body, TriangleMesh(state.positions, model.faces))
    stepper = phases.stepper(model, collider, config.damping)
    stepper.prepare(state.positions)
    job.note(f"{stepper.choice.method}, {stepper.substeps} steps per 1/60 s: {stepper.choice.reason}")
    state = phases.ride(state, stepper, collider, body.final)
    before = time.perf_counter() - began
    settling = phases.settle(state, stepper, body.final, deadline)
    settling.trace = [replace(row, seconds=before + row.seconds, level=level) for row in settling.trace]
    return Reached(model, phases, stepper, settling)
