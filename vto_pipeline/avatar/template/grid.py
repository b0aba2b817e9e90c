"""The template's connectivity: strips of quads along trunk, head, legs and arms, joined without a seam.

Only the left half (x >= 0) is laid out, then mirrored, so that the mesh is exactly symmetric. Rows run round the body
and stay at one level, which makes every measuring loop a row of vertices.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.avatar.template.body_plan import BodyPlan
from vto_pipeline.avatar.template.implicit import arm_axis
from vto_pipeline.model.arrays import FloatArray

HALF = 28
"""Quads from the front median line to the back median line."""
_HOLE_FIRST, _HOLE_LAST, _HOLE_ROWS = 10, 18, 6
_SHOULDER_ROWS = 16
_CROTCH_QUADS = 8
_FREE = (0.0, 0.0, 0.0)

Quads = list[tuple[int, int, int, int]]


@dataclass
class Grid:
    """Half a body of quads.

    Args:
        points: Start positions [m].
        planes: Normal of the plane in which a vertex has to stay, or zero where it may move freely.
        quads: Corner indices, either way round.
        on_mirror: Whether the vertex lies on x = 0.
        rows: Name -> vertices of the row: open half rows for trunk and head, closed for limbs.
    """

    points: list[FloatArray] = field(default_factory=list)
    planes: list[FloatArray] = field(default_factory=list)
    quads: Quads = field(default_factory=list)
    on_mirror: list[bool] = field(default_factory=list)
    rows: dict[str, NDArray[np.int64]] = field(default_factory=dict)

    def add(
        self, points: FloatArray, plane: tuple[float, ...] | FloatArray, mirror_ends: bool = False
    ) -> NDArray[np.int64]:
        """Add a row of vertices; return their indices. `mirror_ends`: the first and the last lie on x = 0."""
        first = len(self.points)
        for i, point in enumerate(points):
            end = mirror_ends and i in (0, len(points) - 1)
            self.points.append(np.array(point) * ((0.0, 1.0, 1.0) if end else (1.0, 1.0, 1.0)))
            self.planes.append(np.array(plane, dtype=float))
            self.on_mirror.append(end)
        return np.arange(first, len(self.points))

    def join(self, lower: NDArray[np.int64], upper: NDArray[np.int64], closed: bool) -> None:
        """Span quads between two rows of equal length."""
        count = len(lower) if closed else len(lower) - 1
        following = (np.arange(count) + 1) % len(lower)
        for i, j in enumerate(following):
            self.quads.append((int(lower[i]), int(lower[j]), int(upper[j]), int(upper[i])))

    def close(self, ring: NDArray[np.int64], sides: int) -> None:
        """Fill a closed ring with a patch of quads, `sides` wide; the ring's first vertex is a corner."""
        depth = len(ring) // 2 - sides
        patch = np.full((sides + 1, depth + 1), -1)
        patch[:, 0] = ring[: sides + 1]
        patch[-1, :] = ring[sides : sides + depth + 1]
        patch[::-1, -1] = ring[sides + depth : 2 * sides + depth + 1]
        patch[0, 1:-1] = ring[2 * sides + depth + 1 :][::-1]
        self._fill(patch, mirror_first=False)

    def close_half(self, row: NDArray[np.int64]) -> None:
        """Fill the top of a half row from front to back: half of the square patch that the whole ring would get."""
        wide, deep = HALF // 4, HALF // 2
        patch = np.full((wide + 1, deep + 1), -1)
        patch[:, 0] = row[: wide + 1]
        patch[-1, :] = row[wide : wide + deep + 1]
        patch[::-1, -1] = row[wide + deep :]
        self._fill(patch, mirror_first=True)

    def _fill(self, patch: NDArray[np.int64], mirror_first: bool) -> None:
        rows, columns = patch.shape
        border = np.array(self.points)
        middle = border[patch[patch >= 0]].mean(axis=0)
        for i in range(0 if mirror_first else 1, rows - 1):
            for j in range(1, columns - 1):
                across = border[patch[-1, j]] * (i / (rows - 1)) + (1 - i / (rows - 1)) * (
                    border[patch[-1, j]] * (0, 1, 1) if mirror_first else border[patch[0, j]]
                )
                t = j / (columns - 1)
                along = (1 - t) * border[patch[i, 0]] + t * border[patch[i, -1]]
                point = (across + along) / 2
                patch[i, j] = self.add((0.98 * point + 0.02 * middle)[None], _FREE)[0]
                if mirror_first and i == 0:
                    self.points[-1][0] = 0.0
                    self.on_mirror[-1] = True
        for i in range(rows - 1):
            self.join(patch[i], patch[i + 1], closed=False)


