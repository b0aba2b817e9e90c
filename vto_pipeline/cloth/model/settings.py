"""Settings given as a plain mapping from Python."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from pydantic import ValidationError

from vto_pipeline.errors import ConfigError
from vto_pipeline.model.settings import Config

SomeConfig = TypeVar("SomeConfig", bound=Config)


def checked(kind: type[SomeConfig], settings: Config | Mapping[str, object] | None) -> SomeConfig:
    """Return the settings as their class.

    Raises:
        ConfigError: an unknown key or a value out of range.
    """
    if isinstance(settings, kind):
        return settings
    try:
        return kind.model_validate(dict(settings or {}))
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise ConfigError(
            f"{key}: {first['msg']} (got {first.get('input')!r})", hint=f"allowed: {', '.join(kind.model_fields)}"
        ) from None
