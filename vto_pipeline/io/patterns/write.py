"""Sewing patterns to files: DXF, SVG, or our JSON, by the suffix."""

from __future__ import annotations

from pathlib import Path

from vto_pipeline.errors import ConfigError
from vto_pipeline.io.documents import write_json
from vto_pipeline.io.patterns.dxf.write import write_dxf
from vto_pipeline.io.patterns.record import record_of
from vto_pipeline.io.patterns.svg.write import write_svg
from vto_pipeline.model.pattern import Pattern

SUFFIXES = (".dxf", ".svg", ".json")


def write_pattern(path: Path, pattern: Pattern) -> None:
    """Write a pattern.

    Args:
        path: Ends in .dxf, .svg or .json.
        pattern: Any.

    Raises:
        ConfigError: another suffix.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise ConfigError(f"patterns are written as {', '.join(SUFFIXES)}, not as {suffix or 'a file without suffix'}")
    if suffix == ".dxf":
        write_dxf(path, pattern)
    elif suffix == ".svg":
        write_svg(path, pattern)
    else:
        write_json(path, record_of(pattern))
