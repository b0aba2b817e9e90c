"""The flat faces of one mesh carried over onto another mesh of the same surface, such as a remeshed one.

Each face has a shape of its own in the plane, as cloth has in its panel: its lengths are not those in space. Faces
that agree on their common corners form a panel. A corner of the other mesh lies where the place below it lies in its
panel; where a face reaches across a seam, the panel beyond is unfolded about it. So no cloth is lost, even where the
other mesh cuts folds short. Where neither says how long an edge is, as across a dart, its path over the faces below it
is measured, each step in that face's plane. On the mesh itself nothing changes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import face_areas
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

_STEPS = 4  # of a path along an edge
_INSET = 1e-6  # of the way to the middle of a face: on a seam, it lies on its own side
_FLAT = 1e-9  # of the mean area: faces of less have no directions
_ALIKE = 1e-6  # m: corners no farther apart are one
_GAP = 0.02  # of an edge, outside its panel: it reaches across a dart
_LONGER, _LONGEST = 1.5, 4.0  # times as in space: a side asks for a seam; even folds that are cut short are no more
_VAGUE = 1e-6  # weight of a side that is not known for certain
_THIN = 0.01  # height over longest side: what is thinner does not count as cloth
_LOOKS = 7  # along a side
_FAR = 100.0  # m between panels that are looked at side by side


class _Seams(NamedTuple):
    """Edges whose two faces lie apart in the plane, each twice.

    Args:
        panels: Of the side to unfold to, and of the side that is unfolded, shape (S, 2); they may be one.
        middle: In space [m], shape (S, 3).
        there, here: Ends on the two sides, in the plane [m], shape (S, 2, 2).
    """

    panels: NDArray[np.int64]
    middle: FloatArray
    there: FloatArray
    here: FloatArray


def carry_flat_faces(source: TriangleMesh, laid: FloatArray, mesh: TriangleMesh) -> FloatArray:
    """Return the faces of another mesh laid flat, each for itself and its v as that of the faces below it.

    Args:
        source: The surface [m].
        laid: Its faces in the plane [m], shape (F, 3, 2).
        mesh: On that surface [m].

    Returns:
        Corners in the plane [m], shape (G, 3, 2).
    """
    area = face_areas(source)
    turn = np.linalg.det(_edges(laid))
    sound = (area > _FLAT * area.mean()) & (np.abs(turn) > _FLAT * np.abs(turn).mean())
    source, turn = TriangleMesh(source.vertices, source.faces[sound]), turn[sound]
    laid = laid[sound] * np.column_stack([np.sign(turn), np.ones(len(turn))])[:, None]  # no panel is seen from behind
    surface, base = SurfaceDistance(source), source.vertices[source.faces]
    to_plane = _edges(laid) @ np.linalg.pinv(_edges(base))  # (F, 2, 3)

    corners = mesh.vertices[mesh.faces]
    middle = corners.mean(axis=1, keepdims=True)
    inset = middle + (1.0 - _INSET) * (corners - middle)
    below = surface.nearest(inset.reshape(-1, 3))
    place = laid[below.face, 0] + np.einsum("nij,nj->ni", to_plane[below.face], below.point - base[below.face, 0])
    panel = panel_of_faces(source, laid)
    own = panel[below.face].reshape(-1, 3)
    into = np.where(own[:, 1] == own[:, 2], own[:, 1], own[:, 0])
    place, beyond = place.reshape(-1, 3, 2), own != into[:, None]
    whole, leaves = ~beyond.any(axis=1), np.zeros(len(own), np.bool_)
    leaves[whole] = _leaves_panel(place[whole], into[whole], laid, panel)
    beyond[whole] = _across_own_seam(place[whole], corners[whole], leaves[whole])
    found, known = _unfolded(place, beyond, own, into, middle[:, 0], _seams(source, laid, panel))
    moved = (found != place).any(axis=(1, 2))
    known &= ~leaves | moved
    centre = found.mean(axis=1, keepdims=True)
    found = centre + (found - centre) / (1.0 - _INSET)
    lost = ~known | (_sides(found) > _LONGEST * _sides(corners)).any(axis=1)
    found[lost] = _measured(surface, to_plane, laid, base, corners[lost])
    found = _agreed(found, mesh, lost | moved | ~whole)
    thin = _slenderness(found) < _THIN
    found[thin] = _as_in_space(found[thin], corners[thin])
    return found


def panel_of_faces(mesh: TriangleMesh, laid: FloatArray) -> NDArray[np.int64]:
    """Return the panel of each face: faces that have a corner in common in the plane are of one, shape (F,)."""
    place = np.round(laid.reshape(-1, 2) / _ALIKE)
    where = np.column_stack([_welded(mesh)[mesh.faces].reshape(-1), place])
    corner = np.unique(where, axis=0, return_inverse=True)[1].reshape(-1, 3)
    ends = np.concatenate([corner[:, :2], corner[:, 1:]])
    count = int(corner.max()) + 1
    graph = coo_matrix((np.ones(len(ends), np.int8), (ends[:, 0], ends[:, 1])), (count, count))
    return np.asarray(connected_components(graph, directed=False)[1][corner[:, 0]], dtype=np.int64)


def stretch_flat_faces(laid: FloatArray, mesh: TriangleMesh, positions: FloatArray) -> FloatArray:
    """Return flat faces stretched as their mesh is when it moves; each side by as much as it is in space.

    Args:
        laid: Faces in the plane [m], shape (F, 3, 2).
        mesh: As it is [m].
        positions: Where its vertices go [m], shape (V, 3).
    """
    was, now, flat = (_sides(corners) for corners in (mesh.vertices[mesh.faces], positions[mesh.faces], laid))
    return _with_sides(laid, np.divide(now, was, out=np.ones_like(was), where=was > 0.0) * flat)


def _welded(mesh: TriangleMesh) -> NDArray[np.int64]:
    """Return a number for the place of each vertex: files with texture often have one for each side of a seam, (V,)."""
    return np.asarray(np.unique(np.round(mesh.vertices / _ALIKE), axis=0, return_inverse=True)[1]).reshape(-1)


def _seams(mesh: TriangleMesh, laid: FloatArray, panel: NDArray[np.int64]) -> _Seams:
    place = _welded(mesh)[mesh.faces]
    ends = np.stack([place, np.roll(place, -1, axis=1)], axis=2).reshape(-1, 2)
    flip = ends[:, 0] > ends[:, 1]
    ends = np.where(flip[:, None], ends[:, ::-1], ends)
    flat = np.stack([laid, np.roll(laid, -1, axis=1)], axis=2).reshape(-1, 2, 2)
    flat = np.where(flip[:, None, None], flat[:, ::-1], flat)
    _, edge, count = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    edge = edge.reshape(-1)
    order = np.argsort(edge, kind="stable")
    pair = np.flatnonzero(np.diff(edge[order]) == 0)
    first, second = order[pair], order[pair + 1]
    seam = (np.abs(flat[first] - flat[second]).max(axis=(1, 2)) > _ALIKE) & (count[edge[first]] == 2)
    one, two = np.concatenate([first[seam], second[seam]]), np.concatenate([second[seam], first[seam]])
    corner = mesh.faces.reshape(-1)
    following = 3 * (one // 3) + (one + 1) % 3
    middle = 0.5 * (mesh.vertices[corner[one]] + mesh.vertices[corner[following]])
    return _Seams(np.column_stack([panel[one // 3], panel[two // 3]]), middle, flat[one], flat[two])


def _across_own_seam(place: FloatArray, corners: FloatArray, leaves: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which corners of faces of one panel may lie beyond a seam with that panel itself, as a sleeve's, (G, 3).

    Args:
        place: In the plane [m], shape (G, 3, 2).
        corners: In space [m], shape (G, 3, 3).
        leaves: Which faces have a side outside their panel, shape (G,).
    """
    longer = _sides(place) / np.maximum(_sides(corners), _ALIKE)
    alone = (longer.argmin(axis=1) + 2) % 3  # opposite the side that is like itself
    found = np.zeros(longer.shape, np.bool_)
    found[np.arange(len(found)), alone] = leaves | (longer.max(axis=1, initial=0.0) > _LONGER)
    return found


