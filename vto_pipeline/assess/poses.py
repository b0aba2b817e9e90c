"""The fit in other poses: where cloth gets tight, and how far it slides, beside how it was while standing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.assess.strain import principal_stretches
from vto_pipeline.assess.surface import face_areas
from vto_pipeline.geometry.closest import barycentric
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_loops
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

TIGHTER = 0.01
"""Of stretch beyond that while standing: less is no change that anyone feels."""
_LEAST = 0.02  # of the garment's area: less of it over a part of the body is no zone
_SLIDES = 0.01  # m: an opening that slides by less stays where it is


def stretch_by_part(
    draped: TriangleMesh, rest: FloatArray, body: TriangleMesh, parts: NDArray[np.str_], limit: float
) -> dict[str, dict[str, float]]:
    """Return the stretch of the cloth over each part of the body.

    Args:
        draped: The garment on the body [m].
        rest: Its rest positions [m], shape (V, 3).
        body: What it is on [m].
        parts: Name of the part that each vertex of the body belongs to, shape (B,).
        limit: Stretch beyond rest that counts as too much, such as 0.05.

    Returns:
        Part -> area_share of the garment; p95 of the largest principal stretch beyond rest, over area, and
        share_over_limit of the part's area. Parts under less than a fiftieth of the garment are left out.
    """
    areas = face_areas(rest, draped.faces)
    strain = principal_stretches(draped.vertices, rest, draped.faces)[:, 0] - 1.0
    below = SurfaceDistance(body).nearest(draped.vertices[draped.faces].mean(axis=1)).face
    over = parts[body.faces[below, 0]]
    found = {}
    for part in np.unique(over):
        own = over == part
        area = float(areas[own].sum())
        if area < _LEAST * areas.sum():
            continue
        p95 = np.quantile(strain[own], 0.95, weights=areas[own], method="inverted_cdf")
        found[str(part)] = {
            "area_share": area / float(areas.sum()),
            "p95": float(p95),
            "share_over_limit": float(areas[own][strain[own] > limit].sum() / area),
        }
    return found


def openings_slide(
    before: TriangleMesh, body_before: TriangleMesh, after: TriangleMesh, body_after: TriangleMesh
) -> list[dict[str, Any]]:
    """Return how far each opening has slid along the body.

    A vertex slides by the way from the place on the body that was nearest to it, where that is now, to the place that
    is nearest to it now.

    Args:
        before, after: The garment [m].
        body_before, body_after: What it is on [m], of the same triangles.

    Returns:
        Of each opening, highest first: height_m, its mean height before, and slides_m, the mean over its vertices.
    """
    found, faces = [], body_before.faces
    surface_before, surface_after = SurfaceDistance(body_before), SurfaceDistance(body_after)
    for loop in boundary_loops(before):
        place = surface_before.nearest(before.vertices[loop])
        weights = barycentric(place.point, body_before.vertices[faces[place.face]])
        carried = np.einsum("nk,nkd->nd", weights, body_after.vertices[faces[place.face]])
        now = surface_after.nearest(after.vertices[loop]).point
        slides = np.linalg.norm(now - carried, axis=1)
        found.append({"height_m": float(before.vertices[loop, 1].mean()), "slides_m": float(slides.mean())})
    return sorted(found, key=lambda one: -one["height_m"])


def verdict(
    pose: str,
    standing: Mapping[str, Mapping[str, float]],
    posed: Mapping[str, Mapping[str, float]],
    slides: Sequence[Mapping[str, float]],
    limit: float,
) -> str:
    """Say in a sentence where the garment is tight in a pose, and what slides.

    Args:
        pose: Its name, such as "arms_up".
        standing, posed: Of `stretch_by_part`, at rest before the pose and in it.
        slides: Of `openings_slide`.
        limit: Stretch beyond rest that counts as too much.
    """
    tight = {
        part: (found["p95"], standing.get(part, {}).get("p95", 0.0))
        for part, found in posed.items()
        if found["p95"] > limit
    }
    new = {part: both for part, both in tight.items() if both[0] > both[1] + TIGHTER}
    parts = [
        f"tight at the {part} (stretched by {now:.0%}, {was:.0%} before)"
        for part, (now, was) in sorted(new.items(), key=lambda item: -item[1][0])
    ]
    if tight and not new:
        parts.append("no tighter than before")
    if not tight:
        parts.append("comfortable")
    farthest = max(slides, key=lambda one: one["slides_m"], default=None)
    if farthest is not None and farthest["slides_m"] > _SLIDES:
        where = "an opening"
        if len(slides) > 1:
            where = "the top" if farthest is slides[0] else "the bottom" if farthest is slides[-1] else "an opening"
        parts.append(f"{where} slides by {100 * farthest['slides_m']:.0f} cm")
    return f"{pose.replace('_', ' ')}: {'; '.join(parts)}"
