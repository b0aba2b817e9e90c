"""How a pattern that we write marks what is what, so that it is read back whole."""

from __future__ import annotations

SCHEMA = "data-vto-pattern"
"""Attribute of the root: version of this marking."""

HEAD = "data-vto-head"
"""Attribute of the root, JSON: name, unit, if worn, stitches, panel coordinates [m] of the corner of the page."""

PANEL = "data-vto-panel"
"""Attribute of each shape: number of the panel it belongs to, from 0."""

RECORD = "data-vto-record"
"""Attribute of an outline: the panel's name, size, notes and placement as JSON."""

ROLE = "data-vto-role"
"""Attribute of each shape: outline, cut, grain, notch, drill, or the kind of an inner line."""

DETAIL = "data-vto-detail"
"""Attribute of a curve: number of segments, label and bulge of each edge; of a notch: kind, angle, depth."""
