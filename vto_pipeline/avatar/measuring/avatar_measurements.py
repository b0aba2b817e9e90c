"""Measurements of an avatar: taut girths, surface lengths, heights and landmarks."""

from __future__ import annotations

import math

from vto_pipeline.avatar.measuring.definitions import DEFINITIONS
from vto_pipeline.avatar.measuring.tape import Tape
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar, Measurements


def measure_avatar(avatar: Avatar) -> Measurements:
    """Measure an avatar in its bind pose.

    Args:
        avatar: The avatar [m].

    Returns:
        All of `definitions.DEFINITIONS`; limbs as the mean of both sides. Each with its standard uncertainty: what the
        definition leaves open, and what the body itself was not known by.
    """
    tape = Tape(avatar)
    values, sigmas = {}, {}
    for name, definition in DEFINITIONS.items():
        left, right = (tape.read(definition, avatar.bind_vertices, side).value for side in ("left", "right"))
        values[name] = (left + right) / 2
        sigmas[name] = math.hypot(tape.uncertainty(definition, avatar.bind_vertices), avatar.sigmas.get(name, 0.0))
    return Measurements(values, sigmas, sex_name(avatar.sex), avatar.caveats)


def fit_levels(avatar: Avatar) -> dict[str, float]:
    """Return zone -> height on the posed body [m] where a fit engineer looks: chest, waist, hip."""
    return {zone: float(avatar.vertices[avatar.loops[zone], 1].mean()) for zone in ("chest", "waist", "hip")}


def landmarks(avatar: Avatar) -> dict[str, FloatArray]:
    """Return name -> position of the posed body's landmarks [m], shape (3,)."""
    return {name: avatar.vertices[index] for name, index in avatar.landmarks.items()}


def sex_name(sex: float) -> str:
    """Return the nearest of "female", "neutral", "male" to a blend."""
    return ("female", "neutral", "male")[round(2 * sex)]
