"""`python -m vto_pipeline.bench.unsewn FILE|RUN...` takes garments of known cut apart, and prints what is wrong.

A FILE is a garment whose texture coordinates are its true panels: it is cut along them. A RUN is the drape of a sewing
pattern: it is scanned in other triangles, with noise and drawn seams. Bars: area within 1 %, outlines within 3 mm on
average, seams within 5 mm.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from vto_pipeline.bench.printed_table import print_table
from vto_pipeline.bench.unsewn.compare import PanelErrors, compare
from vto_pipeline.bench.unsewn.scans import draped_truth, scanned
from vto_pipeline.errors import InputError, VtoError
from vto_pipeline.garment.unsewn.recover import recover
from vto_pipeline.garment.unsewn.unsew import Unsewn
from vto_pipeline.geometry.topology import surface_area
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.io.meshes import read_mesh, write_ply
from vto_pipeline.io.patterns.panels_obj import write_panels_obj
from vto_pipeline.io.patterns.write import write_pattern
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.units import LENGTH_M

_HEADS = (
    "garment",
    "panel",
    "true cm²",
    "area %",
    "as worn %",
    "outline mm, mean",
    "most",
    "worst seam mm",
    "as worn mm",
    "stretch left, p95 %",
    "passes",
)


def rows(sources: list[str], args: argparse.Namespace) -> Iterator[tuple[str, ...]]:
    """Yield a row of figures for each panel of each garment.

    Args:
        sources: Files and runs.
        args: edge_mm and noise_mm of simulated scans, fabric, and a folder for patterns.
    """
    fabric = read_fabric(args.fabric)
    for source in map(Path, sources):
        try:
            yield from _rows_of(source, fabric, args)
        except VtoError as error:
            yield (source.stem, f"refused: {error.problem}", *[""] * 8, "NO")


def _rows_of(source: Path, fabric: Fabric, args: argparse.Namespace) -> Iterator[tuple[str, ...]]:
    began = time.process_time()
    job = Job()
    scan: TriangleMesh | None = None
    if source.is_dir():
        truth = draped_truth(source)
        scan, lines = scanned(truth, 1e-3 * args.edge_mm, 1e-3 * args.noise_mm, 0)
        found = recover(scan, lines, fabric, source.name, job)
    else:
        truth = _true_panels(source)
        found = recover(truth, "charts", fabric, source.stem, job)
    seconds = time.process_time() - began
    if args.out is not None:
        _keep(args.out, source.stem, found, scan)
    errors = compare(found, truth)
    yield from _table(source.stem, errors, found)
    passed = sum(map(_passes, errors))
    yield (source.stem, f"{passed} of {len(errors)} pass", *[""] * 8, f"{seconds:.0f} s CPU")


def _true_panels(path: Path) -> TriangleMesh:
    mesh = read_mesh(path)
    if mesh.texture is None:
        raise InputError("no texture coordinates, so no true panels", where=str(path))
    flat = 0.5 * np.abs(np.linalg.det(mesh.texture[:, 1:] - mesh.texture[:, :1])).sum()
    unit = min(LENGTH_M.values(), key=lambda scale: abs(np.log(np.sqrt(surface_area(mesh) / flat) / scale)))
    return TriangleMesh(mesh.vertices, mesh.faces, texture=unit * mesh.texture)


def _passes(one: PanelErrors) -> bool:
    seams = bool((np.abs(one.seams) < 5e-3).all())
    return abs(one.area) < 0.01 and one.outline_mean < 3e-3 and seams


def _table(name: str, errors: list[PanelErrors], found: Unsewn) -> Iterator[tuple[str, ...]]:
    for one, piece in zip(errors, found.pieces, strict=True):
        worst, worn = 0.0, 0.0
        if len(one.seams):
            at = int(np.abs(one.seams).argmax())
            worst, worn = float(one.seams[at]), float(one.worn_seams[at])
        yield (
            name,
            one.name,
            f"{1e4 * one.true_area:.0f}",
            f"{1e2 * one.area:+.2f}",
            f"{1e2 * one.worn:+.2f}",
            f"{1e3 * one.outline_mean:.2f}",
            f"{1e3 * one.outline_most:.1f}",
            f"{1e3 * worst:+.1f}",
            f"{1e3 * worn:+.1f}",
            f"{1e2 * piece.stretch[1]:.1f}",
            "yes" if _passes(one) else "NO",
        )


def _keep(folder: Path, name: str, found: Unsewn, scan: TriangleMesh | None) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for suffix in (".json", ".svg"):
        write_pattern(folder / f"{name}{suffix}", found.pattern)
    write_panels_obj(folder / f"{name}_panels.obj", found.mesh)
    if scan is not None:
        write_ply(folder / f"{name}_scan.ply", scan)


def main() -> int:
    """Read the command line and print the table."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.unsewn", description=__doc__)
    parser.add_argument("sources", nargs="+", metavar="FILE|RUN", help="a garment with its panels, or a draped pattern")
    parser.add_argument("--edge-mm", type=float, default=7.0, help="of simulated scans [mm]")
    parser.add_argument("--noise-mm", type=float, default=0.5, help="of simulated scans, in each direction [mm]")
    parser.add_argument("--fabric", default="cotton_poplin", help="name or file")
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="where patterns, pictures and scans are kept")
    args = parser.parse_args()
    return print_table(_HEADS, rows(args.sources, args))


if __name__ == "__main__":
    sys.exit(main())