def lay_out(plan: BodyPlan) -> Grid:
    """Lay the half grid over a body, near its surface."""
    grid = Grid()
    angle = np.linspace(0.0, np.pi, HALF + 1)
    rows = _trunk(grid, plan, angle)
    _head(grid, plan, angle, rows[-1])
    _leg(grid, plan, rows[0])
    before = len(grid.points)
    _arm(grid, plan, rows)
    grid.rows["arm"] = np.arange(before, len(grid.points))
    return grid


def _levels(stops: list[tuple[str, float, int]]) -> list[tuple[str, float]]:
    """Spread rows between named stops (name, level, rows up to the next stop); the rows between have no name."""
    out: list[tuple[str, float]] = []
    for (name, start, count), (_, end, _) in pairwise(stops):
        out += [(name if k == 0 else "", start + (end - start) * k / count) for k in range(count)]
    return [*out, (stops[-1][0], stops[-1][1])]


def _at(sections: FloatArray, level: float) -> FloatArray:
    order = np.argsort(sections[:, 0])
    return np.array([np.interp(level, sections[order, 0], column[order]) for column in sections[:, 1:].T])


def _section(sections: FloatArray, height: float, angle: FloatArray) -> FloatArray:
    """Return points of a horizontal section at angles from the front over the left side, shape (N, 3)."""
    center, breadth, fore, aft, _ = _at(sections, height)
    across, depth = center + breadth * np.sin(angle), (fore + aft) / 2 + (fore - aft) / 2 * np.cos(angle)
    return np.column_stack([across, np.full(len(angle), height), depth])


