"""Seams that a person drew on a garment: a YAML or JSON file of lines."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from vto_pipeline.errors import InputError
from vto_pipeline.io.documents import check_schema, load_yaml
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.settings import Config
from vto_pipeline.units import LENGTH_M


class SeamLine(Config):
    """A seam."""

    name: str = Field(description="For messages")
    points: list[tuple[float, float, float]] = Field(
        min_length=2, max_length=100_000, description="On or near the garment, in order along the seam"
    )


class SeamLines(Config):
    """All seams of a garment."""

    schema_: Literal[1] = Field(alias="schema", description="Of this file")
    unit: str = Field("m", description="Unit of length of the points")
    seams: list[SeamLine] = Field(min_length=1, description="The lines to cut along")


def read_seam_lines(path: Path) -> dict[str, FloatArray]:
    """Return the seams of a file, name -> points [m], shape (K, 3).

    Raises:
        InputError: no such file, a key that is unknown or missing, two seams of one name, or no unit of length.
    """
    lines: SeamLines = check_schema(load_yaml(Path(path), error=InputError), SeamLines, error=InputError)
    if lines.unit not in LENGTH_M:
        raise InputError(f"unit: {lines.unit!r}; expected one of {', '.join(LENGTH_M)}", where=str(path))
    names = [seam.name for seam in lines.seams]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(f"seams: two of them are called {twice[0]!r}", where=str(path))
    return {seam.name: LENGTH_M[lines.unit] * np.asarray(seam.points, dtype=np.float64) for seam in lines.seams}
