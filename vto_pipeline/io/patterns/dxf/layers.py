"""What lies on which layer of a DXF file after AAMA-292 and ASTM D6673."""

from __future__ import annotations

BOUNDARY, TURN_POINTS, CURVE_POINTS, NOTCHES, GRADE_REFERENCE, MIRROR, GRAIN, INTERNAL = range(1, 9)
STRIPE, PLAID, CUTOUT, DRILLS, SEW, ANNOTATION = 9, 10, 11, 13, 14, 15
VALIDATION = (84, 85, 86, 87)
"""Layers on which lines are repeated finely, so that a reader can check the curves it made of them."""

NOTCH_KINDS = {NOTCHES: "slit", 80: "t", 81: "castle", 82: "check", 83: "u"}
LINE_KINDS = {INTERNAL: "internal", STRIPE: "stripe", PLAID: "plaid", CUTOUT: "cutout"}


def layer_of(name: str) -> int:
    """Return the number of a layer; -1 where its name is not a number."""
    text = name.strip()
    return int(text) if text.isdecimal() and len(text) < 6 else -1
