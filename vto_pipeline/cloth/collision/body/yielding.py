"""A body that gives way where its own parts press on each other.

Skinned bodies pass through themselves in armpits, groins and bent elbows, where flesh would be pressed flat. Cloth in
between has no room, and is caught (Baraff, Witkin & Kass 2003, "Untangling cloth", section 5). So in each frame the
skin about such places sinks in along its normals, on both sides alike, until cloth fits between. Where a motion ends in
rest, the body is as it was given: cloth then lies on its union.
"""

from __future__ import annotations

from collections import OrderedDict
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from vto_pipeline.geometry.intersections import intersecting_faces, meeting_vertices, self_intersections
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.smooth import neighbour_mean
from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.motion import BodyPath

_STEP, _STEPS = 3e-3, 15  # m of sinking at a time, and how often: less than 45 mm on either side
_SMOOTHINGS = 2  # times that sinking, or the bottom of a fold, is averaged with that of neighbours
_UNFOLDINGS, _RINGS = 10, 2  # how often folds that are left are smoothed at most, and how far about them
_ROOM = 2.0  # skins between parts of the body that come near each other: one for the cloth on either
_HEMS = 3.0  # times that where cloth is carried along: a closing groin draws it in by its hem, in several layers
_REMEMBERED = 3  # frames
_HELD = 1e-9  # m: a body that moves by less between frames holds its pose
_ON_A_FRAME = 1e-6  # of the time between frames: steps that end on a frame add up to it but for rounding


class _Sunken(NamedTuple):
    """What has become of the skin in a frame.

    Args:
        posed: The body as it is posed [m], shape (V, 3).
        posed_pairs: Pairs of its triangles that meet.
        moved: How the skin has moved by sinking [m], shape (V, 3).
        pairs: How many pairs meet then.
    """

    posed: FloatArray
    posed_pairs: int
    moved: FloatArray
    pairs: int


class YieldingBody:
    """A body on its path, which gives way to itself.

    Args:
        path: The body as it is posed.
        skin: Distance that cloth keeps from it [m].
        about: Its vertices that may sink, shape (N,). Those that have no room as the motion begins never do: creases.
    """

    def __init__(self, path: BodyPath, skin: float, about: NDArray[np.int64]) -> None:
        self._posed, self._free, self._room = path, _ROOM * skin, _HEMS * _ROOM * skin
        self._about = about[~_pressed(TriangleMesh(path.at(0.0), path.faces), about, self._free)]
        self._known: OrderedDict[int, _Sunken] = OrderedDict()
        self._mean = neighbour_mean(TriangleMesh(path.at(0.0), path.faces))
        self.path = BodyPath(self._at, path.faces, path.frames, path.frame_time)

    def own_crossings(self, frame: int) -> int:
        """Return how many pairs of triangles of the posed body meet in a frame."""
        return self._frame(frame).posed_pairs

    def crosses_itself(self, frame: int) -> bool:
        """Return whether any still meet in a frame when the skin has sunk."""
        return self._frame(frame).pairs > 0

    def depth(self, frame: int) -> float:
        """Return how far the skin has sunk in a frame where it has most [m]."""
        return float(np.linalg.norm(self._frame(frame).moved, axis=1).max(initial=0.0))

    def crossing_with_room(self, cloth: TriangleMesh, frame: int) -> IntArray:
        """Return pairs of triangles of cloth and posed body that meet where the posed skin is free, shape (K, 2).

        Skin gives way for some distance about where it is pressed. Where there was room for cloth above it as posed,
        cloth has no need to be in it.
        """
        there = self._frame(frame)
        if not there.moved.any():
            return np.empty((0, 2), np.int32)
        posed = TriangleMesh(there.posed, self.path.faces)
        pairs = intersecting_faces(cloth, posed)
        corners, place = np.unique(posed.faces[pairs[:, 1]], return_inverse=True)
        pressed = _pressed(posed, corners.astype(np.int64), self._free) if len(corners) > 0 else np.zeros(0, np.bool_)
        return pairs[~pressed[place.reshape(-1, 3)].any(axis=1)]

    def _at(self, time: float) -> FloatArray:
        place = min(max(time / self._posed.frame_time, 0.0), float(self._posed.frames - 1))
        if abs(place - round(place)) < _ON_A_FRAME:
            place = float(round(place))
        first = int(place)
        share = place - first
        sunk = (1.0 - share) * self._frame(first).moved
        if share > 0.0:
            sunk = sunk + share * self._frame(min(first + 1, self._posed.frames - 1)).moved
        return self._posed.at(time) + sunk

    def _frame(self, frame: int) -> _Sunken:
        if frame not in self._known:
            mesh = TriangleMesh(self._posed.at(self._posed.time(frame)), self._posed.faces)
            held = [one for one in self._known.values() if np.abs(one.posed - mesh.vertices).max() < _HELD]
            self._known[frame] = held[0] if held else _sink(mesh, self._about, self._room, self._mean)
            if len(self._known) > _REMEMBERED:
                self._known.popitem(last=False)
        return self._known[frame]


