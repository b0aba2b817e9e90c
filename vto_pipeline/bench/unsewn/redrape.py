"""`python -m vto_pipeline.bench.unsewn.redrape RUN...` drapes patterns that were found, and compares them with scans.

A RUN is the drape of a sewing pattern, or of a garment with panels. It is scanned, taken apart, and put on again:

scan: from where it was scanned, at rest as the panels that were found say
anew: those panels sewn, and put on as their file says that they were worn
flat: those panels sewn from a DXF file, which says where they stood, but nothing of how they were bent
truth: the true garment put on from the start in other triangles, which tells what another mesh alone changes

The bar is 3 mm on average between the surfaces. Each drape takes minutes.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from vto_pipeline.bench.own_process import last_error, run_vto
from vto_pipeline.bench.printed_table import print_table
from vto_pipeline.bench.unsewn.scans import draped_truth, scanned
from vto_pipeline.errors import InputError, VtoError
from vto_pipeline.garment.unsewn.recover import recover
from vto_pipeline.geometry.closest import closest_points
from vto_pipeline.geometry.topology import face_areas, surface_area
from vto_pipeline.io.documents import read_json
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.io.meshes import read_own_mesh
from vto_pipeline.io.patterns.panels_obj import write_panels_obj
from vto_pipeline.io.patterns.write import write_pattern
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

_HEADS = ("garment", "way", "outcome", "at rest", "mean mm", "p95 mm", "area %", "CPU s", "passes", "said")
_WAYS = ("scan", "anew", "flat", "truth")
_OTHER = 0.9  # of the edge length, where only the triangles are to differ


def rows(runs: list[Path], args: argparse.Namespace) -> Iterator[tuple[str, ...]]:
    """Yield a row for each way of draping each run's garment again.

    Args:
        runs: Folders.
        args: ways, edge_mm and noise_mm of simulated scans, drape_mm, limit [s], and a folder for what is made.
    """
    for run in runs:
        try:
            truth = draped_truth(run)
            given = _given(run)
            scan, lines = scanned(truth, 1e-3 * args.edge_mm, 1e-3 * args.noise_mm, 0)
            found = recover(scan, lines, read_fabric(given["fabric"]), run.name, Job())
        except VtoError as error:
            yield (run.name, "", f"refused: {error.problem}", *[""] * 5, "NO", "")
            continue
        args.out.mkdir(parents=True, exist_ok=True)
        for suffix in (".json", ".dxf"):
            write_pattern(args.out / f"{run.name}{suffix}", found.pattern)
        write_panels_obj(args.out / f"{run.name}_panels.obj", found.mesh)
        on = ["--body", given["body"], "--fabric", given["fabric"]]
        ways = {
            "scan": ["--garment", str(args.out / f"{run.name}_panels.obj"), "--source-body", given["body"]],
            "anew": ["--garment", str(args.out / f"{run.name}.json")],
            "flat": ["--garment", str(args.out / f"{run.name}.dxf")],
            "truth": ["--garment", given["garment"]],
        }
        for way in args.ways:
            edge_mm = args.drape_mm * (_OTHER if way == "truth" else 1.0)
            yield _draped(run.name, way, [*ways[way], *on], edge_mm, args, truth)


def apart(one: TriangleMesh, other: TriangleMesh) -> tuple[float, float]:
    """Return mean and 95th percentile of the distances between two surfaces, both ways, by area [m]."""
    off, weight = [], []
    for here, there in ((one, other), (other, one)):
        area = face_areas(here)
        off.append(closest_points(here.vertices[here.faces].mean(axis=1), there.vertices, there.faces)[2])
        weight.append(area / area.sum())
    every, share = np.concatenate(off), np.concatenate(weight)
    return float(every @ share / 2.0), float(np.quantile(every, 0.95, weights=share, method="inverted_cdf"))


def _draped(
    name: str, way: str, command: list[str], edge_mm: float, args: argparse.Namespace, truth: TriangleMesh
) -> tuple[str, ...]:
    folder = args.out / f"{name}_{way}"
    edges = [f"--set={stage}.edge_mm={edge_mm:g}" for stage in ("sew", "simulation_mesh")]
    log = args.out / f"{name}_{way}.log"
    ended = run_vto(["drape", *command, *edges, "-o", str(folder)], log, args.limit)
    made = folder / "out" if ended.outcome == "done" else folder / "out" / "partial"
    if not (made / "draped.ply").exists():
        return (name, way, ended.outcome, *[""] * 4, f"{ended.cpu_seconds:.0f}", "NO", last_error(log))
    again = read_own_mesh(made / "draped.ply")
    settled = read_json(made / "audit.json").get("settled") if (made / "audit.json").exists() else None
    mean, p95 = apart(again, truth)
    larger = surface_area(again) / surface_area(truth) - 1.0
    passes = "yes" if ended.outcome == "done" and mean < 3e-3 else "NO"
    figures = (f"{1e3 * mean:.2f}", f"{1e3 * p95:.1f}", f"{1e2 * larger:+.2f}", f"{ended.cpu_seconds:.0f}")
    return (name, way, ended.outcome, str(settled), *figures, passes, last_error(log))


def _given(run: Path) -> dict[str, str]:
    """Return what a run was given: its garment and its body, files, and its fabric.

    Raises:
        InputError: it was no drape of one garment on a mesh.
    """
    every = read_json(run / "run.json")["given"].values()
    given = {str(one["key"]).split(".")[0]: str(one.get("path", one.get("value"))) for one in every}
    if missing := {"garment", "body", "fabric"} - set(given):
        raise InputError(f"the run was not given a file of its {', '.join(sorted(missing))}", where=str(run))
    return given


def main() -> int:
    """Read the command line, drape, and print a row each."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.unsewn.redrape", description=__doc__)
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="drapes of garments of known cut")
    parser.add_argument("--ways", nargs="+", choices=_WAYS, default=list(_WAYS), help="how each is put on again")
    parser.add_argument("--edge-mm", type=float, default=7.0, help="of simulated scans [mm]")
    parser.add_argument("--noise-mm", type=float, default=0.5, help="of simulated scans, in each direction [mm]")
    parser.add_argument("--drape-mm", type=float, default=10.0, help="edge length of the drapes [mm]")
    parser.add_argument("--limit", type=float, default=900.0, metavar="SECONDS", help="wall time of a drape")
    parser.add_argument("--out", type=Path, default=Path("runs/redrape"), metavar="FOLDER", help="for what is made")
    args = parser.parse_args()
    return print_table(_HEADS, rows(args.runs, args))


if __name__ == "__main__":
    sys.exit(main())
