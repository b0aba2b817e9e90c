"""`python -m vto_pipeline.bench.motion.live RUN MOTION` prints error against run time of the garment of a live stream.

The garment of a run is carried through a motion frame by frame as `vto stream` does it, with several budgets, and once
by `follow`, whose frames are the truth. Both have the same mesh. Times are of the processor.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from vto_pipeline.avatar.motion.path import avatar_path
from vto_pipeline.avatar.motion.retarget import RetargetConfig, retarget
from vto_pipeline.bench.printed_table import print_table
from vto_pipeline.cloth.judge.crossings import crossings_between, self_crossings
from vto_pipeline.cloth.moving.follow import follow
from vto_pipeline.cloth.moving.live import LiveCloth
from vto_pipeline.geometry.intersections import self_intersections
from vto_pipeline.io.motion.read import read_motion
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.motion import BodyPath
from vto_pipeline.stages.entry.live import Worn, worn
from vto_pipeline.stages.entry.outcome import open_run

_BUDGETS = ((1, 1), (1, 2), (2, 2), (2, 3), (3, 4))
"""Iterations and rounds of contacts of a frame."""
_LOOKED_AT = 10  # frames in which crossings are counted
_HEADS = (
    "iterations",
    "rounds",
    "ms a frame",
    "95 %",
    "off mm, median",
    "95 %",
    "most",
    "in the body mm",
    "pairs with the body",
    "most",
    "with itself",
    "of the body itself",
)


def rows(dressed: Worn, path: BodyPath) -> Iterator[tuple[str, ...]]:
    """Yield a row for `follow`, then one of each budget.

    Args:
        dressed: What moves.
        path: Of its avatar.
    """
    bodies = [np.array(path.at(path.time(frame))) for frame in range(path.frames)]
    began = time.process_time()
    truth, found = follow(dressed.garment, path, dressed.fabric)
    took = [(time.process_time() - began) / (path.frames - 1)]
    yield ("follow", "", *_figures(truth.frames, truth.frames, bodies, dressed, took, 1e-3 * found["penetration_mm"]))
    for iterations, rounds in _BUDGETS:
        config = {"iterations": iterations, "contact_rounds": rounds}
        LiveCloth(dressed.garment, dressed.avatar.mesh, dressed.fabric, config).advance(bodies[0], path.frame_time)
        cloth = LiveCloth(dressed.garment, dressed.avatar.mesh, dressed.fabric, config)
        frames, took = [cloth.positions], []
        for body in bodies[1:]:
            began = time.process_time()
            cloth.advance(body, path.frame_time)
            took.append(time.process_time() - began)
            frames.append(cloth.positions)
        figures = _figures(np.array(frames), truth.frames, bodies, dressed, took, cloth.deepest)
        yield (str(iterations), str(rounds), *figures)


def _figures(
    frames: FloatArray,
    truth: FloatArray,
    bodies: Sequence[FloatArray],
    dressed: Worn,
    took: Sequence[float],
    deepest: float,
) -> tuple[str, ...]:
    off = 1e3 * np.linalg.norm(frames[1:] - truth[1:], axis=2)
    pairs = []
    for frame in np.unique(np.linspace(1, len(frames) - 1, _LOOKED_AT).astype(int)):
        cloth = TriangleMesh(frames[frame], dressed.garment.mesh.faces)
        body = TriangleMesh(bodies[frame], dressed.avatar.faces)
        pairs.append((len(crossings_between(cloth, body)), len(self_crossings(cloth)), len(self_intersections(body))))
    with_body, with_itself, of_body = np.array(pairs).T
    return (
        f"{1e3 * np.median(took):.0f}",
        f"{1e3 * np.quantile(took, 0.95):.0f}",
        f"{np.median(off):.1f}",
        f"{np.quantile(off, 0.95):.1f}",
        f"{off.max():.0f}",
        f"{1e3 * deepest:.1f}",
        f"{np.median(with_body):.0f}",
        str(with_body.max()),
        str(with_itself.max()),
        str(of_body.max()),
    )


def main() -> int:
    """Read the command line and print the table."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.motion.live", description=__doc__)
    parser.add_argument("run", type=Path, metavar="RUN", help="of `vto drape` on an avatar")
    parser.add_argument("motion", metavar="MOTION", help="a motion file, or the name of a preset")
    parser.add_argument("--frames", type=int, default=60, help="to look at, 30 a second")
    parser.add_argument("--vertices", type=int, default=1500, help="of the cloth, about")
    arguments = parser.parse_args()
    dressed, read = worn(open_run(arguments.run), arguments.vertices), read_motion(arguments.motion)
    config = RetargetConfig(frames_per_second=30.0, lead_in_s=0.7)
    motion, _ = retarget(read.clip, read.joints, dressed.avatar, config)
    whole = avatar_path(dressed.avatar, motion)
    path = BodyPath(whole.at, whole.faces, min(arguments.frames, whole.frames), whole.frame_time)
    return print_table(_HEADS, rows(dressed, path))


if __name__ == "__main__":
    sys.exit(main())
