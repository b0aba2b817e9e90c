"""`python -m vto_pipeline.bench.drape.sewn` sews patterns and drapes them on bodies, each as a user would.

Without `--pattern`, the six sample patterns are cut to each body and written as DXF, SVG and JSON. The DXF is draped.
Bars: every seam closed within 1 mm, no crossing by the independent judge ipctk, at rest.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from vto_pipeline.bench.bench import Value
from vto_pipeline.bench.drape.ipc_crossings import crossings
from vto_pipeline.bench.drape.seam_gaps import seam_gaps
from vto_pipeline.bench.live_rows import LiveRows
from vto_pipeline.bench.own_process import last_error, run_vto
from vto_pipeline.bench.samples.patterns.tape import tape_of
from vto_pipeline.bench.samples.patterns.wardrobe import PATTERNS
from vto_pipeline.garment.pattern.figures import seam_figures
from vto_pipeline.io.documents import read_json
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.io.patterns.read import read_pattern
from vto_pipeline.io.patterns.write import SUFFIXES, write_pattern

_COLUMNS = (
    "pattern",
    "body",
    "outcome",
    "vertices",
    "seconds",
    "cpu_s",
    "settled",
    "crossings",
    "gap_mm",
    "mismatch_mm",
    "said",
)


def main() -> None:
    """Read the command line, drape, and print a row each."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.drape.sewn", description=__doc__)
    parser.add_argument("--pattern", type=Path, nargs="+", default=[], help="files; none: the sample patterns")
    parser.add_argument("--only", nargs="+", choices=list(PATTERNS), default=list(PATTERNS), help="of the samples")
    parser.add_argument("--body", type=Path, nargs="+", required=True, help="mesh files of the wearers")
    parser.add_argument("--limit", type=float, default=600.0, metavar="SECONDS", help="of a run")
    parser.add_argument("--edge-mm", type=float, default=10.0, help="of the mesh [mm]")
    parser.add_argument("--out", type=Path, default=Path("runs/sewn"), metavar="DIR", help="for runs and rows.jsonl")
    arguments = parser.parse_args()
    table = LiveRows(arguments.out, _COLUMNS)
    for body in arguments.body:
        cut = arguments.pattern or sample_files(body, arguments.only, arguments.out)
        for pattern in cut:
            table.add(sewn_row(pattern, body, arguments.out, arguments.edge_mm, arguments.limit))


def sample_files(body: Path, names: list[str], out: Path) -> Iterator[Path]:
    """Yield the sample patterns cut to a body, in files; each is written in all formats."""
    tape = tape_of(read_mesh(body))
    for name in names:
        for suffix in SUFFIXES:
            path = out / "patterns" / body.stem / f"{name}{suffix}"
            path.parent.mkdir(parents=True, exist_ok=True)
            write_pattern(path, PATTERNS[name](tape))
        yield path.with_suffix(".dxf")


def sewn_row(pattern: Path, body: Path, out: Path, edge_mm: float, limit: float) -> dict[str, Value]:
    """Return what became of one run; figures that it did not reach are None.

    Args:
        pattern, body: Files.
        out: For the run.
        edge_mm: Of the mesh [mm].
        limit: Wall time after which the run is ended [s].
    """
    folder = out / f"{pattern.stem}_on_{body.stem}"
    command = ["drape", "--garment", str(pattern), "--body", str(body), "-o", str(folder)]
    for stage in ("sew", "simulation_mesh"):
        command += ["--set", f"{stage}.edge_mm={edge_mm:g}"]
    log = folder.parent / f"{folder.name}.log"
    ended = run_vto(command, log, limit)
    row: dict[str, Value] = {"pattern": pattern.stem, "body": body.stem, "outcome": ended.outcome}
    row |= {"seconds": ended.seconds, "cpu_s": ended.cpu_seconds, "said": last_error(log)}
    made = folder / "out" if ended.outcome == "done" else folder / "out" / "partial"
    return row | (_figures(pattern, folder, made, body) if (made / "draped.ply").exists() else {})


def _figures(file: Path, folder: Path, made: Path, body: Path) -> dict[str, Value]:
    """Return the figures of a drape, by ipctk and by the pattern's file."""
    pattern = read_pattern(file)
    pattern = pattern.of_size(pattern.sizes[0])
    draped = read_mesh(made / "draped.ply")
    with np.load(folder / "out" / "rest_shape.npz", allow_pickle=False) as rest:
        gaps = seam_gaps(pattern, rest["panels"], draped.faces, draped.vertices)
    seams = seam_figures(pattern)
    audit = read_json(made / "audit.json") if (made / "audit.json").exists() else {}
    return {
        "vertices": len(draped.vertices),
        "settled": audit.get("settled"),
        "crossings": crossings(draped, read_mesh(body)),
        "gap_mm": 1e3 * max(gaps, default=0.0),
        "mismatch_mm": max((abs(1e3 * one.mismatch) for one in seams), default=0.0),
    }


if __name__ == "__main__":
    main()
