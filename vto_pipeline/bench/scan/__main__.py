"""`python -m vto_pipeline.bench.scan` scans captures of any origin whose garment is known, each as a user would.

A capture is a folder that holds photos/, depth/ or cloud.ply, and body.ply (the bare form) and truth/garment.ply, both
in metres and in one frame. Each run is `vto scan` in a process of its own; its row is written as soon as it ends.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from vto_pipeline.bench.live_rows import LiveRows
from vto_pipeline.bench.scan.captures import KINDS, scan_row

_COLUMNS = (
    *("capture", "kind", "exit", "seconds", "cpu_s", "peak_mb", "cameras_mm", "median_mm", "p95_mm", "p99_mm"),
    *("back_p95_mm", "complete_2mm", "wrong_filled_percent", "wrong_rim_percent", "wrong_seen_percent"),
    *("missing_hidden_percent", "missing_shown_percent", "absent_shown_percent"),
    *("openings", "true_openings", "shown_rim_mm", "rim_found_percent", "rim_false_percent", "rim_off_percent"),
    *("scale_off_percent", "said_scale_percent", "predicted_median_mm", "predicted_p95_mm", "reason"),
)


def main() -> None:
    """Read the command line, scan, and print a row each."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.scan", description=__doc__)
    parser.add_argument("capture", type=Path, nargs="+", help="capture folders")
    parser.add_argument("--kind", choices=KINDS, action="append", help="what to scan from; default: all that is there")
    parser.add_argument(
        "--limit", type=float, default=600.0, metavar="SECONDS", help="of a run, after which it is ended"
    )
    parser.add_argument(
        "--set", dest="settings", nargs="*", default=[], metavar="STAGE.KEY=VALUE", help="of `vto scan`"
    )
    parser.add_argument("--out", type=Path, default=Path("runs/scans"), metavar="DIR", help="for runs and rows.jsonl")
    arguments = parser.parse_args()
    table = LiveRows(arguments.out, _COLUMNS)
    for capture in arguments.capture:
        for kind in arguments.kind or [kind for kind in KINDS if (capture / kind).exists()]:
            folder = arguments.out / f"{capture.name}_{kind.partition('.')[0]}"
            table.add(scan_row(capture, kind, folder, arguments.settings, arguments.limit))


if __name__ == "__main__":
    main()
