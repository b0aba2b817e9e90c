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
        residual: Residual force, rms over vertices, as a share of a vertex's weight.
        level: 0 on the garment's own mesh, 1 on the next coarser one, and so on.
        contacts: That pushed in the last step, where the method counts them.
    """

    seconds: float
    step: int
    error_mm: float
    residual: float
    level: int = 0
    contacts: int = 0


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
