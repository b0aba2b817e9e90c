"""Conjugate gradients and sweeps of XPBD on a graphics processor of NVIDIA's, by the kernels of `kernels.cu`.

A kernel is one launch for all its iterations: launching one for each step of each would take longer than the steps.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.bench.scaling.gpu.layout import THREADS, Layout
from vto_pipeline.errors import MissingDependencyError
from vto_pipeline.model.arrays import FloatArray

_SOURCE = Path(__file__).with_name("kernels.cu")
_SWEEPING = 256  # threads of a block that sweeps
_RUNS = 5


@dataclass(frozen=True)
class Iterated:
    """What conjugate gradients came to.

    Args:
        x: Solution, shape (N, 3).
        iterations: Made.
        residual: Left of the right side, both by the root of the sum of squares, as the iteration saw it.
        seconds: Median of its runs, arrays being there [s].
    """

    x: FloatArray
    iterations: int
    residual: float
    seconds: float


class Device:
    """A graphics processor.

    Attributes:
        name: Its maker's.

    Raises:
        MissingDependencyError: no CuPy, or no graphics processor.
    """

    def __init__(self) -> None:
        hint = "pip install cupy-cuda13x, on a machine with a graphics processor of NVIDIA's and its driver"
        if find_spec("cupy") is None:
            raise MissingDependencyError("no package cupy", hint=hint)
        import cupy

        try:
            found = cupy.cuda.runtime.getDeviceProperties(0)
        except cupy.cuda.runtime.CUDARuntimeError as error:
            raise MissingDependencyError(f"no graphics processor: {error}", hint=hint) from None
        self._cupy: Any = cupy
        self.name = str(found["name"].decode())
        self._blocks = int(found["multiProcessorCount"])
        self._kernels = cupy.RawModule(code=_SOURCE.read_text(encoding="utf-8"), options=("--std=c++17",))
        self._gate = cupy.zeros(1, np.uint64)

    def invert(self, layout: Layout) -> tuple[Any, float]:
        """Return the inverses of all domains, on the device, and how long it takes [s]."""
        domains = self._cupy.asarray(layout.domains)
        inverses: list[Any] = []

        def invert() -> None:
            inverses[:] = [self._cupy.ascontiguousarray(self._cupy.linalg.inv(domains))]

        seconds = self._median(invert)
        return inverses[0], seconds

    def conjugate_gradients(
        self, layout: Layout, inverses: Any, right: FloatArray, tolerance: float, most: int
    ) -> Iterated:
        """Solve A x = right from x = 0; see `numerics.linear.conjugate_gradients`.

        Args:
            layout: A.
            inverses: Of its domains, by `invert`.
            right: Shape (N, 3).
            tolerance: Stop when the residual has fallen to this share of `right`.
            most: Iterations.
        """
        cupy = self._cupy
        width = layout.domains.shape[1]
        rows = len(layout.domains) * width
        laid = np.zeros((rows // 3, 3))
        laid[layout.place] = right
        fixed = [cupy.asarray(each) for each in (layout.slices, layout.columns, layout.values)]
        given, threads = cupy.asarray(laid), self._threads(rows)
        blocks = min(self._blocks, rows // threads)
        vectors = [cupy.full(rows, np.nan) for _ in range(6)]
        parts, found = cupy.zeros(4 * blocks), cupy.zeros(2)
        kernel = self._kernels.get_function("conjugate_gradients")
        self._gate[:] = 0

        def solve() -> None:
            arguments = (np.int32(rows), *fixed, np.int32(width), inverses, given, *vectors, parts, self._gate)
            ends = (np.float64(tolerance), np.int32(most), found)
            kernel((blocks,), (threads,), (*arguments, *ends), shared_mem=16 * threads // 32)

        seconds = self._median(solve)
        iterations, residual = found.get()
        x = vectors[0].get().reshape(-1, 3)[layout.place]
        return Iterated(x, int(iterations), float(residual), seconds)

    def sweeps(
        self, count: int, x: FloatArray, inverse_mass: FloatArray, bend: Any, stretch: Any, h: float
    ) -> tuple[FloatArray, float]:
        """Sweep over hinges and triangles from λ = 0; return positions [m], shape (V, 3), and the time it takes [s].

        Args:
            count: Of sweeps.
            x: Positions [m], shape (V, 3).
            inverse_mass: [1/kg], shape (V,).
            bend, stretch: Without damping, in colours of single constraints; see `layout.one_by_one`.
            h: Step [s].
        """
        cupy = self._cupy
        names = (stretch.colours, stretch.vertices, stretch.gradients, stretch.area, stretch.compliance)
        triangles = [cupy.asarray(each) for each in names]
        hinges = [cupy.asarray(each) for each in (bend.colours, bend.vertices, bend.rest, bend.compliance)]
        places, mass, given = cupy.empty(x.shape), cupy.asarray(inverse_mass), cupy.asarray(x)
        strained, bent = cupy.empty((len(stretch.vertices), 3)), cupy.empty(len(bend.vertices))
        kernel = self._kernels.get_function("sweeps")
        self._gate[:] = 0

        def again() -> None:
            places[:] = given
            strained[:] = 0.0
            bent[:] = 0.0

        def run() -> None:
            first = (np.int32(count), np.float64(h), places, mass, np.int32(len(stretch.colours) - 1), *triangles)
            second = (strained, np.int32(len(bend.colours) - 1), *hinges, bent, self._gate)
            kernel((self._blocks,), (_SWEEPING,), (*first, *second), shared_mem=0)

        seconds = self._median(run, again)
        return places.get(), seconds

    def limits(self) -> dict[str, float]:
        """Return what the device can: bytes that a copy moves [GB/s], a wait of all blocks, an empty launch [µs]."""
        cupy, count, size = self._cupy, 1000, 2**28
        one, other = cupy.ones(size), cupy.empty(size)
        copy = self._median(lambda: cupy.copyto(other, one))
        kernel = self._kernels.get_function("gates")

        def wait(count: int) -> Callable[[], None]:
            return lambda: kernel((self._blocks,), (THREADS,), (np.int32(count), self._gate))

        self._gate[:] = 0
        return {
            "copy_gb_per_s": 16e-9 * size / copy,
            "wait_us": 1e6 * self._median(wait(count)) / count,
            "launch_us": 1e6 * self._median(wait(0)),
        }

    def _threads(self, rows: int) -> int:
        """Return the threads of a block: few where the rows would leave some multiprocessors without work."""
        wanted = (count for count in (THREADS // 8, THREADS // 4, THREADS // 2) if rows <= count * self._blocks)
        return next(wanted, THREADS)

    def _median(self, run: Callable[[], object], before: Callable[[], object] = lambda: None) -> float:
        """Return the median time of some runs on the device after one more, each with what comes before it [s]."""
        events, walls = self._cupy.cuda.Event, []
        for _ in range(_RUNS + 1):
            before()
            began, ended = events(), events()
            began.record()
            run()
            ended.record()
            ended.synchronize()
            walls.append(1e-3 * float(self._cupy.cuda.get_elapsed_time(began, ended)))
        return statistics.median(walls[1:])
