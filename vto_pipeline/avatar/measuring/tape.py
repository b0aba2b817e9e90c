"""The tape: each measurement as a function of the vertices, with its derivative.

A taut tape spans hollows, so a girth is the perimeter of the convex hull of a plane section through the right part of
the body.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from vto_pipeline.avatar.measuring.definitions import Definition
from vto_pipeline.avatar.template.template import beyond_armscye, columns, membership, template
from vto_pipeline.geometry.topology import edges
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.body import Avatar

DENSITY_KG_M3 = 1000.0
"""Of a living body with 2 to 3 l of air in its lungs: tissue of 1020 (fat) to 1070 (lean) kg/m3 (Siri 1961)."""
DENSITY_SPREAD = 0.02
LANDMARK_M = 0.005
"""How well people agree on where a landmark is; our assumption, for lack of a published figure per landmark."""
RESOLUTION_M = 0.001
_ARM_ROWS = ("upper_arm", "elbow", "forearm", "wrist")
_LEG_ROWS = ("thigh", "knee", "calf", "ankle")


@dataclass(frozen=True)
class Reading:
    """A measured value and how it follows the vertices.

    Args:
        value: [m], or kg for the mass.
        vertices: Which vertices it depends on, shape (N,).
        gradient: Derivative by their positions, shape (N, 3).
    """

    value: float
    vertices: NDArray[np.int64]
    gradient: FloatArray

    def by_parameters(self, fields: FloatArray) -> FloatArray:
        """Return the derivative by the parameters of displacement fields, shape (P, V, 3); shape (P,)."""
        return np.einsum("nk,pnk->p", self.gradient, fields[:, self.vertices])


class Tape:
    """Reads measurements off any body of our topology, in the bind pose."""

    def __init__(self, body: Avatar) -> None:
        self._body = body
        self._columns = columns()

    def read(self, what: Definition, vertices: FloatArray, side: str = "left") -> Reading:
        """Read one measurement.

        Args:
            what: Its definition.
            vertices: The body in the bind pose [m], shape (V, 3).
            side: "left" or "right", where the measurement lies on a limb.
        """
        if what.kind == "mass":
            return mass_reading(vertices, self._body.faces)
        if what.kind == "path":
            column, _, end = what.place.partition(":")
            return _path(vertices, self._column(column, end, side))
        if what.kind == "span":
            return _path(vertices, np.array([self._landmark(name, side) for name in what.place.split()]))
        if what.kind == "loop":
            row = self._row(what.place, side)
            return _path(vertices, np.append(row, row[0]))
        if what.kind == "height":
            return self._height(what.place, vertices, side)
        if what.kind == "drop":
            ends = np.array([self._landmark(name, side) for name in what.place.split()], dtype=np.int64)
            return Reading(
                float(vertices[ends[0], 1] - vertices[ends[1], 1]), ends, np.array([[0, 1.0, 0], [0, -1.0, 0]])
            )
        return self._across(what, vertices, side)

    def uncertainty(self, what: Definition, vertices: FloatArray) -> float:
        """Return what the definition leaves open [m, kg]: how the value follows the landmarks and levels it rests on.

        Whoever places a landmark again, misses it by `LANDMARK_M`; girths follow their slope along the body.
        """
        if what.kind == "mass":
            return DENSITY_SPREAD * self.read(what, vertices).value
        if what.kind in ("girth", "breadth", "depth"):
            return float(np.hypot(self.by_level(what, vertices, LANDMARK_M), RESOLUTION_M / 2))
        # from the floor one end is uncertain, between landmarks both are
        return LANDMARK_M * (1.0 if what.kind == "height" else float(np.sqrt(2.0)))

    def by_level(self, what: Definition, vertices: FloatArray, reach: float) -> float:
        """Return how much a girth, breadth or depth changes as its level does by `reach` [m], up or down (rms)."""
        changes = [
            self._across(what, vertices, side, shift).value - self._across(what, vertices, side).value
            for side in ("left", "right")
            for shift in (reach, -reach)
        ]
        return float(np.sqrt(np.mean(np.square(changes))))

    def _across(self, what: Definition, vertices: FloatArray, side: str, shift: float = 0.0) -> Reading:
        points = self._section(what.place, vertices, side, shift)
        return points.hull() if what.kind == "girth" else points.extent(0 if what.kind == "breadth" else 2)

    def _row(self, name: str, side: str) -> IntArray:
        loops = self._body.loops
        return loops[name] if name in loops else loops[f"{side}_{name}"]

    def _landmark(self, name: str, side: str) -> int:
        landmarks = self._body.landmarks
        return landmarks[name] if name in landmarks else landmarks[f"{side}_{name}"]

    def _column(self, name: str, end: str, side: str) -> IntArray:
        column = self._columns[name if name in self._columns else f"{side}_{name}"]
        if not end:
            return column
        stop = np.flatnonzero(np.isin(column, self._body.loops[end]))[0]
        return column[stop:]

    def _height(self, place: str, vertices: FloatArray, side: str) -> Reading:
        landmarks = self._body.landmarks
        single = place in landmarks or f"{side}_{place}" in landmarks
        top = np.array([self._landmark(place, side)]) if single else self._row(place, side)
        sole = int(np.argmin(vertices[:, 1]))
        gradient = np.zeros((len(top) + 1, 3))
        gradient[:-1, 1], gradient[-1, 1] = 1 / len(top), -1.0
        value = float(vertices[top, 1].mean() - vertices[sole, 1])
        return Reading(value, np.append(top, sole).astype(np.int64), gradient)

    def _section(self, place: str, vertices: FloatArray, side: str, shift: float) -> RowSection:
        row = self._row(place, side)
        if place in _ARM_ROWS:
            ends = [vertices[self._row(name, side)].mean(axis=0) for name in ("upper_arm", "wrist")]
            normal, edges = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0]), _edges()[f"{side}_arm"]
        elif place in _LEG_ROWS:
            normal, edges = np.array([0.0, 1.0, 0.0]), _edges()[f"{side}_leg"]
        else:
            normal, edges = np.array([0.0, 1.0, 0.0]), _edges()["trunk"]
        return RowSection(vertices, row, normal, edges, shift)


class RowSection:
    """The points where a plane through a row's middle, or `shift` [m] beside it, cuts the edges of a part."""

    def __init__(
        self, vertices: FloatArray, row: IntArray, normal: FloatArray, edges: NDArray[np.int64], shift: float = 0.0
    ) -> None:
        self._normal, self._row, self._level = normal, row, vertices[row].mean(axis=0) @ normal + shift
        height = vertices @ normal - self._level
        self._edges = edges[(height[edges[:, 0]] < 0) != (height[edges[:, 1]] < 0)]
        below, above = height[self._edges].T
        self._share = (below / (below - above))[:, None]
        start, end = vertices[self._edges[:, 0]], vertices[self._edges[:, 1]]
        self._span = end - start
        self.points = start + self._share * self._span

    def hull(self) -> Reading:
        """Perimeter of the convex hull."""
        across = np.linalg.svd(self._normal[None])[2][1:]
        order = ConvexHull(self.points @ across.T).vertices
        corner = self.points[order]
        side = np.roll(corner, -1, axis=0) - corner
        length = np.linalg.norm(side, axis=1, keepdims=True)
        pull = np.roll(side / length, 1, axis=0) - side / length
        return self._reading(float(length.sum()), order, pull)

    def extent(self, axis: int) -> Reading:
        """Size along a world axis."""
        low, high = int(np.argmin(self.points[:, axis])), int(np.argmax(self.points[:, axis]))
        pull = np.zeros((2, 3))
        pull[0, axis], pull[1, axis] = -1.0, 1.0
        return self._reading(float(self.points[high, axis] - self.points[low, axis]), np.array([low, high]), pull)

    def _reading(self, value: float, which: NDArray[np.int64], pull: FloatArray) -> Reading:
        """Chain rule from section points to edge ends, and to the row whose middle carries the plane."""
        edges, share, span = self._edges[which], self._share[which], self._span[which]
        # a point slides along its edge as the plane moves against it
        slide = (pull * span).sum(axis=1, keepdims=True) / (span @ self._normal)[:, None]
        ends = [(1 - share) * (pull - slide * self._normal), share * (pull - slide * self._normal)]
        middle = np.tile(slide.sum() * self._normal / len(self._row), (len(self._row), 1))
        return Reading(
            value,
            np.concatenate([edges[:, 0], edges[:, 1], self._row]).astype(np.int64),
            np.concatenate([*ends, middle]),
        )


