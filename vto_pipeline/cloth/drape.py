"""A garment on a body, at rest."""

from __future__ import annotations

import time
from collections.abc import Mapping

import numpy as np

from vto_pipeline.cloth.drape_config import DrapeConfig
from vto_pipeline.cloth.dynamics.body_motion import body_travel
from vto_pipeline.cloth.dynamics.residual import elastic_energy
from vto_pipeline.cloth.dynamics.warm_up import warm_up
from vto_pipeline.cloth.judge.audit import audit
from vto_pipeline.cloth.judge.elsewhere import warn_if_elsewhere
from vto_pipeline.cloth.judge.limits import warn_beyond_limits
from vto_pipeline.cloth.judge.residual import covers_all_energies
from vto_pipeline.cloth.judge.too_small import warn_if_too_small
from vto_pipeline.cloth.judge.turned_up import warn_if_turned_up
from vto_pipeline.cloth.model.settings import checked
from vto_pipeline.cloth.placement.clear_body import OVERSTRETCHED
from vto_pipeline.cloth.placement.place import place_garment
from vto_pipeline.cloth.placement.transfer import transfer_deformation
from vto_pipeline.cloth.rest.multiresolution import come_to_rest
from vto_pipeline.errors import DivergedError, FallenError, IntersectingError, JammedError
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.cloth import Draped, seconds_within
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import Garment, RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

_SHOWN = 5  # places named in a message
_AGREES = 3.0  # times the residual force that was asked for: the judge has its own view of what bodies bear


def drape(
    garment: Garment | TriangleMesh,
    body: MovingBody | TriangleMesh,
    fabric: Fabric,
    settings: DrapeConfig | Mapping[str, object] | None = None,
    job: Job | None = None,
) -> Draped:
    """Drape a garment on a body.

    When the body moves, the garment is where its first keyframe has it and rides along; where the body changes much,
    the garment is reshaped with it instead and starts on the body as it ends. When the body is at rest, the garment is
    put in its place first: unit, axes, shift. Where it then cuts deep into the body, the body grows inside it, from the
    thickest that it can be untangled from; where even the thinnest would cross it, the garment is led about the body
    first. Where the garment crosses itself, it is untangled before. Then all settles under gravity, and a last pass
    takes the remaining crossings with the body out.

    Args:
        garment: The simulation mesh where it is now, and its rest shape; a mesh alone is its own rest shape.
        body: What it lies on.
        fabric: What it is made of.
        settings: Keys of `DrapeConfig`.
        job: For progress, findings and what was left out.

    Returns:
        The garment at its end, the trace of the settling, and the audit.

    Raises:
        ConfigError: an unknown setting or a value out of range.
        InputError: the garment is none for a body of this size, in whatever unit, or the fabric no material.
        IntersectingError: triangles still cross; `partial` holds the mesh as "draped", "audit" and "trace". Or a limb
            goes through cloth from the start; it holds the start as "draped".
        JammedError: cloth is held between contacts, stretched as none can be; `partial` holds the same.
        DivergedError, FallenError: positions are no longer finite, or it fell off the body; `partial` holds the mesh as
            it began, as "draped".
    """
    config, job = checked(DrapeConfig, settings), job or Job()
    if isinstance(garment, TriangleMesh):
        garment = Garment(garment, RestShape(garment.vertices))
    if isinstance(body, TriangleMesh):
        body = MovingBody(body.vertices[None], body.faces)
    began = time.perf_counter()
    deadline = np.inf if config.time_budget_s is None else began + config.time_budget_s
    garment, body = _starting_positions(
        garment, body, config, job
    )  # a garment that is refused need not wait for the compiler
    job.progress(0.0, "compiling the kernels")
    compile_s = warm_up()
    job.measure(compile_s=compile_s, mode=garment.rest.worn_as)
    began += compile_s  # counts for the budget, but not for how fast the drape is
    mesh = garment.mesh
    try:
        reached = come_to_rest(garment, body, fabric, config, job, deadline)
    except (DivergedError, FallenError) as error:
        error.partial["draped"] = mesh
        raise
    model, stepper, settling = reached.model, reached.stepper, reached.settling
    state = settling.state
    draped = TriangleMesh(state.positions, model.faces, mesh.colors)
    findings = {
        "mode": garment.rest.worn_as,
        **audit(
            draped,
            garment.rest,
            body.final,
            settled=settling.settled,
            energy=elastic_energy(model, state.positions),
            residual=stepper.residual(state),
            fabric=fabric if covers_all_energies(config) else None,
            bending=config.bending,
            friction=config.friction,
            skin=stepper.skin,
        ),
        **warn_if_too_small(draped, garment.rest, config.stretch_limit, job),
        **warn_beyond_limits(draped, garment.rest, fabric, job),
        **warn_if_turned_up(draped, job),
        **(warn_if_elsewhere(mesh, draped, garment.rest, body.final, job) if len(body.keyframes) == 1 else {}),
    }
    judged = findings.get("judged_residual")
    if settling.settled and isinstance(judged, float) and judged > _AGREES * config.target_residual:
        findings["settled"] = False
        job.warn(f"not at rest: the judge finds a residual force of {judged:.2g} of the weight")
    reached.phases.report_collision_work(reached.before)
    job.measure(
        seconds=time.perf_counter() - began,
        steps=stepper.steps,
        error_mm=settling.error_mm,
        within_1_mm_s=seconds_within(settling.trace, 1.0),
        **findings,
    )
    if not settling.settled:
        job.warn(settling.not_settled_warning)
    partial = {"draped": draped, "audit": findings, "trace": tuple(settling.trace)}
    refuse_crossings(findings, partial)
    if settling.jammed:
        refuse_overstretched(findings, partial)
    return Draped(draped, state.velocities, None, tuple(settling.trace), findings)


