"""One part of another mesh in place of a body's own, beyond one of its rows of vertices.

The body ends at the row. The new part is cut a little beyond it; its rim is moved onto the body's surface there, and
that move fades out along the part: the smoothest that lies on the body next to the row and is zero further away. A
strip of triangles closes the gap. So the body is as it was up to the row, to the last bit, and the surface goes on
smoothly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vto_pipeline.errors import AvatarError
from vto_pipeline.geometry.closest import closest_points
from vto_pipeline.geometry.geodesic import distance_from
from vto_pipeline.geometry.laplace import extend_smoothly
from vto_pipeline.geometry.remeshing.clip import clip_to_positive
from vto_pipeline.geometry.section import plane_section
from vto_pipeline.geometry.topology import boundary_loops, edges, face_components, submesh
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

_GAP = 0.5
"""Between the row and the part's rim, in edges of the row."""
_ON_BODY = 0.2
"""Share of the reach along which the part lies on the body's surface."""


@dataclass(frozen=True)
class Seat:
    """Where a part sits on a body.

    Args:
        row: Vertices of the body round its end, shape (R,).
        tip: A vertex of the body beyond the row.
        axis: Unit vector across the row's plane, towards the part, shape (3,).
        reach: Length along the part over which it takes on the body's shape [m].
    """

    row: IntArray
    tip: int
    axis: FloatArray
    reach: float


@dataclass(frozen=True)
class Grafted:
    """A part, fitted to the row.

    Args:
        mesh: The part, with its colours.
        own: How much each vertex is the part's own, 0 at the row to 1 beyond the reach, shape (V,).
    """

    mesh: TriangleMesh
    own: FloatArray


def beyond(mesh: TriangleMesh, seat: Seat) -> NDArray[np.bool_]:
    """Return which vertices lie beyond the row: those that are connected to the tip without it, shape (V,)."""
    links = edges(mesh)
    links = links[~np.isin(links, seat.row).any(axis=1)]
    count = len(mesh.vertices)
    _, piece = connected_components(coo_matrix((np.ones(len(links)), links.T), (count, count)), directed=False)
    return np.asarray(piece == piece[seat.tip])


def fit_part(body: TriangleMesh, seat: Seat, part: TriangleMesh, tip: int) -> Grafted:
    """Cut a part off beyond the row and bring its rim onto the body.

    Args:
        body: The whole body [m].
        seat: Where.
        part: The other mesh, placed where the part is to be [m].
        tip: One of its vertices that belongs to the part.

    Raises:
        AvatarError: the part does not reach across the row.
    """
    ring = body.vertices[seat.row]
    origin = ring.mean(axis=0)
    gap = _GAP * float(np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1).mean())
    cut = _piece_at(clip_to_positive(part, (part.vertices - origin) @ seat.axis - gap), part.vertices[tip])
    rims = boundary_loops(cut)
    if not rims:
        raise AvatarError("a part of the lifelike body does not reach down to the avatar's", hint="report the avatar")
    rim = max(rims, key=len)
    own_face = np.asarray(beyond(body, seat)[body.faces].any(axis=1))
    outline = plane_section(body, origin + gap * seat.axis, seat.axis, own_face).points
    frame = _across(seat.axis)
    to_rim, to_outline = (cut.vertices[rim] - origin) @ frame.T, (outline - origin) @ frame.T
    angle, (around, radius) = np.arctan2(*to_rim.T[::-1]), _polar(to_outline)
    wanted = np.interp(angle, around, radius, period=2 * np.pi)
    place = np.stack([wanted * np.cos(angle), wanted * np.sin(angle)], axis=1)
    away = distance_from(cut, rim, 2 * seat.reach)
    move = np.zeros_like(cut.vertices)
    move[rim] = (place - to_rim) @ frame
    free = away < seat.reach
    free[rim] = False
    move = extend_smoothly(cut, move, free, order=2)
    # next to the row it lies on the body; then once more, from there on
    near = (away < _ON_BODY * seat.reach) & free
    on_body = closest_points(cut.vertices[near] + move[near], body.vertices, body.faces[own_face])[1]
    move[near] = on_body - cut.vertices[near]
    move = extend_smoothly(cut, move, free & ~near, order=2)
    share = np.clip(away / seat.reach, 0.0, 1.0)
    return Grafted(TriangleMesh(cut.vertices + move, cut.faces, cut.colors), share * share * (3 - 2 * share))


