"""The fit over a motion: where cloth gets tight, and when."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.assess.poses import TIGHTER, stretch_by_part
from vto_pipeline.assess.strain import principal_stretches
from vto_pipeline.assess.surface import face_areas, to_vertices
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.motion import ClothMotion


def assess_motion(
    cloth: ClothMotion,
    rest: FloatArray,
    bodies: Iterable[TriangleMesh],
    parts: NDArray[np.str_],
    limit: float,
    job: Job,
) -> tuple[dict[str, Any], dict[str, FloatArray]]:
    """Return the fit in each frame, and the most that the cloth is stretched at each place.

    Args:
        cloth: Its frames.
        rest: Its rest positions [m], shape (V, 3).
        bodies: What it is on, in each frame [m].
        parts: Name of the part that each vertex of the body belongs to, shape (B,).
        limit: Stretch beyond rest that counts as too much, such as 0.05.
        job: For progress.

    Returns:
        The report (plain JSON values): of each part the stretch at the begin, the most and when [s]; of each frame its
        time [s] and the stretch by part; a verdict in words. And per vertex "stretch" (largest principal stretch of
        all frames, 1 at rest) and "at_s" (when), each of shape (V,).
    """
    areas = face_areas(rest, cloth.faces)
    most, when = np.zeros(len(rest)), np.zeros(len(rest))
    frames: list[dict[str, Any]] = []
    for number, body in enumerate(bodies):
        job.progress(number / len(cloth.frames), "stretch")
        there, time = TriangleMesh(cloth.frames[number], cloth.faces), float(cloth.times[number])
        stretch = principal_stretches(there.vertices, rest, cloth.faces)[:, 0]
        here = to_vertices(stretch, areas, cloth.faces, len(rest))
        most, when = np.maximum(most, here), np.where(here > most, time, when)
        frames.append({"time_s": time, "parts": stretch_by_part(there, rest, body, parts, limit)})
    found = peaks(frames)
    report = {"schema": 1, "stretch_limit": limit, "parts": found, "frames": frames, "verdict": verdict(found, limit)}
    return report, {"stretch": most, "at_s": when}


def peaks(frames: list[dict[str, Any]]) -> dict[str, dict[str, float]]:
    """Return for each part of the body its stretch in the first frame, the most in any, and when that is [s]."""
    found: dict[str, dict[str, float]] = {}
    for frame in frames:
        for part, one in frame["parts"].items():
            begin = frames[0]["parts"].get(part, {}).get("p95", 0.0)
            known = found.setdefault(part, {"begin": begin, "most": -np.inf, "at_s": 0.0})
            if one["p95"] > known["most"]:
                known |= {"most": one["p95"], "at_s": frame["time_s"]}
    return found


def verdict(found: Mapping[str, Mapping[str, float]], limit: float) -> str:
    """Say in a sentence where the garment gets tight in a motion, and when.

    Args:
        found: Of `peaks`.
        limit: Stretch beyond rest that counts as too much.
    """
    tight = {part: one for part, one in found.items() if one["most"] > limit}
    new = {part: one for part, one in tight.items() if one["most"] > one["begin"] + TIGHTER}
    if not tight:
        return "in motion: comfortable"
    if not new:
        return "in motion: no tighter than at its begin"
    said = [
        f"tight at the {part} at {one['at_s']:.1f} s (stretched by {one['most']:.0%}, {one['begin']:.0%} at the begin)"
        for part, one in sorted(new.items(), key=lambda item: -item[1]["most"])
    ]
    return f"in motion: {'; '.join(said)}"
