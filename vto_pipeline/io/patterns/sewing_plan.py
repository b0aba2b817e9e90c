"""Where panels stand and what is sewn to what, in a YAML or JSON file: for drawings that say neither."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field

from vto_pipeline.errors import InputError
from vto_pipeline.io.documents import check_schema, load_yaml
from vto_pipeline.model.settings import Config


class PlannedPanel(Config):
    """One piece of cloth."""

    of: str = Field("", description="The panel that it is cut from; empty: the one of its own name")
    stands: Literal["front", "back", "left", "right"] | None = Field(
        None, description="Side of the body, which the right side of the cloth looks to; None: by a word in its name"
    )
    at_m: tuple[float, float] = Field(
        description="Its middle, seen from that side: to the right of a body of 1.72 m, and over the floor [m]"
    )
    away_m: float = Field(0.15, gt=0.0, le=1.0, description="From the body's middle [m]")
    turned_deg: float = Field(0.0, ge=-360.0, le=360.0, description="Anticlockwise, as it is seen from that side")
    mirrored: bool = Field(False, description="Whether the panel is flipped before it is cut: the other of a pair")
    fold: int | None = Field(None, ge=0, description="Edge at which the cloth is folded; the panel is the half drawn")


class PlannedSeam(Config):
    """One seam: chains of edges, such as `front 3`; `front 3 mirrored` is its like on the other half of a fold."""

    first: list[str] = Field(min_length=1, description="In the order of the outline, anticlockwise")
    second: list[str] = Field(min_length=1, description="In the order that they meet the first, against the outline")


class SewingPlan(Config):
    """How a pattern is sewn."""

    schema_: Literal[1] = Field(alias="schema", description="Of this file")
    panels: dict[str, PlannedPanel] = Field(min_length=1, description="Name -> where it comes from, and stands")
    seams: list[PlannedSeam] = Field([], description="What is sewn to what")


def read_sewing_plan(path: Path) -> SewingPlan:
    """Read a sewing plan.

    Raises:
        InputError: no such file, or a key that is unknown, missing or out of its range.
    """
    plan: SewingPlan = check_schema(load_yaml(Path(path), error=InputError), SewingPlan, error=InputError)
    return plan
