"""`python -m vto_pipeline.bench.drape.garments` drapes garments of any origin on bodies, each as a user would.

Each run is `vto drape` in a process of its own, so that one that crashes or takes too long costs no other; its row is
written as soon as it ends, and so outlives whatever ends the bench. Begun again, it runs what is missing. At the end
rows.csv has all rows and table.png a picture of each, garments down and bodies across. A garment counts as too small
where the body needs it larger, or where it comes to rest stretched as no cloth is.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.bench.bench import Value
from vto_pipeline.bench.drape.ipc_crossings import crossings
from vto_pipeline.bench.drape.picture_table import write_picture_table
from vto_pipeline.bench.live_rows import LiveRows
from vto_pipeline.bench.own_process import last_error, run_vto
from vto_pipeline.io.documents import read_json
from vto_pipeline.io.meshes import read_mesh

_COLUMNS = (
    "garment",
    "body",
    "fabric",
    "vertices",
    "too_small",
    "outcome",
    "seconds",
    "cpu_s",
    "settled",
    "crossings",
    "residual",
    "predicted_mm",
    "within_1_mm_s",
    "stretch",
    "said",
)
_KEY = ("garment", "body", "fabric")
_DEFAULT = "default"


def main() -> None:
    """Read the command line, drape, and print a row each."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.drape.garments", description=__doc__)
    parser.add_argument("--garment", type=Path, nargs="+", required=True, help="mesh or pattern files")
    parser.add_argument("--body", type=Path, nargs="+", required=True, help="mesh files of the wearers")
    parser.add_argument("--fabric", nargs="+", default=[_DEFAULT], help="names or files, as `vto drape` takes them")
    parser.add_argument(
        "--limit", type=float, default=150.0, metavar="SECONDS", help="of a run, after which it is ended"
    )
    parser.add_argument(
        "--set", dest="settings", nargs="*", default=[], metavar="STAGE.KEY=VALUE", help="of `vto drape`"
    )
    parser.add_argument(
        "--sample", type=int, metavar="ROWS", help="run so many, drawn at random, instead of every combination"
    )
    parser.add_argument("--seed", type=int, default=0, help="of --sample")
    parser.add_argument(
        "--out", type=Path, default=Path("runs/garments"), metavar="DIR", help="for runs, rows and pictures"
    )
    arguments = parser.parse_args()
    table = LiveRows(arguments.out, _COLUMNS)
    done = {tuple(row[name] for name in _KEY) for row in table.rows}
    rows = list(product(arguments.body, arguments.fabric, arguments.garment))
    if arguments.sample is not None:
        drawn = np.random.default_rng(arguments.seed).permutation(len(rows))[: arguments.sample]
        rows = [rows[at] for at in drawn]
    for body, fabric, garment in rows:
        if (garment.stem, body.stem, fabric) not in done:
            table.add(drape_row(garment, body, fabric, arguments.out, arguments.settings, arguments.limit))
    table.write_csv()
    bodies = {body.stem: body for body in arguments.body}
    write_picture_table(arguments.out / "table.png", table.rows, bodies, lambda row: _folder(arguments.out, row))
    sys.stdout.write("\n".join(summary(table.rows)) + "\n")


def drape_row(
    garment: Path, body: Path, fabric: str, out: Path, settings: Sequence[str], limit: float
) -> dict[str, Value]:
    """Return what became of one run; figures that it did not reach are None.

    Args:
        garment: Mesh or pattern file.
        body: Mesh file.
        fabric: Name or file.
        out: For the run.
        settings: As `--set` takes them.
        limit: Wall time after which the run is ended, with all that it has started [s].
    """
    row: dict[str, Value] = {"garment": garment.stem, "body": body.stem, "fabric": fabric}
    folder = _folder(out, row)
    command = ["drape", "--garment", str(garment), "--body", str(body), "-o", str(folder)]
    command += [] if fabric == _DEFAULT else ["--fabric", fabric]
    for one in settings:
        command += ["--set", one]
    log = folder.parent / f"{folder.name}.log"
    ended = run_vto(command, log, limit)
    row |= {"outcome": ended.outcome, "seconds": ended.seconds, "cpu_s": ended.cpu_seconds}
    return row | {"said": last_error(log)} | _figures(folder, body)


def summary(rows: Sequence[Mapping[str, Value]]) -> list[str]:
    """Return in words what came of the garments that are large enough, and of those that are not."""
    fit = [row for row in rows if not row["too_small"]]
    done = [row for row in fit if row["outcome"] == "done"]
    rest = [row for row in done if row["settled"]]
    crossed = sum(int(row["crossings"] or 0) > 0 for row in done)
    said = [
        f"{len(rows)} runs, {len(fit)} of garments that are large enough: {len(done)} of them done, "
        f"{len(rest)} at rest, {crossed} with crossings"
    ]
    if done:
        seconds = [float(row["seconds"] or 0.0) for row in done]
        said.append(f"these took {np.median(seconds):.1f} s (median), {max(seconds):.1f} s at most")
    small = [row for row in rows if row["too_small"]]
    refused = [float(row["seconds"] or 0.0) for row in small if row["outcome"] != "done"]
    if small:
        said.append(f"{len(small)} garments too small: {len(small) - len(refused)} done all the same")
    if refused:
        said.append(f"the others ended after {np.median(refused):.1f} s (median), {max(refused):.1f} s at most")
    return said


def _folder(out: Path, row: Mapping[str, Value]) -> Path:
    """Return where a row's run is."""
    fabric = "" if row["fabric"] == _DEFAULT else f"_in_{Path(str(row['fabric'])).stem}"
    return out / f"{row['garment']}_on_{row['body']}{fabric}"


def _figures(folder: Path, body: Path) -> dict[str, Value]:
    """Return the figures of a run's files, as far as it has got; crossings are ipctk's, where it was done."""
    audit = _document(folder / "out" / "audit.json") or _document(folder / "out" / "partial" / "audit.json")
    kinds = ("body_intersections", "self_intersections")
    found = [audit[kind] for kind in kinds if kind in audit]
    stages = {stage["name"]: stage for stage in _document(folder / "run.json").get("stages", [])}
    metrics = stages.get("drape", {}).get("metrics", {})
    mesh, draped = folder / "out" / "sim_mesh.ply", folder / "out" / "draped.ply"
    return {
        "vertices": len(read_mesh(mesh).vertices) if mesh.exists() else None,
        "too_small": bool(metrics.get("needs_larger_share") or metrics.get("too_small")),
        "crossings": crossings(read_mesh(draped), read_mesh(body))
        if draped.exists()
        else sum(found)
        if found
        else None,
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
