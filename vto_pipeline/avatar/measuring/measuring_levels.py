"""Measuring levels found on a standing body: narrowest waist, foremost bust, rearmost seat.

A registration matches surfaces, and a smooth surface does not tell at which height a row of the template comes to lie.
So the levels that ISO 8559-1 defines by the body's shape are looked for on the registered body, and the template's rows
are moved there; the rows between follow smoothly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import ConvexHull

from vto_pipeline.avatar.model.shape import ShapeSpace
from vto_pipeline.avatar.template.template import ARM, JOINT_KINDS, membership
from vto_pipeline.geometry.topology import edges
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.mesh import TriangleMesh

_STEP_M, _BEYOND = 0.002, 2.5
"""Between the heights that are looked at, and how many widths beyond the reach: what lies there is smoothed in."""
_KNOWN_M, _KNOWN_ROUND_M = 0.001, 0.003
"""How well a registered surface is known: a point of it, and its girth; as the bench's scans have it."""
_STAY = ("neck_base", "head")
_THIGH_OF_CROTCH = 0.95
"""Height of the fold of the seat as a share of the crotch's, as `population` has it."""
_LEG = 0.2
_NEAR_CROTCH_M, _ON_THE_MEDIAN_M = 0.03, 1e-6
_STEEPEST = 0.6
"""Rows may be pushed together to 1 - 0.6 of their distance, not nearer."""


@dataclass(frozen=True)
class MeasuringLevel:
    """How one level is found.

    Args:
        row: The template's row that belongs there.
        extreme: "narrowest", "widest", "foremost" or "rearmost": of the hull's girth, or the farthest point forwards,
            backwards.
        reach: How far from the registered row it may lie: people of one stature differ by this [m].
        width: Over which the profile is smoothed, its standard deviation [m]: an extreme of the smoothed profile stays
            where it is when facets, noise or the model's vertices change.
        prominence: By how much it must stand out, so that noise on a flat chest is no bust [m].
        above: How far the row lies above the extreme, as a share of its height.
    """

    row: str
    extreme: str
    reach: float
    width: float
    prominence: float
    above: float = 0.0

    @property
    def of_girth(self) -> bool:
        """Whether the extreme is one of the hull's girth."""
        return self.extreme in ("narrowest", "widest")


LEVELS = (
    MeasuringLevel("ankle", "narrowest", 0.040, 0.006, 0.004),
    MeasuringLevel("calf", "widest", 0.050, 0.020, 0.004),
    MeasuringLevel("knee", "narrowest", 0.050, 0.012, 0.002, above=0.11),
    MeasuringLevel("hip", "rearmost", 0.050, 0.020, 0.002),
    MeasuringLevel("waist", "narrowest", 0.045, 0.015, 0.004),
    MeasuringLevel("chest", "foremost", 0.040, 0.010, 0.002),
    MeasuringLevel("neck", "narrowest", 0.025, 0.008, 0.004, above=-0.006),
)
"""Lowest first. Where a body has no such extreme within reach, as a belly without a waist, the row stays.

The reach is about two standard deviations of the level's height among people of one stature and weight (ANSUR II). The
middle of the patella shows in no girth; the leg is narrowest under it, at the hollow of the knee, as far as
on the template. A horizontal cut of the neck is narrowest where the chin begins to count; the tape lies below that,
as far as on the template.
"""


def find_levels(upright: FloatArray, body: Avatar) -> dict[str, float]:
    """Return row -> height [m] of the levels that this body shows; a limb's is the mean of both sides.

    Args:
        upright: A standing body of our topology, +Y up, facing +Z [m], shape (V, 3).
        body: Its topology and rows.
    """
    floor = float(upright[:, 1].min())
    # what the thighs' fold shows of itself is little, but it lies as far below the crotch as on others
    found = {"thigh": floor + _THIGH_OF_CROTCH * (float(upright[_under_the_crotch(body), 1].min()) - floor)}
    for level in LEVELS:
        sides = [_found(level, upright, body, row, floor) for row in _sides(body, level.row)]
        seen = [height for height in sides if height is not None]
        if seen:
            found[level.row] = float(np.mean(seen))
    if "chest" in found:  # the fold under the breasts goes with them, not with the waist
        found["underbust"] = _height(upright, body, "underbust") + found["chest"] - _height(upright, body, "chest")
    return found


def level_spread(upright: FloatArray, body: Avatar) -> dict[str, float]:
    """Return row -> how surely its level is known where the body shows it [m]; a limb's is the mean of both sides.

    Half the stretch over which the profile stays at its extreme but for what the surface is not known by: a tape does
    not tell such levels apart. Where the body shows none, there is no row.
    """
    floor, spread = float(upright[:, 1].min()), {}
    for level in LEVELS:
        widths = []
        for row in _sides(body, level.row):
            at, value = _profile(level, upright, body, row, floor)
            peak = _peak(at, value, level)
            if peak is not None:
                smooth = gaussian_filter1d(value, level.width / _STEP_M, mode="nearest")
                top = int(np.argmin(np.abs(at - peak)))
                near = np.abs(at - at.mean()) <= level.reach
                flat = near & (smooth > smooth[top] - (_KNOWN_ROUND_M if level.of_girth else _KNOWN_M))
                low, high = top - np.argmin(flat[: top + 1][::-1]) + 1, top + np.argmin(flat[top:]) - 1
                widths.append(0.5 * (1 + level.above) * float(at[high] - at[low]))
        if widths:
            spread[level.row] = float(np.mean(widths))
    return spread


