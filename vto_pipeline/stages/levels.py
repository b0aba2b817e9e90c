"""What a stage takes, and at which levels a run with a time budget may run it: as measured on the sample shirt.

Times are shares of CPU time, errors multiples of the 95th percentile of the garment's distance to the truth, each level
alone against all defaults (`python -m vto_pipeline.bench.scan.levels` measures them again). Errors of a drape that has
to stop, and of a coarser mesh, are set by their distance from the drape by default, beside what two scans differ by.
One that stops counts more than its 0.2 mm left: it comes last, and what others take too long is taken from it. Stopped
much earlier it is no drape: its first steps take as long as all others.
What shows in neither, as texture, has a small one, so that it is given up first. Those of `align` and
`register_mannequin` are judged, not measured. The usual times are to each other as those of
docs/results, which may be of a slower machine, with both threads of a quiet one.
"""

from __future__ import annotations

from dataclasses import replace

from vto_pipeline.pipeline.levels import Level, UsualTime
from vto_pipeline.pipeline.stage import Stage

_FEW = {"max_side_px": 1200, "max_features": 1024}
"""Never fewer pairs: matched with the nearest four only, 16 photos of a scene were placed 0.9 m off, silently."""

LEVELS: dict[str, tuple[Level, ...]] = {
    "sfm": (
        Level({"features": _FEW}, {"sfm": 0.55}, 1.02),
        Level({"features": _FEW, "refined": False}, {"sfm": 0.4}, 1.05),
    ),
    "stereo": (
        Level(
            {"max_side_px": 600, "rematch": {"rounds": 1}},
            {"stereo": 0.52, "fuse_photos": 0.65, "subtract": 0.63, "openings": 1.3, "texture": 0.9},
            1.4,
        ),
        Level(
            {"max_side_px": 450, "rematch": {"rounds": 1}},
            {"stereo": 0.31, "fuse_photos": 0.38, "subtract": 0.31, "openings": 1.3, "texture": 0.8},
            2.2,
        ),
    ),
    "align": (Level({"samples": 3000, "candidates": 3}, {"align": 0.6}, 1.02),),
    "openings": (Level({"look_again": False, "edge_mm": 6.0}, {"openings": 0.7}, 1.03),),
    "register_mannequin": (Level({"iterations": 8, "rounds": 1, "probes": 4000}, {"register_mannequin": 0.5}, 1.05),),
    "texture": (Level({"max_side_px": 1024, "max_triangles": 8000}, {"texture": 0.45}, 1.02),),
    "simulation_mesh": (
        Level({"edge_mm": 15.0}, {"simulation_mesh": 0.9, "drape": 0.65}, 1.5),
        Level({"edge_mm": 20.0}, {"simulation_mesh": 0.85, "drape": 0.35}, 1.6),
    ),
    "drape": (Level({}, {"drape": 0.75}, 1.2),),
}
"""Section -> its levels besides the default."""

USUAL: dict[str, UsualTime] = {
    "sfm": UsualTime(0.0, 0.19, "photos", 1.5),
    "scale": UsualTime(1.6),
    "stereo": UsualTime(0.0, 1.0, "photos"),
    "fuse_photos": UsualTime(4.5),
    "odometry": UsualTime(0.0, 0.25, "depth"),
    "fuse_depth": UsualTime(4.5),
    "poisson": UsualTime(4.5),
    "align": UsualTime(4.0),
    "subtract": UsualTime(4.0),
    "openings": UsualTime(3.0, 0.42, "photos"),
    "texture": UsualTime(10.0),
    "simulation_mesh": UsualTime(4.7),
    "register_mannequin": UsualTime(11.0),
    "register_body": UsualTime(11.0),
    "stand_source": UsualTime(1.0),
    "fit_scan": UsualTime(18.0),
    "fit_silhouettes": UsualTime(9.7),
    "drape": UsualTime(17.0),
    "transfer": UsualTime(0.6),
    "assess": UsualTime(0.5),
    "page": UsualTime(1.5),
}
"""Section -> what its stages take by default."""


def with_levels(stage: Stage) -> Stage:
    """Return the row of the table with what is known of its time."""
    return replace(stage, levels=LEVELS.get(stage.section, ()), usual=USUAL.get(stage.section))
