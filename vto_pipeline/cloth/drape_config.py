"""Settings of a drape."""

from __future__ import annotations

from pydantic import Field

from vto_pipeline.cloth.materials import Materials
from vto_pipeline.cloth.place import PlaceConfig
from vto_pipeline.cloth.stepper import StepConfig


class DrapeConfig(StepConfig, PlaceConfig, Materials):
    """How a garment is draped."""

    skin_mm: float | None = Field(
        None, gt=0, le=20, description="Distance kept from the body [mm]; by default a quarter edge, 1 to 3 mm"
    )
    friction: float | None = Field(None, ge=0, le=5, description="Against the body; by default the fabric's")
    body_speed: float = Field(
        0.3,
        gt=0,
        le=5,
        description="Speed of the fastest point of the body under the cloth as it changes [m/s]",
    )
    ride_up_to_mm: float = Field(
        300.0,
        ge=0,
        le=10000,
        description="Where the body under the garment changes by more, it does not ride along but starts reshaped [mm]",
    )
    grow_above_mm: float = Field(
        10.0, ge=0, le=1000, description="Cloth that starts deeper in the body than this has it grow from inside [mm]"
    )
    coarsen_above: int = Field(
        4000, ge=100, description="A garment of more vertices comes to rest on a mesh of a quarter as many first"
    )
    damping: float = Field(5.0, ge=0, le=1000, description="Rate at which velocities fade [1/s]")
    max_speed: float = Field(1.0, gt=0, le=1000, description="No vertex moves faster [m/s]")
    target_error_mm: float = Field(0.5, gt=0, le=100, description="Predicted motion at which it is at rest, rms [mm]")
    target_residual: float = Field(
        0.01, ge=0, le=10, description="And left-over force at which it is, rms, as a share of a vertex's weight"
    )
    settle_seconds: float = Field(6.0, gt=0, le=600, description="Cloth time at most until rest [s]")
    finest: int = Field(160, ge=1, le=10000, description="Steps per 1/60 s that are not refined further")
    time_budget_s: float | None = Field(
        None, gt=0, description="Wall time after which to stop settling [s]; none by default"
    )
    clear_rounds: int = Field(
        30, ge=0, le=1000, description="Rounds, at most, of thickening the skin where triangles still cross"
    )
    stretch_limit: float = Field(
        0.1, gt=0, le=10, description="Stretch beyond rest above which a garment counts as too small [share]"
    )
