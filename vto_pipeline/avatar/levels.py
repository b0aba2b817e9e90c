"""Where a standing body itself shows a measuring level: narrowest waist, most forward bust, most rearward seat.

A registration matches surfaces, and a smooth surface does not tell at which height a row of the template comes to lie.
So the levels that ISO 8559-1 defines by the body's shape are looked for on the registered body, and the template's rows
are moved there; the rows between follow smoothly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.signal import find_peaks
from scipy.spatial import ConvexHull

from vto_pipeline.avatar.shape import ShapeSpace
from vto_pipeline.avatar.stance import ARM
from vto_pipeline.avatar.template import membership
from vto_pipeline.geometry.topology import edges
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.mesh import TriangleMesh

_STEP_M, _BEYOND_M, _BESIDE = 0.004, 0.028, 7
_STAY = ("thigh", "neck_base", "head")
_STEEPEST = 0.6
"""Rows may be pushed together to 1 - 0.6 of their distance, not nearer."""


@dataclass(frozen=True)
class Level:
    """How one level is found.

    Args:
        row: The template's row that belongs there.
        extreme: "narrowest", "foremost" or "rearmost": smallest hull girth, or the farthest point forwards, backwards.
        reach: How far from the registered row it may lie: people of one stature differ by this [m].
        prominence: By how much it must stand out, so that noise on a flat chest is no bust [m].
    """

    row: str
    extreme: str
    reach: float
    prominence: float


LEVELS = (
    Level("hip", "rearmost", 0.050, 0.002),
    Level("waist", "narrowest", 0.045, 0.004),
    Level("chest", "foremost", 0.040, 0.002),
    Level("neck", "narrowest", 0.025, 0.004),
)
"""Lowest first. Where a body has no such extreme within reach, as a belly without a waist, the row stays.

The reach is about two standard deviations of the level's height among people of one stature and weight (ANSUR II).
"""


def find_levels(upright: FloatArray, body: Avatar) -> dict[str, float]:
    """Return row -> height [m] of the levels that this body shows.

    Args:
        upright: A standing body of our topology, +Y up, facing +Z [m], shape (V, 3).
        body: Its topology and rows.
    """
    trunk = membership("arm") < 0.5
    links = edges(TriangleMesh(upright, body.faces))
    links = links[trunk[links].all(axis=1)].astype(np.int64)
    found = {}
    for level in LEVELS:
        span = level.reach + _BEYOND_M
        at = _height(upright, body, level.row) + np.arange(-span, span + _STEP_M / 2, _STEP_M)
        value = np.array([_value(_cut(upright, links, y), level.extreme) for y in at])
        peak = _peak(at, value, level.reach, level.prominence)
        if peak is not None:
            found[level.row] = peak
    return found


def with_rows_at(space: ShapeSpace, parameters: FloatArray, upright: FloatArray, found: dict[str, float]) -> ShapeSpace:
    """Return the shape space with its base slid along itself, so that rows come to lie at their levels.

    Args:
        space: Of the body.
        parameters: Of the body in that space, shape (P,).
        upright: The body as it stands in the scan [m], shape (V, 3).
        found: Row -> height it shall have there [m].
    """
    base, bind, joints = space.base, space.vertices(parameters), space.joints(parameters)
    rows = sorted([*_STAY, *found], key=lambda row: _height(bind, base, row))
    at = np.array([_height(bind, base, row) for row in rows])
    rise = np.array([found[row] - _height(upright, base, row) if row in found else 0.0 for row in rows])
    steepest = float(np.abs(np.diff(rise) / np.diff(at)).max())
    smooth = PchipInterpolator(at, rise * min(1.0, _STEEPEST / max(steepest, 1e-12)))

    def risen(points: FloatArray, arm: FloatArray) -> FloatArray:
        """An arm goes with its shoulder."""
        shoulder = joints[base.joint_names.index("left_shoulder"), 1]
        height = (1 - arm) * points[:, 1] + arm * shoulder
        moved: FloatArray = points + np.outer(smooth(np.clip(height, at[0], at[-1])), [0.0, 1.0, 0.0])
        return moved

    arm_joints = np.array([name.rpartition("_")[2] in ARM for name in base.joint_names], dtype=float)
    slid = replace(
        base,
        bind_vertices=base.bind_vertices + risen(bind, membership("arm")) - bind,
        joints=base.joints + risen(joints, arm_joints) - joints,
    )
    return replace(space, base=slid)


def _height(vertices: FloatArray, body: Avatar, row: str) -> float:
    rows = [body.loops[name] for name in (row, f"left_{row}", f"right_{row}") if name in body.loops]
    return float(np.mean([vertices[loop, 1].mean() for loop in rows]))


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
    if extreme == "narrowest":
        return -float(ConvexHull(points[:, [0, 2]]).area)
    return float(points[:, 2].max() if extreme == "foremost" else -points[:, 2].min())


def _peak(at: FloatArray, value: FloatArray, reach: float, prominence: float) -> float | None:
    """Return where the highest prominent maximum lies, at most so far from the middle; None when there is none."""
    inner = find_peaks(value, prominence=prominence)[0]
    inner = inner[np.abs(at[inner] - at.mean()) <= reach]
    if len(inner) == 0:
        return None
    k = int(inner[np.argmax(value[inner])])
    near = slice(max(k - _BESIDE, 0), k + _BESIDE + 1)
    # the top of a parabola through the neighbourhood: one facet's corner does not decide
    bend, slope, _ = np.polyfit(at[near] - at[k], value[near], 2)
    step = (at[1] - at[0]) * _BESIDE
    return float(at[k] + (np.clip(-slope / (2 * bend), -step, step) if bend < 0 else 0.0))
