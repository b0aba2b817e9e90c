"""`python -m vto_pipeline.bench.motion.garments` carries garments through motions, each by `vto drape --motion`.

Each run is a process of its own, so that one that fails costs no other; its row is written as soon as it ends.
Crossings are counted by our own audit, and by ipctk at every frame.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from vto_pipeline.avatar.template.template import template
from vto_pipeline.bench.bench import Value
from vto_pipeline.bench.live_rows import LiveRows
from vto_pipeline.bench.motion.ipc_frames import crossing_frames
from vto_pipeline.bench.own_process import run_vto
from vto_pipeline.io.bodies.avatars import read_avatar, write_avatar
from vto_pipeline.io.documents import read_json
from vto_pipeline.io.motion.archive import read_avatar_motion
from vto_pipeline.io.runs.frame_log import read_cloth_motion

_COLUMNS = (
    "garment",
    "fabric",
    "motion",
    "vertices",
    "outcome",
    "frames",
    "crossing_body",
    "most_pairs",
    "crossing_itself",
    "ipc_crossing",
    "ipc_crossing_posed",
    "body_in_itself",
    "yields_mm",
    "inside_mm",
    "edge_stretch",
    "thread_stretch",
    "thread_stretch_p99",
    "shear_deg",
    "warp_beyond",
    "weft_beyond",
    "shear_beyond",
    "s_per_frame",
    "cpu_s_per_frame",
    "cpu_s_most",
)


def main() -> None:
    """Read the command line, run, and print a row each."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.motion.garments", description=__doc__)
    parser.add_argument("--garment", type=Path, nargs="+", required=True, help="mesh or pattern files")
    parser.add_argument("--motion", nargs="+", required=True, help="motion files, or names of presets")
    parser.add_argument("--body", type=Path, metavar="AVATAR", help="avatar.npz; by default the mean body")
    parser.add_argument("--fabric", default="cotton_poplin", help="what they are made of, as `vto drape` takes it")
    parser.add_argument("--limit", type=float, default=3600.0, metavar="SECONDS", help="of a run")
    parser.add_argument("--set", dest="settings", nargs="*", default=[], metavar="STAGE.KEY=VALUE", help="of the runs")
    parser.add_argument("--out", type=Path, default=Path("runs/garment_motion"), metavar="DIR", help="for the runs")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    body = arguments.body or arguments.out / "mean_body.npz"
    if arguments.body is None:
        write_avatar(body, template())
    table = LiveRows(arguments.out, _COLUMNS)
    for garment in arguments.garment:
        for motion in arguments.motion:
            made_of = arguments.fabric
            table.add(motion_row(garment, motion, body, made_of, arguments.out, arguments.settings, arguments.limit))


def motion_row(
    garment: Path, motion: str, body: Path, fabric: str, out: Path, settings: Sequence[str], limit: float
) -> dict[str, Value]:
    """Return what became of one run; figures that it did not reach are None.

    Args:
        garment: Mesh or pattern file.
        motion: File, or name of a preset.
        body: Avatar.
        fabric: Name of a preset, or file.
        out: For the run.
        settings: As `--set` takes them.
        limit: Wall time after which the run is ended, with all that it has started [s].
    """
    folder = out / garment.stem  # one for all motions, so that it is draped once
    command = ["drape", "--garment", str(garment), "--body", str(body), "--fabric", fabric]
    command += ["--motion", motion, "-o", str(folder)]
    for one in settings:
        command += ["--set", one]
    ended = run_vto(command, out / f"{garment.stem}_{Path(motion).stem}.log", limit)
    own = ended.outcome in ("done", "failed")  # else its files are of the run before
    reached = run_figures(folder, body) if own else {}
    row: dict[str, Value] = {"garment": garment.stem, "fabric": Path(fabric).stem, "motion": Path(motion).stem}
    return row | {"outcome": ended.outcome, **reached}


def run_figures(folder: Path, body: Path) -> dict[str, Value]:
    """Return the figures of a run's files, as far as it has got."""
    for made in (folder / "out", folder / "out" / "partial"):
        if (made / "motion_audit.json").exists():
            found = read_json(made / "motion_audit.json")
            cloth = read_cloth_motion(made / "draped_motion.npz")
            by_ipc = crossing_frames(cloth, read_avatar(body), read_avatar_motion(folder / "out" / "motion.npz"))
            return {
                "vertices": cloth.frames.shape[1],
                "frames": found["frames"],
                "crossing_body": found["frames_crossing_body"],
                "most_pairs": found["most_body_crossings"],
                "crossing_itself": found["frames_crossing_itself"],
                "ipc_crossing": by_ipc[0],
                "ipc_crossing_posed": by_ipc[1],
                "body_in_itself": found["frames_body_crossing_itself"],
                "yields_mm": found["body_yields_mm"],
                "inside_mm": found["penetration_mm"],
                "edge_stretch": found["max_stretch"],
                "thread_stretch": found["max_thread_stretch"],
                "thread_stretch_p99": found["p99_thread_stretch"],
                "shear_deg": found["max_shear_deg"],
                **{f"{name}_beyond": share for name, share in found["beyond_limits"].items()},
                "s_per_frame": found["seconds_per_frame"],
                "cpu_s_per_frame": found["cpu_seconds_per_frame"],
                "cpu_s_most": found["most_cpu_seconds"],
            }
    return {}


if __name__ == "__main__":
    main()
