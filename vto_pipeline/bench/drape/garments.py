"""`python -m vto_pipeline.bench.drape.garments` drapes garments of any origin, each as a user would, one after another.

Each run is `vto drape` in a process of its own, so that one that crashes or takes too long costs no other; its row is
written as soon as it ends, and so outlives whatever ends the bench.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from vto_pipeline.bench.bench import Value
from vto_pipeline.bench.live_rows import LiveRows
from vto_pipeline.bench.own_process import run_vto
from vto_pipeline.io.documents import read_json
from vto_pipeline.io.meshes import read_mesh

_COLUMNS = (
    "garment",
    "vertices",
    "outcome",
    "seconds",
    "crossings",
    "settled",
    "residual",
    "predicted_mm",
    "within_1_mm_s",
    "stretch",
)


def main() -> None:
    """Read the command line, drape, and print a row each."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.drape.garments", description=__doc__)
    parser.add_argument("--garment", type=Path, nargs="+", required=True, help="mesh or pattern files")
    parser.add_argument("--body", type=Path, required=True, help="mesh file of the wearer")
    parser.add_argument(
        "--limit", type=float, default=150.0, metavar="SECONDS", help="of a run, after which it is ended"
    )
    parser.add_argument(
        "--set", dest="settings", nargs="*", default=[], metavar="STAGE.KEY=VALUE", help="of `vto drape`"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("runs/garments"), metavar="DIR", help="for runs and rows.jsonl"
    )
    arguments = parser.parse_args()
    table = LiveRows(arguments.out, _COLUMNS)
    for garment in arguments.garment:
        folder = arguments.out / f"{garment.stem}_on_{arguments.body.stem}"
        table.add(drape_row(garment, arguments.body, folder, arguments.settings, arguments.limit))


def drape_row(garment: Path, body: Path, folder: Path, settings: Sequence[str], limit: float) -> dict[str, Value]:
    """Return what became of one run; figures that it did not reach are None.

    Args:
        garment: Mesh or pattern file.
        body: Mesh file.
        folder: Of the run.
        settings: As `--set` takes them.
        limit: Wall time after which the run is ended, with all that it has started [s].
    """
    command = ["drape", "--garment", str(garment), "--body", str(body), "-o", str(folder)]
    for one in settings:
        command += ["--set", one]
    ended = run_vto(command, folder.parent / f"{folder.name}.log", limit)
    return {
        "garment": garment.stem,
        "body": body.stem,
        "outcome": ended.outcome,
        "seconds": ended.seconds,
        **_figures(folder),
    }


def _figures(folder: Path) -> dict[str, Value]:
    """Return the figures of a run's files, as far as it has got."""
    audit = _document(folder / "out" / "audit.json") or _document(folder / "out" / "partial" / "audit.json")
    kinds = ("body_intersections", "self_intersections")
    found = [audit[kind] for kind in kinds if kind in audit]
    stages = {stage["name"]: stage for stage in _document(folder / "run.json").get("stages", [])}
    metrics = stages.get("drape", {}).get("metrics", {})
    mesh = folder / "out" / "sim_mesh.ply"
    return {
        "vertices": len(read_mesh(mesh).vertices) if mesh.exists() else None,
        "crossings": sum(found) if found else None,
        "settled": audit.get("settled"),
        "residual": audit.get("residual"),
        "predicted_mm": metrics.get("error_mm"),
        "within_1_mm_s": metrics.get("within_1_mm_s"),
        "stretch": audit.get("max_stretch"),
    }


def _document(path: Path) -> Mapping[str, Any]:
    return read_json(path) if path.exists() else {}


if __name__ == "__main__":
    main()