def give_way(
    body: MovingBody, skin: float, about: NDArray[np.int64], *, at_end: bool = False
) -> tuple[MovingBody, float]:
    """Return the body, its skin sunken between its first and last keyframe, and how far it sinks at most [m].

    Args:
        body: The keyframes.
        skin: Distance that cloth keeps from it [m].
        about: Its vertices that may sink, shape (N,). Those that have no room as the motion begins never do: creases.
        at_end: Whether it gives way in its last keyframe, too.
    """
    frames, room = body.keyframes.copy(), _ROOM * skin
    about = about[~_pressed(TriangleMesh(frames[0], body.faces), about, room)]
    deepest, mean = 0.0, neighbour_mean(TriangleMesh(frames[0], body.faces))
    for frame in frames[1 : None if at_end else -1]:
        sunk = _sink(TriangleMesh(frame, body.faces), about, room, mean).moved
        frame += sunk
        deepest = max(deepest, float(np.linalg.norm(sunk, axis=1).max(initial=0.0)))
    return (MovingBody(frames, body.faces), deepest) if deepest > 0.0 else (body, 0.0)


def sunken(mesh: TriangleMesh, about: NDArray[np.int64], room: float) -> FloatArray:
    """Return how the skin moves so that its parts leave room between them, as far as that goes [m], shape (V, 3).

    The bottom of a deep fold turns inside out under skinning, and has no side that could sink. It is smoothed, as flesh
    that is squeezed there fills it.

    Args:
        mesh: A body.
        about: Its vertices that may sink, shape (N,).
        room: To leave [m].
    """
    return _sink(mesh, about, room, neighbour_mean(mesh)).moved


def _sink(mesh: TriangleMesh, about: NDArray[np.int64], room: float, mean: csr_matrix) -> _Sunken:
    """See `sunken`; `mean` gives each vertex that of its neighbours."""
    posed = meeting = self_intersections(mesh)
    now, looked_at, steps = mesh, mesh, _STEPS
    for _ in range(_UNFOLDINGS + 1):
        now, steps = _pushed_apart(now, about, room, steps, mean)
        if now is not looked_at:
            meeting, looked_at = self_intersections(now), now
        folded = _folded(meeting, mesh, about)
        if not folded.any():
            break
        for _ in range(_RINGS):
            folded |= mean @ folded > 0.0
        places = now.vertices.copy()
        for _ in range(_SMOOTHINGS):
            places[folded] = 0.5 * (places + mean @ places)[folded]
        now = TriangleMesh(places, mesh.faces)
    if now is not looked_at:
        meeting = self_intersections(now)
    return _Sunken(mesh.vertices, len(posed), now.vertices - mesh.vertices, len(meeting))


def _pushed_apart(
    mesh: TriangleMesh, about: NDArray[np.int64], room: float, steps: int, mean: csr_matrix
) -> tuple[TriangleMesh, int]:
    """Return a body whose skin has sunk where these vertices lack room, and how many of the steps are left."""
    while steps > 0:
        about = about[_pressed(mesh, about, room)]
        if len(about) == 0:
            break
        sinks = np.zeros(len(mesh.vertices))
        sinks[about] = _STEP
        for _ in range(_SMOOTHINGS):
            sinks = 0.5 * (sinks + mean @ sinks)
        mesh = TriangleMesh(mesh.vertices - sinks[:, None] * vertex_normals(mesh), mesh.faces)
        steps -= 1
    return mesh, steps


def _folded(meeting: IntArray, mesh: TriangleMesh, about: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which of these vertices belong to triangles that meet others, in pairs (K, 2), shape (V,)."""
    chosen = np.zeros(len(mesh.vertices), np.bool_)
    chosen[about] = True
    return chosen & meeting_vertices(meeting, mesh.faces, len(chosen))


def _pressed(mesh: TriangleMesh, about: NDArray[np.int64], room: float) -> NDArray[np.bool_]:
    """Return which of these vertices have another part of the body within the room above them [m], shape (N,)."""
    return SurfaceDistance(mesh).inside(mesh.vertices[about] + room * vertex_normals(mesh)[about])
