"""Measures linear systems, sweeps of XPBD and whole scenes: ours on more and more threads, and on a graphics processor.

Systems are those of a file by `--export`, which drapes a garment; without one, those of a sheet on a ball are taken.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from vto_pipeline.bench.bench import Row, Value
from vto_pipeline.bench.cloth.scenes import sphere
from vto_pipeline.bench.cloth.solvers import run_scene
from vto_pipeline.bench.live_rows import LiveRows
from vto_pipeline.bench.machine import this_machine
from vto_pipeline.bench.provenance import provenance
from vto_pipeline.bench.scaling.direct_solvers import own_cholesky
from vto_pipeline.bench.scaling.gpu import TRADE
from vto_pipeline.bench.scaling.gpu.cusolver import cusolver_cholesky
from vto_pipeline.bench.scaling.gpu.device import Device
from vto_pipeline.bench.scaling.gpu.layout import SIZES, lay_out, one_by_one
from vto_pipeline.bench.scaling.gpu.systems import System, read_systems, recorded_systems, write_systems
from vto_pipeline.bench.scaling.throughput import compiled_sweep, seconds_of, sheet_cloth, sheet_system
from vto_pipeline.bench.timing import clocked, threads_now, timed
from vto_pipeline.cloth.constraints.sweep import multipliers
from vto_pipeline.cloth.dynamics.stepper import StepConfig
from vto_pipeline.cloth.model.build import ClothModel
from vto_pipeline.errors import VtoError
from vto_pipeline.io.documents import write_json
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.cpu_threads import limited_threads
from vto_pipeline.numerics.linear.block_matrix import to_scipy

Rows = Iterator[dict[str, Value]]
_STEP = 1.0 / 60.0  # s
_H = 1e-3  # s
_SWEEPS = 20
_TOLERANCES = (1e-3, 1e-6, 1e-9)
_MOST = 20_000  # iterations
_BUDGET = 1.0  # s: what takes longer runs once
_SECONDS = 0.5  # of a scene
_COLUMNS = ("part", "scene", "method", "threads", "seconds", "iterations", "residual", "error", "status")


def main() -> int:
    """Read the command line, and print a row for each measurement."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.scaling.gpu", description=__doc__)
    parser.add_argument("parts", nargs="*", choices=[[], *_PARTS], metavar="PART", help=f"of {', '.join(_PARTS)}")
    parser.add_argument("--systems", type=Path, metavar="FILE", help="of linear systems, by --export")
    parser.add_argument("--export", type=Path, metavar="FILE", help="drape, and write the systems here")
    parser.add_argument("--garment", type=Path, help="mesh or pattern file, for --export")
    parser.add_argument("--body", type=Path, help="mesh file, for --export")
    parser.add_argument("--edge-mm", type=float, default=20.0, help="of the simulation mesh, for --export")
    parser.add_argument("--sides", type=int, nargs="+", default=[64, 128, 256], help="of sheets, in vertices")
    parser.add_argument("-o", "--out", type=Path, default=Path("runs/gpu"), help="folder for rows.jsonl")
    arguments = parser.parse_args()
    try:
        if arguments.export:
            export(arguments.export, arguments.garment, arguments.body, arguments.edge_mm, arguments.out)
            return 0
        table = LiveRows(arguments.out, _COLUMNS)
        for part in arguments.parts or _PARTS:
            for row in _PARTS[part](arguments.systems, arguments.sides):
                table.add({"part": part, **row})
                write_document(arguments.out)
    except VtoError as error:
        sys.stderr.write(f"{error}\n")
        return error.exit_code
    return 0


def write_document(folder: Path) -> None:
    """Write gpu.json, a results file of all rows that a folder has got so far."""
    with (folder / "rows.jsonl").open(encoding="utf-8") as lines:
        rows = [_row(json.loads(line)).as_json() for line in lines]
    head = {"bench": "gpu", "quick": False, **provenance("python -m vto_pipeline.bench.scaling.gpu")}
    write_json(folder / "gpu.json", {**head, "machine": this_machine(), "rows": rows, "fronts": TRADE})


def _row(found: dict[str, Any]) -> Row:
    """Return a line of the table as a row of a results file."""
    settings = {"part": found.pop("part")}
    size, seconds, threads = found.pop("vertices", 0), found.pop("seconds", 0.0), found.pop("threads", threads_now())
    return Row(found.pop("scene"), found.pop("method"), settings, size, seconds, found, threads=threads)


def export(file: Path, garment: Path, body: Path, edge_mm: float, folder: Path) -> None:
    """Drape a garment on a body, and write systems that were met on the way to a file."""
    from vto_pipeline.stages.entry.commands import drape

    with recorded_systems() as found:
        drape(garment, body=body, output=folder / "drape", settings={"simulation_mesh.edge_mm": edge_mm})
    write_systems(file, found)


def systems_of(file: Path | None, sides: Sequence[int]) -> Iterator[System]:
    """Yield the systems of a file, or of sheets of so many vertices a side, with a random right side."""
    if file is not None:
        yield from read_systems(file)
        return
    for side in sides:
        matrix = sheet_system(side, _STEP)
        right = np.random.default_rng(0).standard_normal((side**2, 3))
        own = own_cholesky(matrix)
        own.factor()
        yield System(f"{side**2} sheet", matrix, right, own.solve(right))


