"""Hanging and swinging: chains and strips under their weight, the catenary, the pendulum."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from vto_pipeline.bench.bench import Row, Watch
from vto_pipeline.bench.physics.cantilever import MESHES
from vto_pipeline.bench.physics.closed_forms import catenary, hanging_strip, pendulum_period
from vto_pipeline.bench.physics.refinement import RefinementCase, refined
from vto_pipeline.cloth.collision.contacts import empty_contacts
from vto_pipeline.cloth.constraints.points.spring import springs
from vto_pipeline.cloth.integrators import INTEGRATORS
from vto_pipeline.cloth.model.build import ClothModel, ClothState, build_cloth, model_of
from vto_pipeline.cloth.model.materials import Materials
from vto_pipeline.cloth.model.settings import checked
from vto_pipeline.cloth.rest.equilibrium import EquilibriumConfig, equilibrium
from vto_pipeline.cloth.solvers import SOLVERS
from vto_pipeline.cloth.swatch.meshes import MeshKind, strip
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.units import GRAVITY

_LENGTH, _WEIGHT = 1.0, 1.0  # of a chain [m], [N]
_SLACK = 1.5  # length of the catenary over its span


def hanging_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """All scenes of this file."""
    counts = (8, 16, 32, 64) if quick else (8, 16, 32, 64, 128)
    yield from refined(watch, "hanging chain", "springs", {}, "edges", counts, _hanging_chain)
    for kind in MESHES:
        make = partial(_hanging_strip, kind)
        yield from refined(watch, "hanging strip", "threads", {"mesh": kind}, "edges", (5, 10, 20, 40), make)
    yield from refined(watch, "catenary", "springs", {}, "edges", counts, _catenary)
    counts = (200, 400, 800, 1600) if quick else (200, 400, 800, 1600, 3200)
    for method in ("xpbd", "newton", "bdf2"):
        yield from refined(watch, "pendulum 90°", method, {}, "steps", counts, partial(_pendulum, method))


def _chain(points: FloatArray, stiffness: float, pinned: list[int], rest: float) -> ClothModel:
    """Return equal links with half masses at the ends."""
    count = len(points) - 1
    mass = np.full(count + 1, _WEIGHT / GRAVITY / count)
    mass[[0, -1]] *= 0.5
    pairs = np.column_stack([np.arange(count), np.arange(1, count + 1)])
    return model_of((springs(pairs, points, 1.0 / (stiffness * count), rest=rest),), mass, pinned=pinned)


def _hanging_chain(count: int) -> RefinementCase:
    points = np.zeros((count + 1, 3))
    points[:, 1] = -np.linspace(0.0, _LENGTH, count + 1)
    model = _chain(points, 20.0, [0], _LENGTH / count)

    def run() -> dict[str, float]:
        found = equilibrium(model, points, EquilibriumConfig(tolerance=1e-11)).positions
        return {"length_share": abs((-found[-1, 1] - _LENGTH) / hanging_strip(_WEIGHT, 20.0, _LENGTH) - 1.0)}

    return RefinementCase(count + 1, run)


def _hanging_strip(kind: MeshKind, count: int) -> RefinementCase:
    points, faces = strip(kind, 0.0, _LENGTH, 0.2, _LENGTH / count)
    flat = np.column_stack([points[:, 1], -points[:, 0], np.zeros(len(points))])
    fabric = Fabric("strip", 0.2, 1e-4, 100.0, 100.0, 50.0, 0.0, 0.0, 0.0, 0.0, 0.3)
    top = np.flatnonzero(flat[:, 1] > -1e-9)
    model = build_cloth(
        TriangleMesh(flat, faces),
        RestShape(flat),
        fabric,
        pinned=top,
        materials=checked(Materials, {"bending": "none"}),
    )
    bottom = flat[:, 1] < -_LENGTH + 1e-9

    def run() -> dict[str, float]:
        longer = (flat - equilibrium(model, flat).positions)[bottom, 1].mean()
        return {"length_share": float(abs(longer / hanging_strip(0.2 * GRAVITY, 100.0, _LENGTH) - 1.0))}

    return RefinementCase(len(flat), run)


def _catenary(count: int) -> RefinementCase:
    """A chain half as long again as its span, nearly rigid, that starts as a triangle."""
    span = _LENGTH / _SLACK
    x = np.linspace(0.0, span, count + 1)
    depth = 0.5 * np.sqrt(_LENGTH**2 - span**2)
    points = np.column_stack([x, -depth * (1.0 - np.abs(2.0 * x / span - 1.0)), 0.0 * x])
    model = _chain(points, 1e5, [0, count], _LENGTH / count)
    _, sag = catenary(_SLACK)

    def run() -> dict[str, float]:
        found = equilibrium(model, points, EquilibriumConfig(iterations=2000)).positions
        return {"sag_share": float(abs(-found[:, 1].min() / span / sag - 1.0))}

    return RefinementCase(count + 1, run)


def _pendulum(name: str, steps: int) -> RefinementCase:
    return RefinementCase(2, lambda: {"period_share": pendulum_error(name, steps)})


def pendulum_error(name: str, steps: int) -> float:
    """Return the relative error of the period of a mass on a rod that is let go level; infinite if it does not swing.

    Args:
        name: Of a solver or an integrator.
        steps: In a period of small swings.
    """
    arm = 0.25
    points = np.array([[0.0, 0.0, 0.0], [arm, 0.0, 0.0]])
    model = model_of((springs([[0, 1]], points, 1e-8),), np.full(2, 0.1), pinned=[0])
    short = 2.0 * np.pi * np.sqrt(arm / GRAVITY)
    h = short / steps
    made: Any = {**SOLVERS, **INTEGRATORS}[name]
    method = made(model)
    state, zeros, before = ClothState(points.copy(), np.zeros_like(points)), [], 0.5 * np.pi
    for step in range(1, 2 * steps):
        state = method.advance(state, empty_contacts(2), h, 1)
        angle = float(np.arctan2(state.positions[1, 0], -state.positions[1, 1]))
        if angle * before < 0.0:
            zeros.append(h * (step - angle / (angle - before)))
        if len(zeros) == 2:
            break
        before = angle
    period = 2.0 * (zeros[1] - zeros[0]) if len(zeros) == 2 else np.inf
    return float(abs(period / (short * pendulum_period(0.5 * np.pi)) - 1.0))
