"""Invalid inputs, each of which every method must refuse by name."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import numpy as np

from vto_pipeline.bench.bench import Measured
from vto_pipeline.bench.cloth.scenes import grid, isotropic_sheet
from vto_pipeline.bench.timing import Timing
from vto_pipeline.cloth.simulation import simulate
from vto_pipeline.errors import ConfigError, InputError
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

_COUNT = 4  # vertices a side
REFUSED_VERTICES = _COUNT**2


def _sheet() -> tuple[FloatArray, IntArray]:
    across, along, faces = grid(_COUNT)
    return np.column_stack([across, np.zeros(len(across)), along]), faces


def _spoilt(value: float) -> FloatArray:
    positions = _sheet()[0]
    positions[5, 1] = value
    return positions


def _run(
    solver: str | None,
    *,
    positions: FloatArray | None = None,
    faces: IntArray | None = None,
    rest: FloatArray | None = None,
    pinned: tuple[int, ...] = (),
    density: float = 0.2,
    stiffness: float = 1000.0,
    seconds: float = 0.01,
    **settings: object,
) -> None:
    good, triangles = _sheet()
    mesh = TriangleMesh(good if positions is None else positions, triangles if faces is None else faces)
    simulate(
        mesh,
        isotropic_sheet(stiffness, density),
        rest=rest,
        pinned=pinned,
        seconds=seconds,
        settings={"solver": solver, **settings},
    )


REFUSED: Mapping[str, Callable[[str | None], None]] = {
    "NaN position": lambda solver: _run(solver, positions=_spoilt(np.nan)),
    "infinite position": lambda solver: _run(solver, positions=_spoilt(np.inf)),
    "NaN in the rest shape": lambda solver: _run(solver, rest=_spoilt(np.nan)),
    "no area at rest": lambda solver: _run(solver, rest=np.zeros_like(_sheet()[0])),
    "empty mesh": lambda solver: _run(solver, faces=np.empty((0, 3), np.int32)),
    "face index out of range": lambda solver: _run(solver, faces=_sheet()[1] + 1),
    "pinned vertex out of range": lambda solver: _run(solver, pinned=(REFUSED_VERTICES,)),
    "NaN gravity": lambda solver: _run(solver, gravity=(0.0, np.nan, 0.0)),
    "NaN density": lambda solver: _run(solver, density=np.nan),
    "infinite stiffness": lambda solver: _run(solver, stiffness=np.inf),
    "NaN seconds": lambda solver: _run(solver, seconds=np.nan),
    "infinite seconds": lambda solver: _run(solver, seconds=np.inf),
    "negative seconds": lambda solver: _run(solver, seconds=-1.0),
}
"""What is wrong with the input -> a simulation of it with a given method."""


def refuse(name: str, solver: str | None) -> Measured:
    """Return how long it took, and the verdict "refused", or what happened instead; no solver means the default."""
    began = time.perf_counter()
    why = ""
    try:
        REFUSED[name](solver)
        verdict = "accepted"
    except (InputError, ConfigError) as error:
        verdict, why = "refused", error.problem
    except (ArithmeticError, RuntimeError, ValueError) as error:
        verdict, why = "crashes", f"{type(error).__name__}: {error}"[:200]
    return Timing(time.perf_counter() - began), {"verdict": verdict, "why": why}
