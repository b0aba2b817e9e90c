"""A peer: another program that simulates the scenes of `bench.cloth.scenes` through its public interface.

Every program gets the same mesh, mass, ball and friction, steps once or more a frame of 1/60 s, and is clocked over the
frames alone: what it prepares before is not counted.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Protocol

import numpy as np

from vto_pipeline.bench.bench import Measured, Value
from vto_pipeline.bench.cloth.scenes import Scene, measures
from vto_pipeline.bench.timing import Timing
from vto_pipeline.cloth.dynamics.methods import FRAME
from vto_pipeline.cloth.model.build import ClothState
from vto_pipeline.errors import ComputationError

_RUNS, _PATIENCE = 3, 20.0
"""How often a run is repeated, and the seconds beyond which it is not."""


class Simulation(Protocol):
    """A scene in another program, about to move."""

    def frame(self) -> None:
        """Move on by 1/60 s."""

    def state(self) -> ClothState:
        """Return where the cloth is, in the axes and the order of the scene's vertices."""


@dataclass(frozen=True)
class Peer:
    """A program to compare with.

    Args:
        name: As it calls itself.
        package: What Python imports, and what tells whether it is there.
        module: Of this package: its `start(scene, settings)` returns a `Simulation`.
        budgets: Settings to try in a scene, the cheapest first; none where it cannot do the scene.
    """

    name: str
    package: str
    module: str
    budgets: Callable[[Scene], Sequence[Mapping[str, Value]]]

    @property
    def installed(self) -> bool:
        """Whether Python finds it."""
        return find_spec(self.package) is not None

    def start(self, scene: Scene, settings: Mapping[str, Value]) -> Simulation:
        """Return the scene in this program."""
        made: Simulation = import_module(self.module).start(scene, settings)
        return made


def measure_peer(peer: Peer, scene: Scene, settings: Mapping[str, Value]) -> Measured:
    """Return the median time of the frames, and what the last frame shows; of cloth that blew up, its status."""
    walls: list[float] = []
    while len(walls) < _RUNS and (not walls or walls[-1] <= _PATIENCE):
        try:
            simulation = peer.start(scene, settings)
            began = time.perf_counter()
            for _ in range(round(scene.seconds / FRAME)):
                simulation.frame()
            walls.append(time.perf_counter() - began)
        except ComputationError as error:
            return Timing(0.0), {"status": error.problem}
    state = simulation.state()
    timing = Timing.of(walls)
    if not np.isfinite(state.positions).all():
        return timing, {"status": "diverged"}
    return timing, {"status": "ended", **measures(scene, state)}
