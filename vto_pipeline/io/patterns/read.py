"""Sewing patterns from files of any kind, parsed in a limited child process."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.documents import read_json
from vto_pipeline.io.files import check_file
from vto_pipeline.io.patterns.dxf.read import parse_dxf
from vto_pipeline.io.patterns.garment_code import garment_code_pattern, is_garment_code
from vto_pipeline.io.patterns.record import answer, is_own, pattern_of
from vto_pipeline.io.patterns.svg.read import parse_svg
from vto_pipeline.io.sandbox import run_limited
from vto_pipeline.model.job import Job
from vto_pipeline.model.pattern import Pattern

_LIMIT_BYTES = 100_000_000


def parse_json(path: str, unit: str) -> Arrays:
    """Return the pattern of a JSON file, ours or GarmentCode's, as our JSON in text. Runs in the sandbox.

    Args:
        path: The file.
        unit: Must be empty: these files say their unit.

    Raises:
        FormatError: neither, or broken.
    """
    if unit:
        raise FormatError("the unit of a JSON pattern is in the file", where=path, hint="leave --unit out")
    data = read_json(Path(path))
    if is_garment_code(data):
        name = Path(path).stem.removesuffix("_specification").removesuffix("_template")
        pattern, notes = garment_code_pattern(data, name, Path(path).name)
        return answer(pattern, notes)
    if is_own(data):
        return answer(pattern_of(data, Path(path).name), [])
    raise FormatError("neither a pattern of GarmentCode nor a panels.json: no key panels", where=path)


PARSERS: dict[str, Callable[[str, str], Arrays]] = {".json": parse_json, ".dxf": parse_dxf, ".svg": parse_svg}
"""Suffix -> parser; each takes the file and the unit that overrides the file's, or none."""


def is_pattern(path: Path) -> bool:
    """Return whether a JSON file claims to hold a pattern."""
    try:
        data = read_json(path)
    except InputError:
        return False
    return is_garment_code(data) or is_own(data)


def read_pattern(path: Path, *, unit: str | None = None, job: Job | None = None) -> Pattern:
    """Read a sewing pattern.

    Args:
        path: DXF-AAMA or ASTM D6673, SVG, JSON of GarmentCode, or `panels.json`.
        unit: Unit of length, a key of `units.LENGTH_M`, in place of the file's; None: as the file says.
        job: Notified of all that was not taken, or taken in a way the file does not say.

    Returns:
        The pattern, in metres.

    Raises:
        InputError: no such file, or its unit is unknown; FormatError: it breaks its format, or an outline is open.
    """
    path = check_file(Path(path), PARSERS, _LIMIT_BYTES)
    found = run_limited(PARSERS[path.suffix.lower()], str(path.resolve()), unit or "", where=str(path))
    if job is not None:
        for note in found["notes"]:
            job.note(f"{path.name}: {note}")
    return pattern_of(json.loads(str(found["pattern"])), str(path))
