"""A vertical strip with its tip on a floor and its clamp lowered: the tip sticks, then slips."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vto_pipeline.bench.physics.elastica import held_strip, slipping_strip
from vto_pipeline.cloth import Plane
from vto_pipeline.cloth.dynamics.methods import FRAME
from vto_pipeline.cloth.dynamics.stepper import Pins, StepConfig, Stepper
from vto_pipeline.cloth.model.build import at_rest, build_cloth
from vto_pipeline.cloth.model.settings import checked
from vto_pipeline.cloth.swatch.meshes import strip
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh

_LENGTH, _WIDTH = 0.1, 0.02  # [m]
_RIGIDITY = 1e-4  # [N·m]
_STIFFNESS = 3e3  # membrane; the strip is shortened by 0.01 % under its Euler load [N/m]
_DENSITY = 0.1  # it swings in 0.13 s, and is lowered in eight [kg/m²]
_DAMPING = 2.0  # [1/s]
_SKIN = 1e-3  # [m]
_SLIPPED = 0.005  # of the length: how far the tip may creep
_SECONDS = 8.0


def slipping_shortening(settings: Mapping[str, object], friction: float, edges: int = 40) -> float:
    """Return by what share of its length the strip has been pushed down when its tip slips.

    It starts as theory has it at half of that share, and is lowered to half as much again.

    Args:
        settings: Of the steps, "solver" among them.
        friction: Coefficient.
        edges: Of the strip, along its length.

    Raises:
        DivergedError: the strip left every bound.
    """
    exact = slipping_strip(friction)
    points, faces = strip("grid", 0.0, _LENGTH * (1.0 + 2.0 / edges), _WIDTH, _LENGTH / edges)
    s = points[:, 0]
    shape = held_strip(0.5 * exact).shape
    arc = np.linspace(0.0, _LENGTH, len(shape))
    across, down = (_LENGTH * np.interp(_LENGTH - s, arc, part) for part in shape.T)
    beyond = np.maximum(s - _LENGTH, 0.0)
    lowest = _LENGTH * shape[-1, 1]
    start = np.column_stack([across, _SKIN + lowest - down + beyond, -points[:, 1]])
    flat = np.column_stack([s, 0.0 * s, -points[:, 1]])
    held, tip = np.flatnonzero(s > _LENGTH - 1e-9), np.flatnonzero(s < 1e-9)
    fabric = Fabric(
        "strip", _DENSITY, 1e-4, _STIFFNESS, _STIFFNESS, 0.5 * _STIFFNESS, 0.0, _RIGIDITY, _RIGIDITY, 0.0, friction
    )
    model = build_cloth(TriangleMesh(start, faces), RestShape(flat), fabric, pinned=held, gravity=(0.0, 0.0, 0.0))

    def shortened(time: float) -> float:
        return exact * (0.5 + time / _SECONDS)

    def path(time: float) -> FloatArray:
        return start[held] - np.array([0.0, (shortened(time) - 0.5 * exact) * _LENGTH, 0.0])

    floor = Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), friction)
    config = checked(StepConfig, settings)
    stepper = Stepper(model, [floor], np.full(len(s), _SKIN), config, damping=_DAMPING, pins=Pins(held, path))
    state = at_rest(start)
    while state.time < _SECONDS - 0.5 * FRAME:
        state = stepper.run(state, FRAME)
        if abs(float(state.positions[tip, 0].mean()) - start[tip, 0].mean()) > _SLIPPED * _LENGTH:
            break
    return shortened(state.time)