def _found(level: MeasuringLevel, upright: FloatArray, body: Avatar, row: str, floor: float) -> float | None:
    at, value = _profile(level, upright, body, row, floor)
    peak = _peak(at, value, level)
    return None if peak is None else floor + (1 + level.above) * (peak - floor)


def _profile(
    level: MeasuringLevel, upright: FloatArray, body: Avatar, row: str, floor: float
) -> tuple[FloatArray, FloatArray]:
    """Return the heights about a row and what is largest at the level there."""
    links = _links(body, row)
    middle = floor + (float(upright[body.loops[row], 1].mean()) - floor) / (1 + level.above)
    span = level.reach + _BEYOND * level.width
    at = middle + np.arange(-span, span + _STEP_M / 2, _STEP_M)
    # a small child's ankle is nearer to the floor than the span: beyond its end a part goes on as it ends
    ends = upright[links, 1]
    inside = np.clip(at, ends.min() + _STEP_M, ends.max() - _STEP_M)
    return at, np.array([_value(_cut(upright, links, y), level.extreme) for y in inside])


def with_rows_at_levels(
    space: ShapeSpace, parameters: FloatArray, upright: FloatArray, found: dict[str, float]
) -> ShapeSpace:
    """Return the shape space with its base slid along itself, so that rows come to lie at their levels.

    Args:
        space: Of the body.
        parameters: Of the body in that space, shape (P,).
        upright: The body as it stands in the scan [m], shape (V, 3).
        found: Row -> height it shall have there [m].
    """
    base, bind, joints = space.base, space.vertices(parameters), space.joints(parameters)
    rows = sorted([*_STAY, *found], key=lambda row: _height(bind, base, row))
    # the soles stay on the floor
    at = np.array([bind[:, 1].min(), *(_height(bind, base, row) for row in rows)])
    rise = np.array([0.0, *(found[row] - _height(upright, base, row) if row in found else 0.0 for row in rows)])
    steepest = float(np.abs(np.diff(rise) / np.diff(at)).max())
    smooth = PchipInterpolator(at, rise * min(1.0, _STEEPEST / max(steepest, 1e-12)))

    def risen(points: FloatArray, arm: FloatArray) -> FloatArray:
        """An arm goes with its shoulder."""
        shoulder = joints[base.joint_names.index("left_shoulder"), 1]
        height = (1 - arm) * points[:, 1] + arm * shoulder
        moved: FloatArray = points + np.outer(smooth(np.clip(height, at[0], at[-1])), [0.0, 1.0, 0.0])
        return moved

    arm_joints = np.isin(JOINT_KINDS, ARM).astype(float)
    slid = replace(
        base,
        bind_vertices=base.bind_vertices + risen(bind, membership("arm")) - bind,
        joints=base.joints + risen(joints, arm_joints) - joints,
    )
    return replace(space, base=slid)


def _sides(body: Avatar, row: str) -> list[str]:
    return [name for name in (row, f"left_{row}", f"right_{row}") if name in body.loops]


def _height(vertices: FloatArray, body: Avatar, row: str) -> float:
    return float(np.mean([vertices[body.loops[name], 1].mean() for name in _sides(body, row)]))


def _links(body: Avatar, row: str) -> IntArray:
    """Edges of the part that a row goes round: trunk, or one leg."""
    side = row.partition("_")[0]
    inside = membership("arm") < 0.5
    if side in ("left", "right"):
        inside = (membership("leg") > _LEG) & (
            body.bind_vertices[body.loops[row], 0].mean() * body.bind_vertices[:, 0] >= 0
        )
    links = edges(TriangleMesh(body.bind_vertices, body.faces))
    return links[inside[links].all(axis=1)].astype(np.int32)


def _under_the_crotch(body: Avatar) -> NDArray[np.int64]:
    """Vertices of the median plane between the legs."""
    low = body.bind_vertices[body.landmarks["crotch_point"], 1] + _NEAR_CROTCH_M
    return np.flatnonzero((np.abs(body.bind_vertices[:, 0]) < _ON_THE_MEDIAN_M) & (body.bind_vertices[:, 1] < low))


def _cut(vertices: FloatArray, links: IntArray, y: float) -> FloatArray:
    """Points where a horizontal plane cuts the edges, shape (N, 3)."""
    start, end = vertices[links[:, 0]], vertices[links[:, 1]]
    crossed = (start[:, 1] < y) != (end[:, 1] < y)
    start, end = start[crossed], end[crossed]
    share = (y - start[:, 1]) / (end[:, 1] - start[:, 1])
    points: FloatArray = start + share[:, None] * (end - start)
    return points


def _value(points: FloatArray, extreme: str) -> float:
    """What is largest at the level."""
    if extreme in ("narrowest", "widest"):
        return float(ConvexHull(points[:, [0, 2]]).area) * (1.0 if extreme == "widest" else -1.0)
    return float(points[:, 2].max() if extreme == "foremost" else -points[:, 2].min())


def _peak(at: FloatArray, value: FloatArray, level: MeasuringLevel) -> float | None:
    """Return where the highest prominent maximum of the smoothed profile lies, within reach; None if there is none."""
    from scipy.signal import find_peaks

    smooth = gaussian_filter1d(value, level.width / _STEP_M, mode="nearest")
    inner = find_peaks(smooth, prominence=level.prominence)[0]
    inner = inner[np.abs(at[inner] - at.mean()) <= level.reach]
    if len(inner) == 0:
        return None
    k = int(inner[np.argmax(smooth[inner])])
    before, top, after = smooth[k - 1 : k + 2]
    return float(at[k] + 0.5 * _STEP_M * (before - after) / (before - 2 * top + after))
