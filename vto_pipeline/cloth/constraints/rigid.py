"""Rigid constraints, which only methods with multipliers can hold."""

from __future__ import annotations

from typing import Any

import numpy as np

from vto_pipeline.cloth.constraints.sweep import linearised
from vto_pipeline.errors import ConfigError
from vto_pipeline.model.arrays import FloatArray


def rigid_kind(constraints: tuple[Any, ...], positions: FloatArray) -> str | None:
    """Return the name of the first kind with a compliance of zero at these positions [m], shape (V, 3), if any."""
    for data in constraints:
        compliance = linearised(positions, data)[2]
        if not (np.einsum("nii->ni", compliance) > 0.0).all():
            return type(data).__name__.lower()
    return None


def refuse_rigid(constraints: tuple[Any, ...], positions: FloatArray, method: str) -> None:
    """Raise if a constraint has no finite stiffness.

    Raises:
        ConfigError: with what to do.
    """
    kind = rigid_kind(constraints, positions)
    if kind is not None:
        raise ConfigError(
            f"{method} needs stiffnesses, and {kind} constraints have a compliance of zero, which is rigid",
            hint="give them a compliance, or choose a solver that uses multipliers, such as xpbd",
        )