def _trunk(grid: Grid, plan: BodyPlan, angle: FloatArray) -> list[NDArray[np.int64]]:
    level = plan.levels
    stops = [
        ("", level["crotch"] + 0.028, 1),
        ("hip", level["hip"], 5),
        ("high_hip", level["high_hip"], 3),
        ("navel", level["navel"], 3),
        ("waist", level["waist"], 5),
        ("underbust", level["underbust"], 4),
        ("chest", level["chest"], 3),
        ("axilla", level["axilla"], 0),
    ]
    rows = []
    for name, height in _levels(stops):
        points = _section(plan.trunk, height, angle)
        rows.append(grid.add(points, _FREE if height > level["chest"] else (0, 1, 0), mirror_ends=True))
        if name:
            grid.rows[name] = rows[-1]
    rows += _shoulders(grid, plan, angle, np.array(grid.points)[rows[-1]])
    first_hole_row = len(rows) - 1 - _SHOULDER_ROWS
    for k, (lower, upper) in enumerate(pairwise(rows)):
        if first_hole_row <= k < first_hole_row + _HOLE_ROWS:
            grid.join(lower[: _HOLE_FIRST + 1], upper[: _HOLE_FIRST + 1], closed=False)
            grid.join(lower[_HOLE_LAST:], upper[_HOLE_LAST:], closed=False)
        else:
            grid.join(lower, upper, closed=False)
    hip = next(k for k, row in enumerate(rows) if row[0] == grid.rows["hip"][0])
    grid.rows["front_column"] = np.array([row[0] for row in rows[hip:]])
    grid.rows["back_column"] = np.array([row[-1] for row in rows[hip:]])
    grid.rows["shoulder_column"] = np.array([row[HALF // 2] for row in rows[first_hole_row + _HOLE_ROWS + 1 :]])
    return rows


def _shoulders(grid: Grid, plan: BodyPlan, angle: FloatArray, below: FloatArray) -> list[NDArray[np.int64]]:
    """Rows over chest and shoulders up to the base of the neck, as a poncho lies."""
    tip, neck = plan.shoulder_point, plan.side_neck
    rows = []
    for k in range(1, _SHOULDER_ROWS + 1):
        t = k / _SHOULDER_ROWS
        if k <= _HOLE_ROWS:
            s = k / _HOLE_ROWS
            side = below[HALF // 2] * (1 - s) + tip * s
        else:
            s = (k - _HOLE_ROWS) / (_SHOULDER_ROWS - _HOLE_ROWS)
            side = tip * (1 - s) + neck * s
        front = below[0, 1:] * (1 - t) + plan.front_neck * t
        back = below[-1, 1:] * (1 - t) + plan.back_neck * t
        end = np.where((angle < np.pi / 2)[:, None], front, back)
        share = np.sin(angle)[:, None] ** 2
        height = side[1] * share[:, 0] + end[:, 0] * (1 - share[:, 0])
        depth = side[2] + (end[:, 1] - side[2]) * np.abs(np.cos(angle))
        inside = [i for i in range(HALF + 1) if not (_HOLE_FIRST < i < _HOLE_LAST and k < _HOLE_ROWS)]
        row = np.full(HALF + 1, -1)
        points = np.column_stack([side[0] * np.sin(angle), height, depth])
        row[inside] = grid.add(points[inside], _FREE, mirror_ends=True)
        rows.append(row)
    grid.rows["neck_base"] = rows[-1]
    return rows


def _head(grid: Grid, plan: BodyPlan, angle: FloatArray, below: NDArray[np.int64]) -> None:
    base = (plan.front_neck[0] + plan.back_neck[0] + plan.side_neck[1]) / 3
    top = plan.head[-2, 0]
    neck, head = plan.levels["neck"], plan.levels["head"]
    stops = [("", base, 3), ("neck", neck, 8), ("head", head, 4), ("", top, 0)]
    row = below
    for k, (name, height) in enumerate(_levels(stops)[1:]):
        points = _section(plan.head, height, angle)
        # below the neck row the rows still lean as the neck's base does
        above = grid.add(points, _FREE if k < 2 or height > head else (0, 1, 0), mirror_ends=True)
        grid.join(row, above, closed=False)
        row = above
        if name:
            grid.rows[name] = row
    grid.close_half(row)


def _leg(grid: Grid, plan: BodyPlan, above: NDArray[np.int64]) -> None:
    ends = np.array(grid.points)[above[[0, -1]]]
    share = np.linspace(0, 1, _CROTCH_QUADS + 1)[1:-1, None]
    path = ends[1] * (1 - share) + ends[0] * share
    path[:, 1] -= 0.028 * np.sin(np.pi * share[:, 0])
    crotch = grid.add(path, _FREE)
    for i in crotch:
        grid.points[i][0], grid.on_mirror[i] = 0.0, True
    grid.rows["crotch"], grid.rows["seam"] = crotch, above
    ring = np.concatenate([above, crotch])
    angle = np.concatenate([np.linspace(0, np.pi, HALF + 1), np.pi + share[:, 0] * np.pi])
    level = plan.levels
    ankle = level["ankle"]
    stops = [
        ("", level["crotch"] + 0.01, 4),
        ("thigh", level["thigh"], 14),
        ("knee", level["knee"], 6),
        ("calf", level["calf"], 11),
        ("ankle", ankle, 0),
    ]
    top = np.array(grid.points)[ring]
    for name, height in _levels(stops)[1:]:
        points = _section(plan.leg, height, angle)
        free = height > level["thigh"] + 1e-9
        if free:
            mix = (height - level["thigh"]) / (level["crotch"] + 0.01 - level["thigh"])
            points = top * mix * [0.6, 1, 1] + points * (1 - mix)
            points[:, 0] = np.maximum(points[:, 0], 0.012)
        below = grid.add(points, _FREE if free else (0, 1, 0))
        grid.join(ring, below, closed=True)
        ring = below
        if name:
            grid.rows[name] = ring
    _foot(grid, plan, ring, angle)


def _foot(grid: Grid, plan: BodyPlan, ring: NDArray[np.int64], angle: FloatArray) -> None:
    """Rows that swing round the instep from level to upright, then run to the toes."""
    swing, straight = 9, 8
    pivot_y, pivot_z = 0.85 * plan.levels["ankle"], plan.leg[-3, 3] + 0.035
    toe = plan.foot[-3, 0]
    sin, cos = np.sin(angle), np.cos(angle)
    for k in range(1, swing + straight + 1):
        if k <= swing:
            turn = np.pi / 2 * k / swing
            plane = np.array([0.0, np.cos(turn), -np.sin(turn)])
            reach = 0.02 + (0.075 + 0.03 * np.sin(2 * turn)) * 0.5 * (1 - cos)
            _, half, _ = _at(plan.foot, pivot_z - 0.06 * np.cos(turn))
            middle = plan.foot[3, 1]
            y, z = pivot_y - reach * np.sin(turn), pivot_z - reach * np.cos(turn)
        else:
            forward = pivot_z + (toe - pivot_z) * (k - swing) / straight
            plane = np.array([0.0, 0.0, 1.0])
            middle, half, height = _at(plan.foot, forward)
            y, z = height / 2 + height / 2 * cos, np.full(len(angle), forward)
        below = grid.add(np.column_stack([middle + half * sin, y, z]), plane)
        grid.join(ring, below, closed=True)
        ring = below
    grid.close(np.roll(ring, 4), 9)


def _arm(grid: Grid, plan: BodyPlan, rows: list[NDArray[np.int64]]) -> None:
    first = len(rows) - 1 - _SHOULDER_ROWS
    hole = rows[first : first + _HOLE_ROWS + 1]
    middle = HALF // 2
    front = [row[_HOLE_FIRST] for row in hole[1:-1]]
    back = [row[_HOLE_LAST] for row in hole[1:-1]][::-1]
    top, bottom = hole[-1], hole[0]
    ring = np.array(
        [
            *top[middle : _HOLE_LAST + 1],
            *back,
            *bottom[_HOLE_FIRST : _HOLE_LAST + 1][::-1],
            *front,
            *top[_HOLE_FIRST:middle],
        ]
    )
    grid.rows["armscye"] = ring
    grid.rows["front_fold"] = np.array([hole[1][_HOLE_FIRST]])
    grid.rows["back_fold"] = np.array([hole[1][_HOLE_LAST]])
    angle = np.linspace(0, 2 * np.pi, len(ring), endpoint=False)
    axis = arm_axis()
    normal = np.array([-axis[1], axis[0], 0.0])
    start = np.array(grid.points)[ring]
    stops = [
        ("", 0.03, 3),
        ("", 0.095, 3),
        ("upper_arm", 0.16, 8),
        ("elbow", plan.elbow, 5),
        ("forearm", plan.elbow + 0.06, 11),
        ("wrist", plan.wrist, 10),
        ("", plan.fingertip - 0.012, 0),
    ]
    free_until = 0.095
    for k, (name, along) in enumerate(_levels(stops)):
        thick, fore, aft = _at(plan.arm, along)
        points = (
            plan.shoulder
            + along * axis
            + np.outer(thick * np.cos(angle), normal)
            + np.outer((fore + aft) / 2 - (fore - aft) / 2 * np.sin(angle), [0, 0, 1])
        )
        free = along < free_until
        if free:
            mix = 1 - (k + 1) / 5
            points = start * mix + points * (1 - mix)
        outer = grid.add(points, _FREE if free else axis)
        grid.join(ring, outer, closed=True)
        ring = outer
        if name:
            grid.rows[name] = ring
    grid.close(np.roll(ring, 5), 10)