def processor_systems(file: Path | None, sides: Sequence[int]) -> Rows:
    """Our factorisation and solution on 1, 2, 4 ... threads."""
    for system in systems_of(file, sides):
        own = own_cholesky(system.matrix)
        own.factor()
        for threads in _threads():
            with limited_threads(threads):
                _, factor = timed(own.factor, runs=5, budget=_BUDGET)
                x, solve = timed(partial(own.solve, system.right), runs=5, budget=_BUDGET)
            spent = {"threads": threads, "seconds": factor.seconds + solve.seconds, "solve_s": solve.seconds}
            yield {"scene": system.name, "method": "own Cholesky", **spent, **_misses(system, x)}


def device_systems(file: Path | None, sides: Sequence[int]) -> Rows:
    """Conjugate gradients on the device, preconditioned by domains of some sizes."""
    device = Device()
    yield {"scene": device.name, "method": "limits", **device.limits()}
    for system in systems_of(file, sides):
        for size in SIZES:
            layout = lay_out(system.matrix, size)
            inverses, prepared = device.invert(layout)
            for tolerance in _TOLERANCES:
                found = device.conjugate_gradients(layout, inverses, system.right, tolerance, _MOST)
                yield {
                    "scene": system.name,
                    "method": f"conjugate gradients to {tolerance:g}, domains of {size}",
                    "seconds": found.seconds,
                    "prepare_s": prepared,
                    "iterations": found.iterations,
                    "iteration_us": 1e6 * found.seconds / max(found.iterations, 1),
                    "moved_mb": 1e-6 * (layout.values.nbytes + layout.columns.nbytes + layout.domains.nbytes),
                    "status": "reached" if found.residual <= tolerance else "not reached",
                    **_misses(system, found.x),
                }


def device_elimination(file: Path | None, sides: Sequence[int]) -> Rows:
    """The sparse Cholesky factorisation of the device's maker."""
    device = Device()
    for system in systems_of(file, sides):
        x, times = cusolver_cholesky(system.matrix, system.right)
        spent = {"seconds": times["factor_s"] + times["solve_s"], **times}
        yield {"scene": system.name, "method": f"cuSOLVER Cholesky on {device.name}", **spent, **_misses(system, x)}


def processor_sweeps(file: Path | None, sides: Sequence[int]) -> Rows:
    """One sweep of XPBD by ours on 1, 2, 4 ... threads."""
    sweep = compiled_sweep()
    for side in sides:
        model, x = sheet_cloth(side)
        for threads in _threads():
            with limited_threads(threads):
                timing = seconds_of(partial(_swept, sweep, model, model.constraints, x, threads > 1))
            spent = {"threads": threads, "seconds": timing.seconds / _SWEEPS}
            yield {"scene": f"sheet {side}", "method": "own sweep", "vertices": side**2, **spent}


def device_sweeps(file: Path | None, sides: Sequence[int]) -> Rows:
    """One sweep of XPBD on the device; where ours leads from the same positions in the same order."""
    device, sweep = Device(), compiled_sweep()
    for side in sides:
        model, x = sheet_cloth(side)
        bend, stretch = (one_by_one(data, side**2) for data in model.constraints)
        there, seconds = device.sweeps(_SWEEPS, x, model.inverse_mass, bend, stretch, _H)
        here = _swept(sweep, model, (bend, stretch), x, False)
        yield {
            "scene": f"sheet {side}",
            "method": "sweep on the device",
            "vertices": side**2,
            "seconds": seconds / _SWEEPS,
            "colours": len(bend.colours) + len(stretch.colours) - 2,
            "difference_m": float(np.abs(there - here).max()),
            "moved_m": float(np.abs(here - x).max()),
        }


def _swept(sweep: Any, model: ClothModel, constraints: tuple[Any, ...], x: FloatArray, threaded: bool) -> FloatArray:
    """Return positions after some sweeps."""
    moved, lambdas = x.copy(), multipliers(constraints)
    for _ in range(_SWEEPS):
        sweep(moved, x, model.inverse_mass, constraints, lambdas, _H, threaded)
    return moved


def scenes(file: Path | None, sides: Sequence[int]) -> Rows:
    """A sheet falling on a ball, for half a second, by the default method on more and more threads."""
    config = StepConfig.model_validate({})
    for side in sides:
        scene = replace(sphere(side), seconds=_SECONDS)
        run_scene(scene, config)  # compiles
        for threads in reversed(_threads()):
            with limited_threads(threads):
                (state, _), seconds = clocked(run_scene, scene, config)
            bits = crc32(state.positions.tobytes())
            yield {"scene": scene.name, "method": "default", "threads": threads, "seconds": seconds, "bits": bits}


_PARTS: dict[str, Callable[[Path | None, Sequence[int]], Rows]] = {
    "device-systems": device_systems,
    "device-sweeps": device_sweeps,
    "processor-systems": processor_systems,
    "processor-sweeps": processor_sweeps,
    "scenes": scenes,
    "device-elimination": device_elimination,
}


def _threads() -> list[int]:
    most = threads_now()
    return [count for count in (1, 2, 4, 8, 16, 32, 64) if count <= most]


def _misses(system: System, x: FloatArray) -> dict[str, Value]:
    """Return the size of a system, what is left of its right side, and how far x is from its solution, as shares."""
    left = to_scipy(system.matrix) @ x.ravel() - system.right.ravel()
    return {
        "vertices": len(x),
        "residual": float(np.linalg.norm(left) / np.linalg.norm(system.right)),
        "error": float(np.abs(x - system.solution).max() / np.abs(system.solution).max()),
    }


if __name__ == "__main__":
    sys.exit(main())
