"""`python -m vto_pipeline.bench.scaling.workers` runs garments x customers as a batch, with more and more workers.

Processor time tells where the wall time went that more workers did not save. If the same rows cost more of it, their
processes slow each other down: that is the machine. `busy` is the processor time in units of the wall time of all
workers: beyond 1 it is the batch's own process, which then shares the workers' cores, and below 1 a worker waited.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from vto_pipeline.bench.bench import Value
from vto_pipeline.bench.live_rows import LiveRows
from vto_pipeline.bench.own_process import run_vto
from vto_pipeline.errors import ComputationError, VtoError
from vto_pipeline.io.documents import write_json
from vto_pipeline.pipeline.batch.ledger import read_ledger
from vto_pipeline.pipeline.execution.store import MANIFEST

_COARSE = {"simulation_mesh": {"edge_mm": 30.0}, "drape": {"target_error_mm": 5.0}}
_DRESSED, _BARE = ["draped", "fit_report", "page"], ["avatar", "page"]
_FABRIC = "cotton_poplin"
_LIMIT = 24 * 3600.0  # s
_COLUMNS = ("workers", "rows", "done", "failed", "seconds", "share_of_first", "cpu_seconds", "busy", "made")


def order(garments: Sequence[Path], bodies: Sequence[Path], measurements: Sequence[Path]) -> dict[str, object]:
    """Return a batch document: every garment on every customer, coarse; without garments, an avatar of every customer.

    Args:
        garments: Meshes.
        bodies, measurements: The customers, as meshes or as tapes; one of the two.
    """
    kind, customers = ("mesh", bodies) if bodies else ("measurements", measurements)
    every = {f"given.body.{kind}": [str(path.absolute()) for path in customers]}
    if garments:
        every = {"given.garment.mesh": [str(path.absolute()) for path in garments], **every}
    run: dict[str, object] = {"schema": 1, "given": {}, "want": _BARE}
    if garments:
        run |= {"given": {"fabric": _FABRIC}, "want": _DRESSED, "stages": _COARSE}
    return {"schema": 1, "run": run, "every": every}


def rows(document: Mapping[str, object], counts: Sequence[int], folder: Path) -> Iterator[dict[str, Value]]:
    """Yield a row for each number of workers; each begins with nothing stored.

    Args:
        document: Of the batch.
        counts: Numbers of workers.
        folder: For the batches.

    Raises:
        ComputationError: a batch ended before its rows.
    """
    write_json(folder / "order.json", document)
    (folder / "order.yaml").write_bytes((folder / "order.json").read_bytes())  # JSON is YAML
    first = 0.0
    for count in counts:
        batch = folder / f"workers_{count}"
        if batch.exists():
            raise ComputationError("it was run before; give another folder", where=str(batch))
        command = ["batch", str(folder / "order.yaml"), "-o", str(batch), "--workers", str(count)]
        ended = run_vto(command, folder / f"workers_{count}.log", _LIMIT)
        if ended.code not in (0, 6):
            raise ComputationError(f"the batch ended with {ended.code}", where=str(folder / f"workers_{count}.log"))
        states = read_ledger(batch)["counts"]
        made = Counter(path.parents[1].name for path in (batch / "cache").glob(f"[!.]*/*/{MANIFEST}"))
        first = first or ended.seconds
        yield {
            "workers": count,
            "rows": sum(states.values()),
            "done": states.get("done", 0),
            "failed": sum(states.values()) - states.get("done", 0),
            "seconds": ended.seconds,
            "share_of_first": ended.seconds / first,
            "cpu_seconds": ended.cpu_seconds,
            "busy": ended.cpu_seconds / (count * ended.seconds),
            "made": ", ".join(f"{stage} {number}" for stage, number in sorted(made.items())),
        }


def main() -> int:
    """Read the command line, and print a row for each number of workers."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.scaling.workers", description=__doc__)
    parser.add_argument("garments", nargs="*", type=Path, metavar="GARMENT", help="meshes")
    customers = parser.add_mutually_exclusive_group(required=True)
    customers.add_argument("--body", nargs="+", type=Path, default=[], help="customers as meshes")
    customers.add_argument("--measurements", nargs="+", type=Path, default=[], help="customers as tapes")
    parser.add_argument("--workers", nargs="+", type=int, default=[1, 2], help="rows at once, one batch for each")
    parser.add_argument("-o", "--out", type=Path, default=Path("runs/workers"), help="folder for the batches")
    arguments = parser.parse_args()
    os.environ["NUMBA_NUM_THREADS"] = "1"  # a row takes the same work beside others as alone
    document = order(arguments.garments, arguments.body, arguments.measurements)
    table = LiveRows(arguments.out, _COLUMNS)
    try:
        for row in rows(document, arguments.workers, arguments.out):
            table.add(row)
    except VtoError as error:
        sys.stderr.write(f"{error}\n")
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main())
