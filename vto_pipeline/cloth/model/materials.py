"""Constraints of a fabric."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from vto_pipeline.cloth.constraints.bending.bend_friction import bend_friction
from vto_pipeline.cloth.constraints.bending.hinge import bend, solid_hinges
from vto_pipeline.cloth.constraints.bending.isometric import isometric_bend
from vto_pipeline.cloth.constraints.bending.shape_operator import shape_operator
from vto_pipeline.cloth.constraints.mass_spring import bending_springs, membrane_springs
from vto_pipeline.cloth.constraints.membrane.curve import curve
from vto_pipeline.cloth.constraints.membrane.green import green
from vto_pipeline.cloth.constraints.membrane.strain_friction import strain_friction
from vto_pipeline.cloth.constraints.membrane.strain_limit import strain_limit
from vto_pipeline.cloth.constraints.membrane.stretch import stretch
from vto_pipeline.errors import ConfigError
from vto_pipeline.model.fabric import Fabric, StretchCurve
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config
from vto_pipeline.numerics.mechanics.monotone_curve import MonotoneCurve, monotone_curve


class Materials(Config):
    """How a fabric is modelled."""

    membrane: Literal["threads", "green", "springs", "curve"] = Field(
        "threads",
        description="In-plane model: threads (stretch of warp and weft, and their angle), green (Green-Lagrange "
        "strain), springs (mass-spring net), curve (measured stretch curves)",
    )
    bending: Literal["shape_operator", "hinge", "isometric", "springs", "none"] = Field(
        "shape_operator",
        description="Bending model: shape_operator (triangle curvatures; converges on any mesh), hinge (edge angles), "
        "isometric (quadratic; flat rest shapes only), springs (second neighbours), none",
    )
    strain_limit: float | None = Field(
        None, gt=0, le=1, description="Strain at which warp and weft lock; none by default"
    )
    beyond_limit: float = Field(
        20.0, ge=1, le=1e6, description="Stiffness beyond the strain limit, in multiples of the fabric's"
    )
    hysteresis: bool = Field(False, description="Whether the fabric's internal friction (2HB, 2HG) keeps some folds")
    slip_curvature: float = Field(
        5.0, gt=0, le=1000, description="Change of curvature at which bending friction slips [1/m]"
    )
    slip_strain: float = Field(
        0.005, gt=0, le=1, description="Change of strain at which stretch and shear friction slips"
    )
    yield_curvature: float | None = Field(
        None, gt=0, le=1e5, description="Curvature beyond which creases stay (plastic) [1/m]; none by default"
    )
    hardening: float = Field(0.5, ge=0.01, le=0.99, description="Share of the bending rigidity left beyond it")
    rayleigh: float | None = Field(
        None, ge=0, le=10, description="Rayleigh damping β, proportional to stiffness [s]; by default the fabric's"
    )


def fabric_constraints(
    mesh: TriangleMesh,
    rest: RestShape,
    fabric: Fabric,
    materials: Materials,
    job: Job,
    held: NDArray[np.int64] | tuple[int, ...] = (),
) -> tuple[Any, ...]:
    """Return the constraints of a sheet of this fabric, those without effect left out.

    Args:
        mesh: Its triangles.
        rest: Its shape without forces.
        fabric: Its stiffnesses.
        materials: Which model.
        job: For what was left out.
        held: Vertices held where they are.

    Raises:
        ConfigError: a model that this fabric or rest shape does not allow.
        InputError: the fabric is not a stable material.
    """
    damping = fabric.damping if materials.rayleigh is None else materials.rayleigh
    made = (
        *_bending(mesh, rest, fabric, materials, damping, job, held),
        *_membrane(mesh, rest, fabric, materials, damping, job),
    )
    return tuple(data for data in made if len(data.vertices))


def _bending(
    mesh: TriangleMesh,
    rest: RestShape,
    fabric: Fabric,
    materials: Materials,
    damping: float,
    job: Job,
    held: NDArray[np.int64] | tuple[int, ...],
) -> Iterator[Any]:
    if materials.bending == "none":
        job.leave_out("hinges", "bending is switched off")
        return
    if not (fabric.bending_warp > 0.0 or fabric.bending_weft > 0.0 or job.force_all):
        job.leave_out("hinges", "the fabric does not resist bending")
        return
    if materials.bending == "isometric" and rest.rest_angles:
        raise ConfigError("isometric bending needs a flat rest shape", hint="set bending: hinge, or rest_angles: false")
    plastic = 0.0 if materials.yield_curvature is None else 1.0 - materials.hardening
    lasting = replace(
        fabric,
        bending_warp=(1.0 - plastic) * fabric.bending_warp,
        bending_weft=(1.0 - plastic) * fabric.bending_weft,
    )
    if materials.bending == "hinge":
        yield bend(mesh, rest, lasting, damping)
    elif materials.bending == "shape_operator":
        yield shape_operator(mesh, rest, lasting, held=held, damping=damping)
    elif materials.bending == "isometric":
        yield isometric_bend(mesh, rest, lasting, damping)
    else:
        yield bending_springs(mesh, rest, lasting, damping)
    solid = solid_hinges(mesh, rest)
    if materials.yield_curvature is not None:
        stiffness = plastic * solid.stiffness(fabric)
        limit = stiffness * materials.yield_curvature * solid.area / solid.length
        yield bend_friction(solid, rest, stiffness, limit)
    if materials.hysteresis and fabric.bending_hysteresis > 0.0:
        moment = 0.5 * fabric.bending_hysteresis  # per width, to either side
        stiffness = moment / materials.slip_curvature * solid.length**2 / solid.area
        yield bend_friction(solid, rest, stiffness, moment * solid.length)
    elif materials.hysteresis:
        job.leave_out("friction of bending", "the fabric has no bending hysteresis")


def _membrane(
    mesh: TriangleMesh, rest: RestShape, fabric: Fabric, materials: Materials, damping: float, job: Job
) -> Iterator[Any]:
    faces = mesh.faces
    if materials.membrane == "threads":
        yield stretch(faces, rest, fabric, damping)
    elif materials.membrane == "green":
        yield green(faces, rest, fabric, damping)
    elif materials.membrane == "springs":
        yield membrane_springs(mesh, rest, fabric, damping)
    else:
        warp = _curve(fabric.curve_warp, fabric.stretch_warp, "warp", job)
        weft = _curve(fabric.curve_weft, fabric.stretch_weft, "weft", job)
        yield curve(faces, rest, warp, weft, fabric.shear, damping)
    if materials.strain_limit is None:
        job.leave_out("strain limits", "none is set")
    else:
        limits = (materials.strain_limit, materials.strain_limit, np.inf)
        stiffness = materials.beyond_limit * np.array([fabric.stretch_warp, fabric.stretch_weft, fabric.shear])
        yield strain_limit(faces, rest, limits, 1.0 / stiffness, damping)
    if materials.hysteresis and max(fabric.stretch_hysteresis, fabric.shear_hysteresis) > 0.0:
        # a loop as wide as the loss has the slider's force to either side
        forces = 0.5 * np.array([fabric.stretch_hysteresis, fabric.stretch_hysteresis, fabric.shear_hysteresis])
        yield strain_friction(faces, rest, materials.slip_strain, forces)
    elif materials.hysteresis:
        job.leave_out("friction of stretch and shear", "the fabric has no hysteresis in its plane")


def _curve(measured: StretchCurve | None, stiffness: float, name: str, job: Job) -> MonotoneCurve:
    if measured is None:
        job.note(f"no stretch curve of the {name} was measured; a straight one is assumed")
        return monotone_curve([0.0, 1.0], [0.0, stiffness])
    return monotone_curve(measured.strain, measured.tension)