def _unfolded(
    place: FloatArray,
    beyond: NDArray[np.bool_],
    own: NDArray[np.int64],
    into: NDArray[np.int64],
    middle: FloatArray,
    seams: _Seams,
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return faces with all corners in the plane of one panel, shape (G, 3, 2), and which of them are known, (G,).

    Args:
        place: Each corner in its own panel [m], shape (G, 3, 2).
        beyond: Which corners to unfold, shape (G, 3).
        own: The panel of each corner, shape (G, 3).
        into: The panel of each face, shape (G,).
        middle: Of each face, in space [m], shape (G, 3).
        seams: Edges about which panels are unfolded; the nearest one is taken.
    """
    from scipy.spatial import cKDTree

    found, known = place.copy(), np.ones(len(place), np.bool_)
    face, corner = np.nonzero(beyond)
    wanted = np.column_stack([into[face], own[face, corner]])
    for pair in np.unique(wanted, axis=0):
        asked = (wanted == pair).all(axis=1)
        f, c = face[asked], corner[asked]
        these = np.flatnonzero((seams.panels == pair).all(axis=1))
        if len(these) == 0:
            known[f] &= pair[0] == pair[1]
            continue
        near = these[cKDTree(seams.middle[these]).query(middle[f], k=[1, min(2, len(these))])[1]]
        away = np.linalg.norm(seams.here[near].mean(axis=2) - place[f, c][:, None], axis=2)
        seam = near[np.arange(len(f)), away.argmin(axis=1)]
        there, here = seams.there[seam], seams.here[seam]
        # complex numbers: a turn by the angle between both sides of the seam, about its middle
        turn = _complex(there[:, 1] - there[:, 0]) * np.conj(_complex(here[:, 1] - here[:, 0]))
        turn /= np.maximum(np.abs(turn), np.finfo(float).tiny)
        moved = turn * _complex(place[f, c] - here.mean(axis=1)) + _complex(there.mean(axis=1))
        there_now = np.column_stack([moved.real, moved.imag])
        if pair[0] == pair[1]:  # a fold cut short looks like a seam; only across a seam does this bring it nearer
            others = 0.5 * (place[f].sum(axis=1) - place[f, c])
            before, after = (np.linalg.norm(x - others, axis=1) for x in (place[f, c], there_now))
            there_now = np.where((after < before)[:, None], there_now, place[f, c])
        found[f, c] = there_now
    return found, known


def _leaves_panel(
    found: FloatArray, into: NDArray[np.int64], laid: FloatArray, panel: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Return which flat faces (G, 3, 2) of these panels (G,) have a side that runs outside its panel, shape (G,)."""
    size = np.ptp(laid.reshape(-1, 2), axis=0).max() + _FAR

    def apart(points: FloatArray, number: NDArray[np.int64]) -> FloatArray:
        return np.concatenate([points, np.broadcast_to(size * number[:, None, None], (*points.shape[:2], 1))], axis=2)

    corners = apart(laid, panel).reshape(-1, 3)
    flat = SurfaceDistance(TriangleMesh(corners, np.arange(len(corners), dtype=np.int32).reshape(-1, 3)))
    shares = np.linspace(0.0, 1.0, _LOOKS + 2)[1:-1, None]
    sides = (found[:, :, None] + shares * (np.roll(found, -1, axis=1) - found)[:, :, None]).reshape(len(found), -1, 2)
    off = flat.nearest(apart(sides, into).reshape(-1, 3)).distance.reshape(-1, 3, _LOOKS)
    return np.asarray((off.max(axis=2, initial=0.0) > _GAP * _sides(found)).any(axis=1))


def _measured(
    surface: SurfaceDistance, to_plane: FloatArray, laid: FloatArray, base: FloatArray, corners: FloatArray
) -> FloatArray:
    """Return triangles (G, 3, 3) laid flat with sides as long as the paths below them, shape (G, 3, 2)."""
    if len(corners) == 0:
        return np.zeros((0, 3, 2))
    middle = corners.mean(axis=1)
    below = surface.nearest(middle).face
    lengths = _lengths_below(surface, to_plane, middle[:, None] + (1.0 - _INSET) * (corners - middle[:, None]))
    found, closes = _triangles(lengths / (1.0 - _INSET))
    found[~closes] = np.einsum("gij,gkj->gki", to_plane[below], corners)[~closes]
    warp = (_edges(base[below]) @ np.linalg.inv(_edges(laid[below])))[:, :, 1]
    return _turned(found, corners, warp)


def _lengths_below(surface: SurfaceDistance, to_plane: FloatArray, corners: FloatArray) -> FloatArray:
    """Return the lengths of the paths below the sides of triangles (G, 3, 3), from each corner to the next, (G, 3)."""
    shares = np.linspace(0.0, 1.0, 2 * _STEPS + 1)[:, None]
    path = corners[:, :, None] + shares * (np.roll(corners, -1, axis=1) - corners)[:, :, None]
    face = surface.nearest(path[:, :, 1::2].reshape(-1, 3)).face
    ends = surface.nearest(path[:, :, ::2].reshape(-1, 3)).point.reshape(len(corners), 3, _STEPS + 1, 3)
    moves = np.diff(ends, axis=2).reshape(-1, 3)
    steps = np.linalg.norm(np.einsum("nij,nj->ni", to_plane[face], moves), axis=1)
    return np.asarray(steps.reshape(len(corners), 3, _STEPS).sum(axis=2))


def _agreed(laid: FloatArray, mesh: TriangleMesh, vague: NDArray[np.bool_]) -> FloatArray:
    """Return flat faces of which the vague ones have the sides of their neighbours, or the average where all are vague.

    Args:
        laid: Faces in the plane [m], shape (G, 3, 2).
        mesh: Their mesh.
        vague: Which of them reach across a seam or were measured.
    """
    ends = np.sort(np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edge = np.unique(ends, axis=0, return_inverse=True)[1].reshape(-1)
    trust = np.repeat(np.where(vague, _VAGUE, 1.0), 3)
    agreed = np.bincount(edge, trust * _sides(laid).reshape(-1)) / np.bincount(edge, trust)
    found = laid.copy()
    found[vague] = _with_sides(laid[vague], agreed[edge].reshape(-1, 3)[vague])
    return found


def _as_in_space(laid: FloatArray, corners: FloatArray) -> FloatArray:
    """Return flat faces (G, 3, 2) in the shape they have in space (G, 3, 3), with their longest sides as they were.

    Three corners on a border that is straight in its panel span a triangle of no height, which could bear no strain.
    """
    longest = (_sides(laid).max(axis=1) / np.maximum(_sides(corners).max(axis=1), _ALIKE))[:, None]
    return _with_sides(laid, longest * _sides(corners))


def _slenderness(laid: FloatArray) -> FloatArray:
    """Return the heights of flat triangles (G, 3, 2) over their longest sides, shape (G,)."""
    return np.asarray(np.abs(np.linalg.det(_edges(laid))) / np.maximum(_sides(laid).max(axis=1), _ALIKE) ** 2)


def _with_sides(laid: FloatArray, sides: FloatArray) -> FloatArray:
    """Return flat triangles (G, 3, 2) with other sides (G, 3), v where it was; as they are if these would not close."""
    found, closes = _triangles(sides)
    found[~closes] = laid[~closes]
    return _turned(found, laid, np.broadcast_to([0.0, 1.0], (len(laid), 2)))


def _triangles(sides: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return triangles of these sides, from each corner to the next (G, 3), and which of them close (G,)."""
    first, second, third = sides.T
    along = np.divide(first**2 + third**2 - second**2, 2.0 * first, out=np.zeros_like(first), where=first > 0.0)
    height_sq = third**2 - along**2
    found = np.zeros((len(sides), 3, 2))
    found[:, 1, 0], found[:, 2, 0] = first, along
    found[:, 2, 1] = np.sqrt(np.maximum(height_sq, 0.0))
    return found, height_sq > 0.0


def _turned(laid: FloatArray, corners: FloatArray, warp: FloatArray) -> FloatArray:
    """Return flat triangles (G, 3, 2), of corners (G, 3, D) elsewhere, turned so that the warp there (G, D) is v."""
    share = np.einsum("gkj,gj->gk", np.linalg.pinv(_edges(corners)), warp)
    along = np.einsum("gik,gk->gi", _edges(laid), share)
    angle = np.arctan2(along[:, 0], along[:, 1])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return np.asarray(np.einsum("ijg,gkj->gki", turn, laid))


def _edges(corners: FloatArray) -> FloatArray:
    """Return two edges of triangles (G, 3, D) as columns, shape (G, D, 2)."""
    return np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)


def _sides(corners: FloatArray) -> FloatArray:
    """Return the lengths of the sides of triangles (G, 3, D), from each corner to the next, shape (G, 3)."""
    return np.asarray(np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2))


def _complex(vectors: FloatArray) -> NDArray[np.complex128]:
    return np.asarray(vectors[..., 0] + 1j * vectors[..., 1])
