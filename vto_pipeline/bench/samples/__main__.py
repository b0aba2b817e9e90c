"""`python -m vto_pipeline.bench.samples --out sample_data` makes the sample data again."""

from __future__ import annotations

import argparse
import logging
import time
from pathlib import Path

from vto_pipeline.bench.samples.make import PARTS, make_samples

log = logging.getLogger("samples")


def main() -> None:
    """Read the command line and make the parts asked for."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.samples", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("sample_data"), help="folder to write to")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), help="parts to make")
    arguments = parser.parse_args()
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    start = time.perf_counter()
    make_samples(
        arguments.out, arguments.only, say=lambda text: log.info("%6.1f s  %s", time.perf_counter() - start, text)
    )


if __name__ == "__main__":
    main()
