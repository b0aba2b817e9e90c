"""A body that gives way where its own parts press on each other.

Skinned bodies pass through themselves in armpits, groins and bent elbows, where flesh would be pressed flat. Cloth in
between has no room, and is caught (Baraff, Witkin & Kass 2003, "Untangling cloth", section 5). So in each frame the
skin about such places sinks in along its normals, on both sides alike, until cloth fits between.
"""

from __future__ import annotations

from collections import OrderedDict

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vto_pipeline.geometry.intersections import self_intersections
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.motion import BodyPath

_ABOUT = 0.06  # m: skin this near triangles that meet may sink
_STEP, _STEPS = 3e-3, 10  # m of sinking at a time, and how often: less than 30 mm on either side
_SMOOTHINGS = 2  # times that sinking is averaged with that of neighbours
_REMEMBERED = 3  # frames


class YieldingBody:
    """A body on its path, which gives way to itself.

    Args:
        path: The body as it is posed.
        room: To leave between parts that press on each other [m].
    """

    def __init__(self, path: BodyPath, room: float) -> None:
        self._posed, self._room = path, room
        self._known: OrderedDict[int, tuple[int, FloatArray]] = OrderedDict()
        self.path = BodyPath(self._at, path.faces, path.frames, path.frame_time)

    def own_crossings(self, frame: int) -> int:
        """Return how many pairs of triangles of the posed body meet in a frame."""
        return self._frame(frame)[0]

    def depth(self, frame: int) -> float:
        """Return how far the skin has sunk in a frame where it has most [m]."""
        return float(np.linalg.norm(self._frame(frame)[1], axis=1).max(initial=0.0))

    def _at(self, time: float) -> FloatArray:
        place = min(max(time / self._posed.frame_time, 0.0), float(self._posed.frames - 1))
        first = int(place)
        share = place - first
        sunk = (1.0 - share) * self._frame(first)[1]
        if share > 0.0:
            sunk = sunk + share * self._frame(min(first + 1, self._posed.frames - 1))[1]
        return self._posed.at(time) + sunk

    def _frame(self, frame: int) -> tuple[int, FloatArray]:
        """Return pairs that meet, and how the skin has moved by sinking [m], shape (V, 3)."""
        if frame not in self._known:
            mesh = TriangleMesh(self._posed.at(self._posed.time(frame)), self._posed.faces)
            meeting = np.unique(pairs := self_intersections(mesh))
            self._known[frame] = len(pairs), sunken(mesh, meeting, self._room)
            if len(self._known) > _REMEMBERED:
                self._known.popitem(last=False)
        return self._known[frame]


def sunken(mesh: TriangleMesh, meeting: NDArray[np.int32], room: float) -> FloatArray:
    """Return how the skin moves so that its parts leave room between them, as far as that goes [m], shape (V, 3).

    Args:
        mesh: A body.
        meeting: Its faces that pass through each other.
        room: To leave [m].
    """
    moved = np.zeros_like(mesh.vertices)
    if len(meeting) == 0:
        return moved
    places = mesh.vertices[mesh.faces[meeting]].mean(axis=1)
    about = np.flatnonzero(cKDTree(places).query(mesh.vertices, distance_upper_bound=_ABOUT)[0] < _ABOUT)
    corners = mesh.faces.reshape(-1)
    around = np.roll(mesh.faces, 1, axis=1).reshape(-1)
    count = np.bincount(corners, minlength=len(moved)) + 1.0
    for _ in range(_STEPS):
        now = TriangleMesh(mesh.vertices + moved, mesh.faces)
        normals = vertex_normals(now)
        pressed = SurfaceDistance(now).inside(now.vertices[about] + room * normals[about])
        if not pressed.any():
            break
        sinks = np.zeros(len(moved))
        sinks[about[pressed]] = _STEP
        for _ in range(_SMOOTHINGS):
            sinks = (sinks + np.bincount(corners, sinks[around], len(moved))) / count
        moved -= sinks[:, None] * normals
    return moved
