"""Where a panel stands in space, in words, as the standard has no place for it: one text in its block."""

from __future__ import annotations

import re

import numpy as np
from scipy.spatial.transform import Rotation

from vto_pipeline.io.patterns.dxf.texts import key_and_value
from vto_pipeline.model.pattern import Placement

KEY = "PLACED"
WORN = f"{KEY}: AS WORN"
"""Text beside the blocks: the panels stand where they were worn, not where they are laid out."""
_NUMBER = r"(-?\d+(?:\.\d+)?(?:e-?\d+)?)"
_VALUE = re.compile(rf"{_NUMBER} {_NUMBER} {_NUMBER} mm, {_NUMBER} {_NUMBER} {_NUMBER} deg")


def text_of(placement: Placement) -> str:
    """Return a placement as in PLACED: 0.0 1200.0 150.0 mm, 0.0 180.0 0.0 deg, the latter a rotation vector."""
    turn = Rotation.from_matrix(placement.rotation).as_rotvec(degrees=True)
    shift, angles = (" ".join(repr(float(x)) for x in row) for row in (1e3 * placement.translation, turn))
    return f"{KEY}: {shift} mm, {angles} deg"


def placement_of(text: str) -> Placement | None:
    """Return the placement that a text says; None: it says none."""
    key, value = key_and_value(text)
    match = _VALUE.fullmatch(value) if key == KEY else None
    if match is None:
        return None
    numbers = np.array([float(word) for word in match.groups()])
    return Placement(Rotation.from_rotvec(numbers[3:], degrees=True).as_matrix(), 1e-3 * numbers[:3])
