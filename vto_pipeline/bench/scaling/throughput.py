"""Speed of the inner kernels relative to the limits of the machine; see `roofline`.

Bytes are the least that must move: every array once, and vertices once in and once out. Operations are counted in the
compiled code of one stencil, which has no inner loops; where there are loops, only bytes are counted.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numba import njit

from vto_pipeline.bench.bench import Measured, Row, Value, Watch
from vto_pipeline.bench.cloth.scenes import STIFFNESS, grid, isotropic_sheet
from vto_pipeline.bench.scaling.roofline import bandwidth, peak
from vto_pipeline.bench.timing import Timing, timed
from vto_pipeline.cloth.constraints.sweep import add_forces, kind_of, multipliers, project
from vto_pipeline.cloth.implicit_step.stiffness import Stiffness
from vto_pipeline.cloth.model.build import ClothModel, build_cloth
from vto_pipeline.cloth.model.materials import Materials
from vto_pipeline.cloth.model.settings import checked
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.cpu_threads import limited_threads
from vto_pipeline.numerics.linear.block_matrix import BlockMatrix, multiply

_BENDING = 1e-5  # N·m, so that hinges take part
_HINGES = checked(Materials, {"bending": "hinge"})
_H = 1e-3  # s
_CALL = 0.05  # s: shorter calls are repeated until they last this long
_ARITHMETIC = re.compile(r"= f(?:add|sub|mul|div)\b|call [^\n]*@(?:llvm\.)?(?:sqrt|asin|acos|atan2|fma)")


@dataclass(frozen=True)
class Kernel:
    """An inner kernel.

    Args:
        call: Runs it once.
        moved: Least bytes of a call.
        operations: Additions, multiplications, divisions and roots of a call; None where they are not counted.
    """

    call: Callable[[], object]
    moved: int
    operations: int | None


def kernel_rows(count: int, threads: int, watch: Watch) -> Iterator[Row]:
    """Measure each kernel on a sheet of count x count vertices."""
    for name, make in _KERNELS.items():
        measure = partial(_measure, make, count, threads)
        yield watch.row(f"kernels {count}", name, {"use_threads": threads}, count**2, measure)


def seconds_of(call: Callable[[], object]) -> Timing:
    """Return the time of one call, from as many in a row as last long enough to be measured."""
    _, first = timed(call, warm=call, runs=1)
    repeats = max(round(_CALL / max(first.seconds, 1e-9)), 1)

    def many() -> None:
        for _ in range(repeats):
            call()

    _, timing = timed(many, runs=5)
    spread = None if timing.spread_s is None else timing.spread_s / repeats
    return Timing(timing.seconds / repeats, timing.runs, first.compile_s, spread)


def _measure(make: Callable[[int, bool], Kernel], count: int, threads: int) -> Measured:
    kernel = make(count, threads > 1)
    with limited_threads(threads):
        timing = seconds_of(kernel.call)
    wide = bandwidth(kernel.moved, threads)
    least = kernel.moved / wide
    errors: dict[str, Value] = {
        "gb_per_s": 1e-9 * kernel.moved / timing.seconds,
        "bandwidth_gb_per_s": 1e-9 * wide,
        "bandwidth_share": least / timing.seconds,
    }
    if kernel.operations is not None:
        errors["gflop_per_s"] = 1e-9 * kernel.operations / timing.seconds
        errors["flop_per_byte"] = kernel.operations / kernel.moved
        least = max(least, kernel.operations / peak(threads))
    errors["roofline_share"] = least / timing.seconds
    return timing, errors


def projection_sweep(count: int, threaded: bool) -> Kernel:
    """Return one Gauss-Seidel sweep over a sheet of count x count vertices."""
    model, x = sheet_cloth(count)
    sweep = compiled_sweep()
    start, lambdas = x.copy(), multipliers(model.constraints)
    w, constraints = model.inverse_mass, model.constraints
    moved = _data_bytes(model) + 2 * sum(each.nbytes for each in lambdas) + w.nbytes + 2 * x.nbytes
    return Kernel(
        lambda: sweep(x, start, w, constraints, lambdas, _H, threaded), moved, _operations(model, _one_projection)
    )


def _forces(count: int, threaded: bool) -> Kernel:
    model, x = sheet_cloth(count)
    forces = np.zeros_like(x)
    return Kernel(
        lambda: add_forces(x, model.constraints, forces),
        _data_bytes(model) + 3 * x.nbytes,
        _operations(model, _one_force),
    )


def _stiffness_assembly(count: int, threaded: bool) -> Kernel:
    model, x = sheet_cloth(count)
    stiffness = Stiffness(model)
    places = sum(4 * len(data.vertices) * data.vertices.shape[1] ** 2 for data in model.constraints)
    moved = _data_bytes(model) + x.nbytes + places + 2 * stiffness.assemble(x).blocks.nbytes
    return Kernel(lambda: stiffness.assemble(x, 1.0, _H**2), moved, None)


def _block_multiply(count: int, threaded: bool) -> Kernel:
    model, x = sheet_cloth(count)
    matrix, product = Stiffness(model).assemble(x, 1.0, _H**2), np.zeros_like(x)
    moved = matrix.blocks.nbytes + matrix.columns.nbytes + matrix.starts.nbytes + 2 * x.nbytes
    return Kernel(lambda: multiply(matrix, x, product), moved, 18 * len(matrix.blocks))


_KERNELS = {
    "projection sweep": projection_sweep,
    "forces": _forces,
    "stiffness assembly": _stiffness_assembly,
    "block multiply": _block_multiply,
}


def sheet_system(count: int, h: float) -> BlockMatrix:
    """Return M + h² K of a sheet of count x count vertices, a little strained and bent, for a step h [s]."""
    model, x = sheet_cloth(count)
    return Stiffness(model).assemble(x, 1.0, h * h)


def sheet_cloth(count: int) -> tuple[ClothModel, FloatArray]:
    """Return a sheet, and positions at which it is a little strained and bent. Its hinges are those of every matrix."""
    across, along, faces = grid(count)
    flat = np.column_stack([across, along, np.zeros(len(along))])
    fabric = isotropic_sheet(STIFFNESS, bending=_BENDING)
    model = build_cloth(TriangleMesh(flat, faces), RestShape(flat), fabric, pinned=(0,), materials=_HINGES)
    wave = 0.02 * np.sin(9.0 * across) * np.cos(7.0 * along)
    return model, np.column_stack([1.001 * across, along, wave])


def _data_bytes(model: ClothModel) -> int:
    """Return the size of all constraints."""
    arrays = (value for data in model.constraints for value in data if isinstance(value, np.ndarray))
    return sum(value.nbytes for value in arrays)


def compiled_sweep() -> Any:
    """Return a sweep that Python can call; not cached, since its file does not change with the constraints."""

    @njit(error_model="numpy")
    def sweep(x, start, inverse_mass, constraints, lambdas, h, threaded):  # type: ignore[no-untyped-def]
        project(x, start, inverse_mass, constraints, lambdas, h, threaded)

    return sweep


def _operations(model: ClothModel, one: Callable[[ClothModel, Any], Any]) -> int:
    """Return the arithmetic of one pass over all stencils, each counted once in its compiled code."""
    total = 0
    for data in model.constraints:
        compiled = one(model, data)
        total += len(data.vertices) * len(_ARITHMETIC.findall(compiled.inspect_llvm(compiled.signatures[0])))
    return total


def _one_force(model: ClothModel, data: Any) -> Any:
    force = kind_of(data).force

    @njit(error_model="numpy")
    def one(i, x, data, forces):  # type: ignore[no-untyped-def]
        return force(i, x, data, forces)

    x = np.zeros((len(model.mass), 3))
    one(0, x, data, x.copy())
    return one


def _one_projection(model: ClothModel, data: Any) -> Any:
    project_stencil = kind_of(data).project

    @njit(error_model="numpy")
    def one(i, x, start, inverse_mass, data, lambdas, h):  # type: ignore[no-untyped-def]
        project_stencil(i, x, start, inverse_mass, data, lambdas, h)

    x = np.zeros((len(model.mass), 3))
    one(0, x, x.copy(), model.inverse_mass, data, multipliers((data,))[0], _H)
    return one
