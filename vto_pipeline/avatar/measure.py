"""Measure a body: taut girths, surface lengths, heights, and where the landmarks are."""

from __future__ import annotations

import math

from vto_pipeline.avatar.definitions import DEFINITIONS
from vto_pipeline.avatar.tape import Tape
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar, Measurements
from vto_pipeline.model.mesh import TriangleMesh


def measure(body: Avatar | TriangleMesh) -> Measurements:
    """Measure our body in its bind pose, or any other after registering ours to it.

    Args:
        body: An avatar, or a mesh of a body in metres, +Y up.

    Returns:
        All of `definitions.DEFINITIONS`; limbs as the mean of both sides. Each with its standard uncertainty: what the
        definition leaves open, and what the body itself was not known by.

    Raises:
        AvatarError: the mesh is not a body that can be registered.
    """
    if isinstance(body, TriangleMesh):
        from vto_pipeline.avatar.from_scan import fit_scan

        body = fit_scan(body)
    tape = Tape(body)
    values, sigmas = {}, {}
    for name, definition in DEFINITIONS.items():
        left, right = (tape.read(definition, body.bind_vertices, side).value for side in ("left", "right"))
        values[name] = (left + right) / 2
        sigmas[name] = math.hypot(tape.uncertainty(definition, body.bind_vertices), body.sigmas.get(name, 0.0))
    return Measurements(values, sigmas, sex_name(body.sex), body.caveats)


def fit_levels(avatar: Avatar) -> dict[str, float]:
    """Return zone -> height on the posed body [m] where a fit engineer looks: chest, waist, hip."""
    return {zone: float(avatar.vertices[avatar.loops[zone], 1].mean()) for zone in ("chest", "waist", "hip")}


def landmarks(avatar: Avatar) -> dict[str, FloatArray]:
    """Return name -> position of the posed body's landmarks [m], shape (3,)."""
    return {name: avatar.vertices[index] for name, index in avatar.landmarks.items()}


def sex_name(sex: float) -> str:
    """Return the nearest of "female", "neutral", "male" to a blend."""
    return ("female", "neutral", "male")[round(2 * sex)]