def strip(vertices: FloatArray, one: IntArray, other: IntArray, axis: FloatArray) -> IntArray:
    """Return the triangles between two loops round an axis, shape (N + M, 3).

    Args:
        vertices: Of both [m], shape (V, 3).
        one: A boundary loop of a surface, as its faces run along it, shape (N,).
        other: One of the surface on its other side, shape (M,).
        axis: About which both run, shape (3,).
    """
    middle, frame = vertices[one].mean(axis=0), _across(axis)

    def turned(loop: IntArray) -> FloatArray:
        return np.arctan2(*((vertices[loop] - middle) @ frame.T).T[::-1])

    back = other[::-1]
    sense = 1.0 if _winding(turned(one)) > 0 else -1.0
    start = int(np.argmin(np.abs(np.angle(np.exp(1j * (turned(back) - turned(one)[0]))))))
    back = np.roll(back, -start)
    first, second = (_unrolled(sense * turned(loop)) for loop in (one, back))
    second += first[0] + np.angle(np.exp(1j * (second[0] - first[0]))) - second[0]
    faces, i, j = [], 0, 0
    while i < len(one) or j < len(back):
        a, b = one[i % len(one)], back[j % len(back)]
        if j == len(back) or (i < len(one) and first[i] + first[i + 1] < second[j] + second[j + 1]):
            i += 1
            faces.append((one[i % len(one)], a, b))
        else:
            j += 1
            faces.append((a, b, back[j % len(back)]))
    return np.array(faces, dtype=np.int32)


def _winding(angle: FloatArray) -> float:
    return float(np.angle(np.exp(1j * (np.roll(angle, -1) - angle))).sum())


def _unrolled(angle: FloatArray) -> FloatArray:
    """Return angles round a loop that never fall, with that of the way back to its first, shape (N + 1,)."""
    step = np.angle(np.exp(1j * np.diff(np.append(angle, angle[0]))))
    return np.maximum.accumulate(angle[0] + np.concatenate([[0.0], np.cumsum(step)]))


def _piece_at(mesh: TriangleMesh, point: FloatArray) -> TriangleMesh:
    """Return the piece of a mesh that has a vertex at a point, with the pieces that lie inside it, such as eyes."""
    count, label = face_components(mesh)
    at = int(np.argmin(np.linalg.norm(mesh.vertices - point, axis=1)))
    main = label[np.flatnonzero((mesh.faces == at).any(axis=1))[0]]
    points = mesh.vertices[np.unique(mesh.faces[label == main])]
    low, high = points.min(axis=0), points.max(axis=0)
    keep = [
        piece
        for piece in range(count)
        if piece == main or (_closed(mesh, label == piece) and _within(mesh, label == piece, low, high))
    ]
    return submesh(mesh, np.isin(label, keep))[0]


def _closed(mesh: TriangleMesh, faces: NDArray[np.bool_]) -> bool:
    return not boundary_loops(submesh(mesh, faces)[0])


def _within(mesh: TriangleMesh, faces: NDArray[np.bool_], low: FloatArray, high: FloatArray) -> bool:
    points = mesh.vertices[np.unique(mesh.faces[faces])]
    return bool((points >= low).all() and (points <= high).all())


def _across(axis: FloatArray) -> FloatArray:
    """Return two unit vectors across an axis and each other, shape (2, 3)."""
    across: FloatArray = np.linalg.svd(axis[None])[2][1:]
    return across


def _polar(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return angles, rising, and radii of points of a plane."""
    angle = np.arctan2(points[:, 1], points[:, 0])
    order = np.argsort(angle, kind="stable")
    return angle[order], np.linalg.norm(points, axis=1)[order]
