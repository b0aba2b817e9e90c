"""Settings of a drape."""

from __future__ import annotations

from pydantic import Field

from vto_pipeline.cloth.dynamics.stepper import StepConfig
from vto_pipeline.cloth.model.materials import Materials
from vto_pipeline.cloth.placement.place import PlaceConfig


class DrapeConfig(StepConfig, PlaceConfig, Materials):
    """How a garment is draped."""

    skin_mm: float | None = Field(
        None, gt=0, le=20, description="Distance kept from the body [mm]; by default a quarter of an edge, 1 to 3 mm"
    )
    friction: float | None = Field(None, ge=0, le=5, description="Friction against the body; by default the fabric's")
    body_speed: float = Field(
        0.6,
        gt=0,
        le=5,
        description="Top speed of the changing body under the cloth [m/s]",
    )
    ride_up_to_mm: float = Field(
        300.0,
        ge=0,
        le=10000,
        description="Above this change of the body, the garment starts reshaped instead of moving along [mm]",
    )
    grow_above_mm: float = Field(
        10.0, ge=0, le=1000, description="Where cloth starts deeper in the body, the body is grown from inside [mm]"
    )
    coarsen_above: int = Field(
        4000, ge=100, description="Above this many vertices, the garment first rests on a mesh of a quarter as many"
    )
    damping: float = Field(5.0, ge=0, le=1000, description="Decay rate of velocities [1/s]")
    max_speed: float = Field(1.0, gt=0, le=1000, description="Top speed of a vertex [m/s]")
    target_error_mm: float = Field(0.5, gt=0, le=100, description="Predicted rms motion below which it is at rest [mm]")
    target_residual: float = Field(
        0.01, ge=0, le=10, description="Residual force below which it is at rest, as a share of weight, rms over mass"
    )
    settle_seconds: float = Field(12.0, gt=0, le=600, description="Longest simulated time to reach rest [s]")
    finest: int = Field(160, ge=1, le=10000, description="Most steps per 1/60 s that refinement may reach")
    time_budget_s: float | None = Field(
        None, gt=0, description="Wall time after which to stop settling [s]; none by default"
    )
    clear_rounds: int = Field(
        30, ge=0, le=1000, description="Most rounds of thickening the skin where triangles still cross"
    )
    stretch_limit: float = Field(
        0.1, gt=0, le=10, description="Stretch beyond rest above which a garment counts as too small [share]"
    )
