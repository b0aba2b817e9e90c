"""Rims of openings: in edges of one length before all else is remeshed, their sharp turns, and how long they stay."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.geometry.topology import boundary_loops, boundary_walks, corners_from, submesh
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

SMALL = 12.0
"""A rim of fewer edges is small: in so few, vertices that slide along it cut its corners, round for round."""
_SPLIT = 2.0
"""Longer edges are halved, in lengths of those wanted."""
_SHARP = np.deg2rad(40.0)
"""A rim that turns by more, between chords of one edge, has a corner there."""
_APART = 0.8
"""Corners are no nearer to each other, in edges: a short edge between them could not be merged."""


def even_rims(mesh: TriangleMesh, edge: float, below: float) -> TriangleMesh:
    """Return the mesh with the rims of openings in edges of about one length; their vertices stay on the rim.

    Vertices between those that are kept are merged into them, wherever the surface stays a manifold; long edges are
    halved.

    Args:
        mesh: Manifold and oriented.
        edge: Wanted length [m].
        below: Rims as long or longer stay as they are [m].
    """
    rims = [loop for loop in boundary_loops(mesh) if perimeter(mesh, loop) < below]
    if not rims:
        return mesh
    faces = _thin(mesh, rims, edge)
    thinned, _ = submesh(TriangleMesh(mesh.vertices, faces), np.ones(len(faces), np.bool_))
    return _halve_long(thinned, edge, below)


def perimeter(mesh: TriangleMesh, loop: IntArray) -> float:
    """Return the length of a closed loop of vertices [m]."""
    return float(_lengths(mesh, loop).sum())


def rim_corners(mesh: TriangleMesh, loop: IntArray, edge: float) -> IntArray:
    """Return the vertices of a rim at which it turns sharply, the sharpest where several are near each other.

    Args:
        mesh: Its positions.
        loop: Of its `boundary_loops`.
        edge: Wanted length [m]: what turns within a smaller way counts as a whole.
    """
    path, along = mesh.vertices[loop], np.append(0.0, np.cumsum(_lengths(mesh, loop)))
    whole, back = along[-1], np.vstack([path, path[:1]])
    chords = []
    for way in (-edge, edge):
        place = np.mod(along[:-1] + way, whole)
        chords.append(np.column_stack([np.interp(place, along, back[:, k]) for k in range(3)]) - path)
    cosine = -np.sum(chords[0] * chords[1], axis=1)
    length = np.linalg.norm(chords[0], axis=1) * np.linalg.norm(chords[1], axis=1)
    turn = np.arccos(np.clip(cosine / np.maximum(length, np.finfo(float).tiny), -1.0, 1.0))
    found: list[int] = []
    for i in np.argsort(-turn, kind="stable"):
        if turn[i] <= _SHARP:
            break
        apart = np.abs(along[found] - along[i])
        if (np.minimum(apart, whole - apart) > _APART * edge).all():
            found.append(int(i))
    return np.asarray(loop[found], dtype=np.int32)


def rim_change(before: TriangleMesh, after: TriangleMesh) -> float:
    """Return the largest change of the length of an opening, relative: those of the one mesh lie on the other's.

    Args:
        before, after: With as many openings.
    """
    import igl

    loops = boundary_loops(before)
    if not loops:
        return 0.0
    of_segment = np.repeat(np.arange(len(loops)), [len(loop) for loop in loops])
    ends = np.column_stack([np.concatenate(loops), np.concatenate([np.roll(loop, -1) for loop in loops])])
    was, now = np.array([perimeter(before, loop) for loop in loops]), np.zeros(len(loops))
    for loop in boundary_loops(after):
        _, segment, _ = igl.point_mesh_squared_distance(after.vertices[loop], before.vertices, ends.astype(np.int64))
        now[np.bincount(of_segment[segment]).argmax()] += perimeter(after, loop)
    return float(np.abs(now / was - 1.0).max())


def _wanted(length: float, edge: float) -> int:
    """Return how many edges a rim gets: a small one up to twice as many, since chords cut its corners too."""
    return int(np.clip(np.rint(2.0 * length / edge), 3, max(SMALL, np.rint(length / edge))))


def _lengths(mesh: TriangleMesh, loop: IntArray) -> FloatArray:
    path = mesh.vertices[loop]
    return np.linalg.norm(np.roll(path, -1, axis=0) - path, axis=1)


def _thin(mesh: TriangleMesh, rims: list[IntArray], edge: float) -> IntArray:
    """Return the faces after rim vertices are merged into those kept, one about every edge length, at least three."""
    faces = mesh.faces.copy()
    around: dict[int, set[int]] = {}
    member = np.zeros(len(mesh.vertices), np.bool_)
    member[np.concatenate(rims)] = True
    for f in np.flatnonzero(member[faces].any(axis=1)):
        for vertex in faces[f]:
            around.setdefault(int(vertex), set()).add(int(f))
    for loop in rims:
        loop, kept = _chosen(mesh, loop, edge)
        last = int(loop[0])
        for vertex, keep in zip(loop[1:].tolist(), kept[1:].tolist(), strict=True):
            if keep or not _merge(faces, around, vertex, last):
                last = vertex
    return faces[(faces >= 0).all(axis=1)]


def _chosen(mesh: TriangleMesh, loop: IntArray, edge: float) -> tuple[IntArray, NDArray[np.bool_]]:
    """Return a rim from one of the vertices that are kept on, and which those are.

    They lie at equal distances along it, and begin where the chords between them are longest: at its sharp turns.
    """
    along = np.append(0.0, np.cumsum(_lengths(mesh, loop)))
    spacing = along[-1] / _wanted(along[-1], edge)
    best, longest = (loop, np.ones(len(loop), np.bool_)), 0.0
    for first in range(int(np.searchsorted(along[:-1], spacing))):
        turned = np.roll(loop, -first)
        place = np.mod(np.roll(along[:-1], -first) - along[first], along[-1])
        kept = np.append(True, np.diff(np.floor(place / spacing)) > 0)
        length = _lengths(mesh, turned[kept]).sum()
        if length > longest:
            best, longest = (turned, kept), length
    return best


def _merge(faces: IntArray, around: dict[int, set[int]], gone: int, into: int) -> bool:
    """Merge a vertex into its neighbour on the rim; return whether the surface allows it.

    The two may have no neighbour in common but the third vertex of their one face (link condition; Dey et al. 1999).
    """
    both = around[gone] & around[into]
    shared = _neighbours(faces, around[gone]) & _neighbours(faces, around[into])
    if len(both) != 1 or len(shared - {gone, into}) != 1:
        return False
    (vanishing,) = both
    if any(len(around.get(int(v), ())) == 1 for v in faces[vanishing] if v not in (gone, into)):
        return False  # its third vertex would be left without a face
    for vertex in faces[vanishing]:
        around[int(vertex)].discard(vanishing)
    faces[vanishing] = -1
    for f in around.pop(gone):
        faces[f][faces[f] == gone] = into
        around[into].add(f)
    return True


def _neighbours(faces: IntArray, which: set[int]) -> set[int]:
    return set(faces[sorted(which)].ravel().tolist())


def _halve_long(mesh: TriangleMesh, edge: float, below: float) -> TriangleMesh:
    """Return the mesh with the edges of those rims halved until none is long, one of a face at a time."""
    while True:
        start, long = mesh.faces.ravel(), [np.zeros(0, np.int32)]
        for walk in boundary_walks(mesh):
            length = _lengths(mesh, start[walk])
            if length.sum() < below:
                long.append(walk[length > _SPLIT * length.sum() / _wanted(length.sum(), edge)])
        half = np.concatenate(long)
        half = half[np.unique(half // 3, return_index=True)[1]]
        if len(half) == 0:
            return mesh
        a, b, c = start[corners_from(half)].T
        middle = len(mesh.vertices) + np.arange(len(half), dtype=np.int32)
        faces = mesh.faces.copy()
        faces[half // 3] = np.column_stack([a, middle, c])
        faces = np.vstack([faces, np.column_stack([middle, b, c])]).astype(np.int32)
        mesh = TriangleMesh(np.vstack([mesh.vertices, 0.5 * (mesh.vertices[a] + mesh.vertices[b])]), faces)
