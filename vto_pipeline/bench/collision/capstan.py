"""The capstan: a strip over a drum with a weight at each end, and the ratio of weights at which it slips."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from vto_pipeline.bench.physics.closed_forms import capstan
from vto_pipeline.cloth import Capsule
from vto_pipeline.cloth.dynamics.stepper import StepConfig, Stepper
from vto_pipeline.cloth.model.build import at_rest, build_cloth
from vto_pipeline.cloth.model.materials import Materials
from vto_pipeline.cloth.model.settings import checked
from vto_pipeline.cloth.swatch.meshes import strip
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.units import GRAVITY

_RADIUS, _SKIN = 0.05, 1e-3  # of the drum, and what the strip keeps from it [m]
_WIDTH, _FREE = 0.01, 0.05  # of the strip, and length of what hangs on either side [m]
_STIFFNESS = 1e4  # the strip lengthens by 1 % at the lighter end [N/m]
_DENSITY = 0.05  # [kg/m²]; the strip weighs a hundredth of the lighter weight
_WEIGHT = 0.1  # mass of the lighter weight [kg]
_SECONDS = 1.0
_LAST = 0.25  # share of the run in which a slip is looked for: it starts unstretched, and has to come to rest first
_BRACKET = 0.25  # of the ratio: where it is sought on either side
_HALVINGS = 7
_STIRS = 0.01  # excess of the ratio whose motion counts as slip, as a share


def slipping_ratio(settings: Mapping[str, object], friction: float, edges: int = 36) -> float:
    """Return T₂ / T₁ from which the strip slips over half a turn, by halving; that of `capstan` by theory.

    Args:
        settings: Of the steps, "solver" among them.
        friction: Coefficient.
        edges: Of the strip, along the half circle.

    Raises:
        DivergedError: the strip left every bound.
    """
    exact = capstan(friction, np.pi)
    low, high = (1.0 - _BRACKET) * exact, (1.0 + _BRACKET) * exact
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        acceleration = GRAVITY * _STIRS / 2.0  # of two weights of which one is heavier by this share, times the other
        stirs = 0.5 * acceleration * _SECONDS**2 * (1.0 - (1.0 - _LAST) ** 2)
        low, high = (low, middle) if heavy_end_sinks(settings, friction, middle, edges) > stirs else (middle, high)
    return 0.5 * (low + high)


def heavy_end_sinks(settings: Mapping[str, object], friction: float, ratio: float, edges: int = 36) -> float:
    """Return how far the heavier weight sinks in the last part of the run [m]."""
    radius = _RADIUS + _SKIN
    edge = np.pi * radius / edges
    free = round(_FREE / edge) * edge
    half = 0.5 * np.pi * radius
    points, faces = strip("grid", -half - free, half + free, _WIDTH, edge)
    s = points[:, 0]
    over, hangs = np.clip(s, -half, half), np.abs(s) - half
    x, y = radius * np.sin(over / radius), radius * np.cos(over / radius) - np.maximum(hangs, 0.0)
    start, flat = np.column_stack([x, y, -points[:, 1]]), np.column_stack([s, 0.0 * s, -points[:, 1]])
    fabric = Fabric("strip", _DENSITY, 1e-4, _STIFFNESS, _STIFFNESS, 0.5 * _STIFFNESS, 0.0, 0.0, 0.0, 0.0, friction)
    materials = checked(Materials, {"bending": "none"})
    model = build_cloth(TriangleMesh(start, faces), RestShape(flat), fabric, materials=materials)
    ends = [np.flatnonzero(s < s.min() + 1e-9), np.flatnonzero(s > s.max() - 1e-9)]
    mass = model.mass.copy()
    for end, weight in zip(ends, (_WEIGHT, ratio * _WEIGHT), strict=True):
        mass[end] += weight / len(end)
    model = replace(model, mass=mass, inverse_mass=1.0 / mass)
    drum = Capsule((0.0, 0.0, -1.0), (0.0, 0.0, 1.0), _RADIUS, friction)
    stepper = Stepper(model, [drum], np.full(len(mass), _SKIN), checked(StepConfig, settings))
    settled = stepper.run(at_rest(start), (1.0 - _LAST) * _SECONDS)
    ended = stepper.run(settled, _LAST * _SECONDS)
    return float((settled.positions - ended.positions)[ends[1], 1].mean())
