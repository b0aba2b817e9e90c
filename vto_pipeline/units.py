"""Conversion at the door: everything inside is SI."""

from __future__ import annotations

LENGTH_M = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
"""Metres per unit of length, by the unit's name."""

TIME_S = {"s": 1.0, "min": 60.0, "h": 3600.0}
"""Seconds per unit of time, by the unit's name."""

MEMORY_B = {"MB": 1e6, "GB": 1e9, "TB": 1e12}
"""Bytes per unit of memory, by the unit's name."""

ANGLE_RAD = {"deg": 0.017453292519943295, "rad": 1.0}
"""Radians per unit of angle, by the unit's name."""

GSM = 1e-3
"""kg/m² per g/m², the trade's "gsm"."""

GRAVITY = 9.80665
"""Standard gravity [m/s²], ISO 80000-3."""
