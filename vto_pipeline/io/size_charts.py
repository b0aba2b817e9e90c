"""Size charts: flat measurements of each size of a garment, as `vto pattern --sizes` writes them, or by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field

from vto_pipeline.errors import InputError
from vto_pipeline.io.documents import check_schema, load_yaml
from vto_pipeline.model.settings import Config

SIZE_CHART = "size_chart.json"
"""Name of the file."""


class ChartRow(Config):
    """One size."""

    flat_mm: dict[str, float] = Field(
        description="Flat measurement -> value [mm]; chest, waist, hip, thigh: half girths"
    )
    asked_mm: dict[str, float] = Field({}, description="What the rules ask for [mm]")
    seam_mismatch_mm: float = Field(0.0, description="How much worse than in the base its worst seam fits [mm]")
    made: str = Field("", description="base, graded, or from the file")


class SizeChart(Config):
    """A size chart."""

    schema_: Literal[1] = Field(alias="schema", description="Of this file")
    name: str = Field("", description="Of the garment")
    type: str = Field("", description="Type of garment")
    allowances: str = Field(description="Kind of garment in the table of wearing ease")
    may_be_loose: list[str] = Field([], description="Zones that may be any wider than that table says")
    base: str = Field("", description="The size that the others were made from")
    steps: str = Field("", description="Where the steps between the sizes come from")
    sizes: dict[str, ChartRow] = Field(description="Size -> its measurements, from the smallest")


def read_size_chart(path: Path) -> SizeChart:
    """Read a size chart, JSON or YAML.

    Raises:
        InputError: no such file, a key that is unknown or missing, or a chart without sizes.
    """
    chart: SizeChart = check_schema(load_yaml(Path(path), error=InputError), SizeChart, error=InputError)
    if not chart.sizes:
        raise InputError("sizes: the chart has none", where=str(path))
    return chart
