"""A stiff, distorted or extreme case: the input of a method, and the limits it must keep."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.linalg

from vto_pipeline.bench.bench import Value
from vto_pipeline.bench.stability.frequency import highest_mode
from vto_pipeline.cloth.model.build import ClothModel
from vto_pipeline.model.arrays import FloatArray, IntArray

_COUNTED = 1e-3  # of the median: the strain of an edge shorter than this says nothing about the cloth


@dataclass(frozen=True)
class StabilityCase:
    """A cloth in trouble.

    Args:
        name: Such as "h 1/10".
        model: The cloth.
        start: Where it begins, at rest [m], shape (V, 3).
        rest: Its shape without forces [m], shape (V, 3).
        edges: Pairs of vertices whose distance is its strain, shape (E, 2).
        h: Step [s].
        substeps: Steps a frame.
        frames: How long at most.
        sweeps: Iterations a step, for methods that count them.
        damping: Rate at which velocities fade [1/s].
        strain: What may be left of |l / l₀ - 1| at the end; infinite where nothing is asked.
        falls: Whether gravity moves it by much.
        recovers: Whether it must come back to its rest shape, up to a rigid motion.
        step_tried: Whether h is what is tried, and not for the method to choose.
        rigid: Whether its compliance is zero, so that it stores no energy and has no frequency.
    """

    name: str
    model: ClothModel
    start: FloatArray
    rest: FloatArray
    edges: IntArray
    h: float
    substeps: int
    frames: int
    sweeps: int
    damping: float = 0.0
    strain: float = np.inf
    falls: bool = False
    recovers: bool = False
    step_tried: bool = False
    rigid: bool = False

    @property
    def settings(self) -> Mapping[str, Value]:
        """What was chosen, for the table."""
        return {
            "h": self.h,
            "substeps": self.substeps,
            "frames": self.frames,
            "sweeps": self.sweeps,
            "damping": self.damping,
        }

    @cached_property
    def size(self) -> float:
        """Diagonal of the rest shape's box [m]."""
        return float(np.linalg.norm(np.ptp(self.rest, axis=0)))

    @cached_property
    def fall(self) -> float:
        """A tenth of what it would fall freely or of its size [m]: some vertex must move that far, if it falls."""
        seconds = self.frames * self.substeps * self.h
        freely = 0.5 * float(np.linalg.norm(self.model.gravity)) * seconds**2
        return 0.1 * min(freely, self.size) if self.falls else 0.0

    @cached_property
    def storing(self) -> ClothModel:
        """The cloth with what can store energy."""
        return replace(self.model, constraints=()) if self.rigid else self.model

    @cached_property
    def step_times_frequency(self) -> float:
        """h ω_max of the cloth at rest; infinite when it is rigid."""
        return np.inf if self.rigid else self.h * highest_mode(self.model, self.rest)[0]

    def max_strain(self, positions: FloatArray) -> float:
        """Return the largest |l / l₀ - 1| of its edges."""
        rest, now = (np.linalg.norm(x[self.edges[:, 1]] - x[self.edges[:, 0]], axis=1) for x in (self.rest, positions))
        counted = rest > _COUNTED * np.median(rest)
        return float(np.abs(now[counted] / rest[counted] - 1.0).max())

    def distance(self, positions: FloatArray) -> float:
        """Return the distance to the rest shape after the best rigid motion, rms over vertices [m].

        Kabsch 1976, "A solution for the best rotation to relate two sets of vectors".
        """
        one, other = positions - positions.mean(axis=0), self.rest - self.rest.mean(axis=0)
        u, _, vt = scipy.linalg.svd(one.T @ other)
        u[:, 2] *= np.sign(np.linalg.det(u @ vt))
        return float(np.sqrt(((one @ (u @ vt) - other) ** 2).sum(axis=1).mean()))
