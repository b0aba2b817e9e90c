"""`python -m vto_pipeline.bench RUN` compares a run on the sample data with the truth."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from vto_pipeline.bench.demo import measure_demo
from vto_pipeline.bench.picture import draw_demo


def main() -> None:
    """Read the command line, measure, and put the figures on stdout."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench", description=__doc__)
    parser.add_argument("run", type=Path, help="folder of a run of configs/demo.yaml or of another sample config")
    parser.add_argument("--samples", type=Path, default=Path("sample_data"), help="the sample data")
    parser.add_argument("--picture", type=Path, help="also draw the README's picture into this PNG")
    arguments = parser.parse_args()
    found = measure_demo(arguments.run, arguments.samples)
    json.dump(found, sys.stdout, indent=1)
    sys.stdout.write("\n")
    if arguments.picture is not None:
        from PIL import Image

        Image.fromarray(draw_demo(arguments.run, arguments.samples)).quantize(128).save(
            arguments.picture, optimize=True
        )


if __name__ == "__main__":
    main()