def _starting_positions(
    garment: Garment, body: MovingBody, config: DrapeConfig, job: Job
) -> tuple[Garment, MovingBody]:
    """Return garment and body as the simulation starts."""
    start = TriangleMesh(body.keyframes[0], body.faces)
    if len(body.keyframes) == 1:
        return place_garment(garment, start, config, job), body
    travel = 1e3 * body_travel(body, garment.mesh)
    if travel <= config.ride_up_to_mm:
        job.note(f"the body under the garment changes by up to {travel:.0f} mm; the garment moves along with it")
        return garment, body
    job.note(
        f"the body under the garment changes by up to {travel:.0f} mm; the garment starts reshaped on the final body"
    )
    reshaped = TriangleMesh(
        transfer_deformation(garment.mesh, start, body.final), garment.mesh.faces, garment.mesh.colors
    )
    return Garment(reshaped, garment.rest), MovingBody(body.keyframes[-1:], body.faces)


def refuse_crossings(findings: Mapping[str, object], partial: Mapping[str, object]) -> None:
    """Raise an error if anything still crosses, with the places.

    Args:
        findings: Of an audit: pairs and places of each kind of crossing.
        partial: What was reached, artifact -> value.

    Raises:
        IntersectingError: something does.
    """
    kinds = {"body": "garment and body", "self": "the garment with itself", "layer": "one garment and another"}
    crossing = [
        f"{findings[f'{kind}_intersections']} pairs of triangles of {what} still cross, near "
        f"{format_places(findings[f'{kind}_intersection_places'])}"
        for kind, what in kinds.items()
        if findings.get(f"{kind}_intersections")
    ]
    if crossing:
        raise IntersectingError(
            "; ".join(crossing),
            hint="check that the garment is the right way up and large enough; or raise skin_mm or clear_rounds",
            partial=partial,
        )


def refuse_overstretched(findings: Mapping[str, object], partial: Mapping[str, object]) -> None:
    """Raise an error if jammed cloth is stretched as none can be: that is no rest, and no picture of how it fits.

    Args:
        findings: Of an audit: the largest stretch beyond rest, and the residual force as a share of weight.
        partial: What was reached, artifact -> value.

    Raises:
        JammedError: it is.
    """
    stretch, residual = findings["max_stretch"], findings["residual"]
    assert isinstance(stretch, float)
    if 1.0 + stretch > OVERSTRETCHED:
        raise JammedError(
            f"the cloth is jammed: forces of {residual:.0f} times its weight, stretched by up to {stretch:.0%}",
            hint="it is too small for this body, or was put on it in a wrong place: look at what was reached",
            partial=partial,
        )


def format_places(places: object) -> str:
    """Return some of the places [m] of an audit as text."""
    assert isinstance(places, list)
    chosen = [places[k] for k in np.unique(np.linspace(0, len(places) - 1, _SHOWN).astype(int))] if places else []
    return ", ".join(f"({x:.2f}, {y:.2f}, {z:.2f})" for x, y, z in chosen)
