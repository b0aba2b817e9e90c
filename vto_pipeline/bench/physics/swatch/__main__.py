"""`python -m vto_pipeline.bench.physics.swatch` measures simulated strips of known rigidity: errors and coverage.

Bars: rigidity within 10 %, and the interval of 95 % covers the truth 19 of 20 times.
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np

from vto_pipeline.bench.physics.swatch.strips import any_cloth, hung
from vto_pipeline.bench.printed_table import print_table
from vto_pipeline.cloth.swatch.fit import fit_strips
from vto_pipeline.errors import VtoError

_HEADS = ("strips, faces", "shared noise mm", "fabrics", "refused", "error %: median", "p95", "most")
_MORE = ("within 10 %", "covered", "interval ± %, median", "CPU s each")
_SCENES = {"one, up": (1,), "two, up and down": (1, -1), "four, both": (1, -1, 1, -1)}


def row(name: str, reach: float, runs: int) -> tuple[str, ...]:
    """Return the figures of one scene as words."""
    errors, covered, widths, refused = [], 0, [], 0
    began = time.process_time()
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        cloth = any_cloth(rng)
        strips = [hung(cloth, rng, face, reach) for face in _SCENES[name]]
        try:
            found = fit_strips(strips, cloth.weight)
        except VtoError as error:
            sys.stderr.write(f"{name}, fabric {seed}: {error}\n")
            refused += 1
            continue
        low, high = found.interval
        errors.append(100.0 * abs(found.rigidity / cloth.rigidity - 1.0))
        covered += low <= cloth.rigidity <= high
        widths.append(50.0 * (high - low) / found.rigidity)
    seconds = (time.process_time() - began) / runs
    head = (name, f"{1e3 * reach:g}", str(runs), str(refused))
    if not errors:
        return (*head, *["-"] * 6, f"{seconds:.1f}")
    spread = [f"{value:.1f}" for value in (np.median(errors), np.quantile(errors, 0.95), max(errors))]
    within = sum(error < 10.0 for error in errors)
    counts = (f"{within} of {len(errors)}", f"{covered} of {len(errors)}")
    return (*head, *spread, *counts, f"{np.median(widths):.0f}", f"{seconds:.1f}")


def main() -> int:
    """Read the command line and print the table."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.physics.swatch", description=__doc__)
    parser.add_argument("--runs", type=int, default=100, help="fabrics of each scene")
    parser.add_argument("--scene", choices=list(_SCENES), action="append", help="only this; may be repeated")
    parser.add_argument("--reach-mm", type=float, action="append", help="over which noise is shared; may be repeated")
    args = parser.parse_args()
    scenes = ((name, reach) for name in args.scene or _SCENES for reach in args.reach_mm or (0.0, 5.0, 20.0))
    return print_table((*_HEADS, *_MORE), (row(name, 1e-3 * reach, args.runs) for name, reach in scenes))


if __name__ == "__main__":
    sys.exit(main())
