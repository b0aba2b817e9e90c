"""The base of every settings class. Each lives beside the function it sets."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class Config(BaseModel):
    """Base of all settings: frozen; unknown keys and numbers that are not finite are refused.

    Every field has a default, a range, and its unit in the description.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
