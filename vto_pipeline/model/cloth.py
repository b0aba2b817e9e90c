"""The result of a drape."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from vto_pipeline.model.arrays import FloatArray, freeze
from vto_pipeline.model.mesh import TriangleMesh


@dataclass(frozen=True)
class TraceRow:
    """One line of a drape's error against run time.

    Args:
        seconds: Wall time since the drape began [s].
        step: Steps taken on this mesh.
        error_mm: Predicted distance to the state of rest of this mesh [mm].
        residual: Residual force as a share of weight, rms over the mass.
        level: 0 on the garment's own mesh, 1 on the next coarser one, and so on.
        contacts: That pushed in the last step, where the method counts them.
        true_mm_median, true_mm_p95, true_mm_max: Distance of the vertices to where they ended [mm]; None until then.
    """

    seconds: float
    step: int
    error_mm: float
    residual: float
    level: int = 0
    contacts: int = 0
    true_mm_median: float | None = None
    true_mm_p95: float | None = None
    true_mm_max: float | None = None


def seconds_within(trace: Sequence[TraceRow], distance_mm: float) -> float | None:
    """Return when 95 % of the vertices were this near to where they ended, for good [s]; None while that is unknown."""
    if not trace or any(row.true_mm_p95 is None for row in trace):
        return None
    near = [row.true_mm_p95 is not None and row.true_mm_p95 <= distance_mm for row in trace]
    since = len(near) - near[::-1].index(False) if False in near else 0
    return trace[min(since, len(trace) - 1)].seconds


@dataclass(frozen=True)
class Draped:
    """A garment on a body.

    Args:
        mesh: The simulation mesh at its end [m].
        velocities: [m/s], shape (V, 3).
        frames: Positions over a motion [m], shape (K, V, 3), or None.
        trace: Error against run time.
        audit: Name -> finding of the after-the-fact judge; plain JSON values.
    """

    mesh: TriangleMesh
    velocities: FloatArray
    frames: FloatArray | None = None
    trace: Sequence[TraceRow] = ()
    audit: Mapping[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "velocities", freeze("velocities", self.velocities, self.mesh.vertices.shape, "f8"))
