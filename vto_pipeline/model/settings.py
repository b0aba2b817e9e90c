"""The base of every settings class. Each lives beside the function it sets."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict


class Config(BaseModel):
    """Base of all settings: frozen; unknown keys and numbers that are not finite are refused.

    Every field has a default, a range, and its unit in the description.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def __deepcopy__(self, memo: dict[int, Any] | None = None) -> Config:
        """Return itself: it never changes, and a document's sections are mostly defaults."""
        return self
