"""`python -m vto_pipeline.bench.motion FILE...` carries motions over to five bodies, and prints how clean they are.

Angles between limbs of source and avatar are given as median and largest: feet are held, arms kept off the body.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.avatar.motion.figures import crossing_frames
from vto_pipeline.avatar.motion.retarget import RetargetConfig, retarget
from vto_pipeline.avatar.template.template import template
from vto_pipeline.bench.motion.limb_angles import BONES, limb_angles
from vto_pipeline.bench.printed_table import print_table
from vto_pipeline.io.motion.read import read_motion
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar, Measurements

_HEADS = (
    "clip",
    "body",
    "frames",
    "plants",
    "drift before mm",
    "after mm",
    "jerks before",
    "after",
    "below floor mm",
    "balanced %",
    "limbs through",
    *(f"{limb} off deg" for limb in BONES),
    "CPU s",
)
_LOOKED_AT = 12


def bodies() -> dict[str, Avatar]:
    """Return five bodies: the mean woman and man, and a short wide, a tall slim and a heavy one."""
    return {
        "woman": template(0.0),
        "man": template(1.0),
        "short, wide": fit_measurements(
            Measurements({"stature": 1.52, "waist_girth": 1.0, "hip_girth": 1.15}, sex="female")
        ),
        "tall, slim": fit_measurements(Measurements({"stature": 1.92, "chest_girth": 0.96}, sex="male")),
        "heavy": fit_measurements(Measurements({"stature": 1.78, "waist_girth": 1.15}, sex="male")),
    }


def rows(sources: list[str], config: RetargetConfig) -> Iterator[tuple[str, ...]]:
    """Yield a row of figures for each motion and body.

    Args:
        sources: Files, or names of presets.
        config: How they are carried over.
    """
    people = bodies()
    for source in sources:
        read = read_motion(source)
        for name, body in people.items():
            began = time.process_time()
            motion, figures = retarget(read.clip, read.joints, body, config)
            seconds = time.process_time() - began
            crossing, looked_at = crossing_frames(motion, body, _LOOKED_AT)
            share = figures.balance.inside_share
            off = limb_angles(read, body, motion)
            yield (
                Path(source).stem,
                name,
                str(len(motion.poses)),
                str(figures.plants),
                f"{1e3 * figures.drift_before:.1f}",
                f"{1e3 * figures.drift_after:.3f}",
                str(figures.spikes_before),
                str(figures.spikes_after),
                f"{1e3 * figures.below_floor:.1f}",
                "-" if share is None else f"{100 * share:.0f}",
                f"{crossing} of {looked_at}",
                *(_median_and_most(off.get(limb)) for limb in BONES),
                f"{seconds:.2f}",
            )


def _median_and_most(angles: FloatArray | None) -> str:
    if angles is None:
        return "-"
    return f"{np.rad2deg(np.median(angles)):.0f}, {np.rad2deg(angles.max()):.0f}"


def main() -> int:
    """Read the command line and print the table."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.motion", description=__doc__)
    parser.add_argument("sources", nargs="+", metavar="FILE", help="a motion, or the name of a preset")
    parser.add_argument("--hips-aside", type=float, default=0.0, metavar="MM", help="how far hips may move aside")
    arguments = parser.parse_args()
    return print_table(_HEADS, rows(arguments.sources, RetargetConfig(hips_aside_mm=arguments.hips_aside)))


if __name__ == "__main__":
    sys.exit(main())
