"""`python -m vto_pipeline.bench.physics.swatch.discs` fits real fabrics to their drape and drapes them anew.

Bar: the coefficient comes out within 3 points, in the mean of drapes that begin in other unevenness.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from vto_pipeline.bench.physics.cusick import GEOMETRIES, MEASURED
from vto_pipeline.bench.printed_table import print_table
from vto_pipeline.cloth.swatch.disc import at_minimum, drape_coefficient, resolving_edge, specimen
from vto_pipeline.cloth.swatch.fit_drape import fit_drape
from vto_pipeline.errors import DivergedError
from vto_pipeline.model.job import Job

_HEADS = (
    *("fabric", "test", "measured %", "B µN·m", "interval", "by KES-FB", "spread points", "anew %", "off points"),
    "CPU s",
)
_FRESH = 1000
"""First seed of the drapes anew: far from those of the fit."""


def row(name: str, geometry: str, drapes: int, finer: float) -> tuple[str, ...]:
    """Return the figures of one fabric as words.

    Args:
        name: Of `MEASURED`.
        geometry: Of `GEOMETRIES`.
        drapes: How many anew.
        finer: How many times as fine as the fit's their mesh is.
    """
    real, test, began = MEASURED[name], GEOMETRIES[geometry], time.process_time()
    found = fit_drape(real.drape, 1, real.fabric(name), test, Job())
    fabric = replace(real.fabric(name), bending_warp=found.rigidity, bending_weft=found.rigidity)
    edge = resolving_edge(found.rigidity, real.density) / finer
    anew = []
    for seed in range(_FRESH, _FRESH + drapes):
        one = specimen(fabric, test, "irregular", edge, seed=seed)
        try:
            anew.append(100.0 * drape_coefficient(at_minimum(one), one.model.faces, test))
        except DivergedError as error:
            sys.stderr.write(f"{name}, seed {seed}: {error}\n")
    low, high = (1e6 * end for end in found.interval)
    figures = (100.0 * real.drape, 1e6 * found.rigidity)
    return (
        *(name, geometry, *(f"{value:.3g}" for value in figures), f"{low:.2g} to {high:.2g}"),
        *(f"{1e6 * real.rigidity:.3g}", f"{100.0 * found.spread:.1f}", f"{np.mean(anew):.1f}"),
        *(f"{np.mean(anew) - 100.0 * real.drape:+.1f}", f"{time.process_time() - began:.0f}"),
    )


def main() -> int:
    """Read the command line and print the table."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.physics.swatch.discs", description=__doc__)
    parser.add_argument("--fabric", choices=list(MEASURED), nargs="+", default=list(MEASURED), help="only these")
    parser.add_argument("--test", choices=list(GEOMETRIES), nargs="+", default=["30/18"], help="sizes [cm]")
    parser.add_argument("--drapes", type=int, default=8, help="anew")
    parser.add_argument("--finer", type=float, default=1.25, help="times, the mesh of the drapes anew than the fit's")
    args = parser.parse_args()

    def rows() -> Iterator[tuple[str, ...]]:
        for name in args.fabric:
            for geometry in args.test:
                yield row(name, geometry, args.drapes, args.finer)

    return print_table(_HEADS, rows())


if __name__ == "__main__":
    sys.exit(main())
