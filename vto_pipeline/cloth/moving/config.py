"""Settings of a garment on a moving body."""

from __future__ import annotations

from pydantic import Field

from vto_pipeline.cloth.dynamics.stepper import StepConfig
from vto_pipeline.cloth.model.materials import Materials


class FollowConfig(StepConfig, Materials):
    """How a garment follows a moving body."""

    skin_mm: float | None = Field(
        None, gt=0, le=20, description="Distance kept from the body [mm]; by default a quarter of an edge, 1 to 3 mm"
    )
    friction: float | None = Field(None, ge=0, le=5, description="Friction against the body; by default the fabric's")
    damping: float = Field(
        1.0,
        ge=0,
        le=1000,
        description="Decay rate of velocities, as by still air [1/s]",
    )
    body_step_mm: float = Field(
        10.0, gt=0, le=1000, description="How far the body near the cloth may move in one step [mm]"
    )
    finest: int = Field(64, ge=1, le=10000, description="Most steps per 1/60 s that one frame may take")
    attempts: int = Field(
        8, ge=1, le=20, description="How often a frame is tried while cloth meets the body in it or overstretches"
    )
    stretch_limit: float = Field(
        1.0,
        gt=0,
        le=10,
        description="Further stretch of an edge from which on the cloth counts as caught [share of its length at rest]",
    )
