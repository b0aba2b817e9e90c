"""Strands of springs with extreme stiffness and mass ratios, and with zero compliance.

After Chen et al. 2024, "Vertex block descent": held at one end, tilted by 30°, one step a frame of 1/60 s with a
hundred iterations, for five seconds. Spacing, stiffness and masses of the mass ratio are theirs throughout.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from vto_pipeline.bench.stability.case import StabilityCase
from vto_pipeline.cloth.constraints.points.spring import springs
from vto_pipeline.cloth.model.build import model_of
from vto_pipeline.model.arrays import FloatArray

_SPACING = 0.05  # [m]
_TILT_DEG = 30.0
_GRAVITY = 10.0  # [m/s²]
_STIFF, _SOFT = 1e8, 1e4  # [N/m]
_SKIP = 100.0  # [N/m], of the springs from each vertex to the next but one


def strand_cases() -> Iterator[StabilityCase]:
    """Make all cases of strands, one after the other."""
    yield _strand("stiffness 1e4/1e8", np.full(5, 0.1), 1.0 / np.array([_SOFT, _STIFF, _SOFT, _STIFF]))
    yield _strand("stiffness 1e12", np.ones(20), 1e-12)
    yield _strand("rigid strand", np.ones(20), 0.0)
    yield _strand("mass ratio 1:1000", np.append(np.ones(19), 1000.0), 1.0 / _STIFF, skip=True)


def _strand(name: str, mass: FloatArray, compliance: ArrayLike, *, skip: bool = False) -> StabilityCase:
    """A strand swinging from its first vertex; masses [kg], compliance of its springs [m/N]."""
    count = len(mass)
    tilt = np.deg2rad(_TILT_DEG)
    rest = np.outer(_SPACING * np.arange(count), [np.cos(tilt), -np.sin(tilt), 0.0])
    pairs = np.column_stack([np.arange(count - 1), np.arange(1, count)]).astype(np.int32)
    softness = np.broadcast_to(np.asarray(compliance, dtype=np.float64), len(pairs))
    ends = np.vstack([pairs, np.column_stack([pairs[:-1, 0], pairs[1:, 1]])]) if skip else pairs
    spare = np.full(len(ends) - len(pairs), 1.0 / _SKIP)
    data = springs(ends, rest, np.concatenate([softness, spare]))
    model = model_of((data,), mass, pinned=[0], gravity=(0.0, -_GRAVITY, 0.0), edge_length=_SPACING)
    hanging = float((softness * _GRAVITY * np.cumsum(mass[:0:-1])[::-1]).max()) / _SPACING
    return StabilityCase(
        name,
        model,
        rest,
        rest,
        pairs,
        h=1.0 / 60.0,
        substeps=1,
        frames=300,
        sweeps=100,
        strain=0.01 + 5.0 * hanging,
        falls=True,
        rigid=not softness.any(),
    )
