"""Formatting of values and their names."""

from __future__ import annotations

import json
import math
from typing import Any

_UNITS = {
    "mm": "mm",
    "cm": "cm",
    "m": "m",
    "px": "px",
    "s": "s",
    "seconds": "s",
    "mb": "MB",
    "deg": "°",
    "n": "N",
    "pa": "Pa",
}
_LONGEST = 160  # characters of a value that is no number


def label(name: str) -> str:
    """Return a key in words, without the unit at its end: "rms_mm" is "rms"."""
    head, _, tail = name.rpartition("_")
    words = head if head and tail in _UNITS else name
    return words.replace("_", " ")


def figure(name: str, value: Any) -> str:
    """Return a value with the unit its key ends in: 0.4123 of "rms_mm" is "0.412 mm"."""
    if name.endswith("_share") and isinstance(value, float):
        return f"{100 * value:.3g} %"
    unit = _UNITS.get(name.rpartition("_")[2], "") if "_" in name else ""
    return f"{number(value)} {unit}".rstrip()


def number(value: Any) -> str:
    """Return a value in few characters; a float keeps three significant digits."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None:
        return "-"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        if not math.isfinite(value):
            return "not finite"
        return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.3g}"
    text = value if isinstance(value, str) else json.dumps(value, default=str)
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"


def centimetres(metres: float) -> str:
    """Return a body length in centimetres."""
    return f"{100 * metres:.1f}"


def duration(seconds: float) -> str:
    """Return a time in a suitable unit."""
    if seconds < 0.1:
        return f"{1000 * seconds:.0f} ms"
    if seconds < 60:
        return f"{seconds:.1f} s"
    return f"{seconds // 60:.0f} min {seconds % 60:.0f} s"
