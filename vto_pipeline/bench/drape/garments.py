"""`python -m vto_pipeline.bench.drape.garments` drapes garments of any origin, each as a user would, one after another.

Each run is `vto drape` in a process of its own, so that one that crashes or takes too long costs no other; its row is
written as soon as it ends, and so outlives whatever ends the bench.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from vto_pipeline.bench.bench import Value
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
_OUTCOMES = {0: "done", 1: "crashed", 2: "refused", 3: "refused", 4: "failed", 5: "refused"}


def main() -> None:
    """Read the command line, drape, and print a row each."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.drape.garments", description=__doc__)
    parser.add_argument("--garment", type=Path, nargs="+", required=True, help="mesh files")
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
    arguments.out.mkdir(parents=True, exist_ok=True)
    table = csv.writer(sys.stdout, "excel-tab")
    table.writerow(_COLUMNS)
    for garment in arguments.garment:
        folder = arguments.out / f"{garment.stem}_on_{arguments.body.stem}"
        row = drape_row(garment, arguments.body, folder, arguments.settings, arguments.limit)
        with (arguments.out / "rows.jsonl").open("a") as rows:
            rows.write(json.dumps(row) + "\n")
        table.writerow([_text(row[name]) for name in _COLUMNS])
        sys.stdout.flush()


def drape_row(garment: Path, body: Path, folder: Path, settings: Sequence[str], limit: float) -> dict[str, Value]:
    """Return what became of one run; figures that it did not reach are None.

    Args:
        garment, body: Mesh files.
        folder: Of the run.
        settings: As `--set` takes them.
        limit: Wall time after which the run is ended, with all that it has started [s].
    """
    command = ["drape", "--garment", str(garment), "--body", str(body), "-o", str(folder)]
    for one in settings:
        command += ["--set", one]
    program = "import sys; from vto_pipeline.cli.main import main; sys.exit(main())"
    began = time.perf_counter()
    folder.parent.mkdir(parents=True, exist_ok=True)
    with (folder.parent / f"{folder.name}.log").open("wb") as log:
        run = subprocess.Popen(
            [sys.executable, "-c", program, *command], stdout=log, stderr=log, start_new_session=True
        )
        try:
            outcome = _OUTCOMES.get(run.wait(limit), "killed")
        except subprocess.TimeoutExpired:
            os.killpg(run.pid, signal.SIGKILL)
            run.wait()
            outcome = "unfinished"
    seconds = time.perf_counter() - began
    return {"garment": garment.stem, "body": body.stem, "outcome": outcome, "seconds": seconds, **_figures(folder)}


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


def _text(value: Value) -> str:
    if value is None:
        return "-"
    return f"{value:.3g}" if isinstance(value, float) else str(value)


if __name__ == "__main__":
    main()