def _path(vertices: FloatArray, path: NDArray[np.int64] | IntArray) -> Reading:
    step = np.diff(vertices[path], axis=0)
    length = np.linalg.norm(step, axis=1, keepdims=True)
    gradient = np.zeros((len(path), 3))
    gradient[1:] += step / length
    gradient[:-1] -= step / length
    return Reading(float(length.sum()), path.astype(np.int64), gradient)


def mass_reading(vertices: FloatArray, faces: IntArray) -> Reading:
    """Read the mass of any closed mesh off its volume [kg]."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    gradient = np.zeros_like(vertices)
    for corner, slope in zip(faces.T, (np.cross(b, c), np.cross(c, a), np.cross(a, b)), strict=True):
        np.add.at(gradient, corner, slope / 6)
    volume = float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6
    return Reading(DENSITY_KG_M3 * volume, np.arange(len(vertices)), DENSITY_KG_M3 * gradient)


@cache
def _edges() -> dict[str, NDArray[np.int64]]:
    """Return part -> its edges, shape (E, 2): trunk, and arm and leg of each side."""
    body = template()
    leg, x = membership("leg"), body.bind_vertices[:, 0]
    every = edges(body.mesh).astype(np.int64)
    parts = {"trunk": ~beyond_armscye()}
    for side, sign in (("left", 1), ("right", -1)):
        parts[f"{side}_arm"] = beyond_armscye() & (sign * x > 0)
        parts[f"{side}_leg"] = (leg > 0.2) & (sign * x >= 0)
    return {name: every[inside[every].all(axis=1)] for name, inside in parts.items()}
