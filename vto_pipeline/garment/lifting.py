"""Fillings of scan holes where the mannequin says they can be: never inside it, nor far off where cloth is near.

A smooth filling over a shoulder that was not seen cuts through it. It is let relax, as a thin plate, while the
mannequin grows into it from within (an obstacle problem; Glowinski 1984). Triangles that are stretched over a bulge cut
it, and are split. What then still runs through the mannequin is no hole: a limb comes out there, and however finely a
filling is split, it spans the limb.

A smooth filling under an arm spans the armpit as a web. Slope and curvature of cloth tell little of it a fold's width
away. There cloth is about as far from the mannequin as around the hole, and a filling that is farther is drawn in.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import diags
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.bare_parts import BareParts
from vto_pipeline.geometry.laplace import bending, extend_smoothly
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import (
    boundary_loops,
    corners_from,
    face_components,
    half_edges,
    opposite_half_edges,
    submesh,
)
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

USUAL = 0.1
"""Where cloth rests on the mannequin it is about as far off as this share of all that was seen of it is at most."""
RINGS = 3
"""Rings of faces around a filling that give it its slope and curvature."""
STIFFNESS = 0.03
"""In one step of relaxing, what is wider than this hardly moves [m]."""
GROWTH, AT_REST = 24, 12
"""Steps while the mannequin grows, and after."""
DEEP = 0.025
"""A filling that came so deep inside may not be lifted over what was seen bare [m]."""
BARE = 0.2
"""A larger share of it over mannequin that was seen bare, and a part of the mannequin comes out there."""
CONTINUES = 0.02
"""So far from what was seen, how cloth goes on there says as much of it as the mannequin does: a quarter of a wide fold
[m]."""
HANGS = (0.04, 0.06)
"""Cloth so far off the mannequin begins to hang free, and hangs free: then the mannequin says nothing of it [m]."""
LEFT_INSIDE = 0.005
"""Lifted triangles cut a curved mannequin by no more [m]."""
STRETCHED = 4.0
"""Edges so many times as long as they usually are in fillings are stretched: in between, nothing was looked at."""
SPLITS = 8
"""Rounds in which edges that are stretched or cut the mannequin are halved; each takes three quarters of its depth."""
LITTLE_SEEN = "too little was seen beside an opening"
HINT = "take more photos of that place, from above or below; are scan and mannequin aligned?"


class Lifted(NamedTuple):
    """A garment whose fillings were lifted. Its vertices and faces come first, in their order; then those of splits.

    Args:
        before: As it was, with the same splits.
        after: Its fillings outside the mannequin.
        filled: Which vertices no sensor saw, shape (V,).
        moved: Which of them were too near and had to be moved, shape (V,).
        whole: How many faces there were before splits.
    """

    before: TriangleMesh
    after: TriangleMesh
    filled: NDArray[np.bool_]
    moved: NDArray[np.bool_]
    whole: int


def lift_fillings(mesh: TriangleMesh, filled: NDArray[np.bool_], distance: SurfaceDistance, least: float) -> Lifted:
    """Return the mesh with its fillings outside the mannequin, and where nothing near was seen, as far off as around.

    They end as far off as cloth usually rests on this mannequin, and nearer only beside cloth that is.

    Args:
        mesh: A garment; other vertices stay where they are.
        filled: Which vertices no sensor saw, shape (V,).
        distance: Signed distances to the mannequin [m].
        least: Nothing that was filled is nearer than this [m].
    """
    away = distance.signed(mesh.vertices).distance
    usual = max(float(np.quantile(away[~filled], USUAL)), least)
    if not filled.any():
        return Lifted(mesh, mesh, filled, filled, len(mesh.faces))
    lifted = Lifted(mesh, mesh, filled, filled & (away < usual), len(mesh.faces))
    if lifted.moved.any():
        lifted = _outside(lifted, away, usual, distance, least)
    return lifted._replace(after=_drawn_in(lifted.after, lifted.filled, distance, usual))


def _outside(lifted: Lifted, away: FloatArray, usual: float, distance: SurfaceDistance, least: float) -> Lifted:
    """Return the mesh with its fillings outside the mannequin, and split where they are stretched.

    Args:
        lifted: As it was.
        away: How far off the mannequin its vertices are [m], shape (V,).
        usual: How far off cloth usually rests on it [m].
        distance: Signed distances to the mannequin [m].
        least: Nothing that was filled is nearer than this [m].
    """
    mesh = lifted.before
    patch, source = _with_rings(mesh, lifted.filled)
    free = lifted.filled[source]
    nearest = np.clip(away[source], least, usual)[:, None]
    nearest = np.maximum(extend_smoothly(patch, nearest, free, order=1)[:, 0], least)
    vertices = mesh.vertices.copy()
    vertices[source] = _relaxed(patch, free, distance, nearest)
    lifted = lifted._replace(after=TriangleMesh(vertices, mesh.faces, mesh.colors))
    edge = np.linalg.norm(patch.vertices[np.roll(patch.faces, -1, axis=1)] - patch.vertices[patch.faces], axis=2)
    for _ in range(SPLITS):
        finer = _split(lifted, distance, least, STRETCHED * float(np.median(edge)))
        if len(finer.moved) == len(lifted.moved):
            break
        lifted = finer
    return lifted


def _with_rings(mesh: TriangleMesh, filled: NDArray[np.bool_]) -> tuple[TriangleMesh, IntArray]:
    """Return the fillings with some rings around them, and which vertices of the mesh these are."""
    near = filled.copy()
    for _ in range(RINGS):
        near[mesh.faces[near[mesh.faces].any(axis=1)]] = True
    return submesh(mesh, np.asarray(near[mesh.faces].all(axis=1)))


def _split(lifted: Lifted, distance: SurfaceDistance, off: float, longest: float) -> Lifted:
    """Halve the edges of fillings that are stretched or cut the mannequin, the longest first and one of each face.

    Args:
        lifted: After any number of splits.
        distance: Signed distances to the mannequin [m].
        off: How far from the mannequin the new vertices are at least [m].
        longest: Longer edges are stretched [m].
    """
    after = lifted.after
    ends, twin = half_edges(after), opposite_half_edges(after)
    own = np.repeat(lifted.filled[after.faces].any(axis=1), 3)
    half = np.flatnonzero((twin > np.arange(len(twin))) & own)
    half = half[own[twin[half]]]
    length = np.linalg.norm(after.vertices[ends[half, 1]] - after.vertices[ends[half, 0]], axis=1)
    asked, index = np.unique(ends[half], return_inverse=True)
    off_there = distance.signed(after.vertices[asked]).distance[index.reshape(-1, 2)]
    cuts = 0.5 * length > off_there.max(axis=1)  # its middle may be inside
    cuts[cuts] = distance.signed(after.vertices[ends[half[cuts]]].mean(axis=1)).distance < 0.0
    wanted = np.flatnonzero(cuts | (length > longest))
    chosen: list[int] = []
    taken: set[int] = set()
    for k in half[wanted[np.argsort(-length[wanted], kind="stable")]]:
        faces = {int(k) // 3, int(twin[k]) // 3}
        if not faces & taken:
            taken |= faces
            chosen.append(int(k))
    if not chosen:
        return lifted
    sides = np.array([chosen, twin[chosen]])
    ends = ends[chosen]
    points = after.vertices[ends].mean(axis=1)
    near = distance.signed(points)
    outward = (points - near.point) / np.where(near.distance == 0.0, 1.0, near.distance)[:, None]
    before = _halved(lifted.before, sides, lifted.before.vertices[ends].mean(axis=1))
    filled, moved = (
        np.concatenate([which, np.ones(len(chosen), dtype=bool)]) for which in (lifted.filled, lifted.moved)
    )
    points = points + np.maximum(off - near.distance, 0.0)[:, None] * outward
    return Lifted(before, _halved(after, sides, points), filled, moved, lifted.whole)


def _halved(mesh: TriangleMesh, sides: IntArray, middles: FloatArray) -> TriangleMesh:
    """Return a mesh with edges halved; what is new comes last.

    Args:
        mesh: A manifold mesh.
        sides: Both half-edges of each, no two in one face, shape (2, N).
        middles: Where they are halved [m], shape (N, 3).
    """
    corner = mesh.faces.reshape(-1)
    new = len(mesh.vertices) + np.arange(len(middles))
    faces, added = np.array(mesh.faces), []
    for side in sides:
        after, across = corner[corners_from(side)[:, 1:]].T
        faces[side // 3, (side + 1) % 3] = new  # of its two halves a face keeps the one where the half-edge starts
        added.append(np.column_stack([new, after, across]))
    ends = corner[corners_from(sides[0])[:, :2]]
    colors = mesh.colors
    if colors is not None:
        colors = np.vstack([colors, colors[ends].mean(axis=1).round().astype(np.uint8)])
    return TriangleMesh(np.vstack([mesh.vertices, middles]), np.vstack([faces, *added]).astype(np.int32), colors)


def _relaxed(
    patch: TriangleMesh, free: NDArray[np.bool_], distance: SurfaceDistance, nearest: FloatArray
) -> FloatArray:
    """Vertices of a patch (V, 3) once the free ones came to rest no nearer to the mannequin than each may, (V,)."""
    inner = free.copy()
    loops = boundary_loops(patch)
    inner[np.concatenate(loops) if loops else []] = False  # a rim is only pushed
    matrix, area = bending(patch, inner)
    inertia = area / STIFFNESS**4
    rows = matrix[inner]
    factor = splu((rows[:, inner] + diags(inertia[inner])).tocsc())
    held, beside = rows[:, ~inner], ~inner
    points = np.array(patch.vertices)
    outside = KeptOutside(distance, points[free])
    lowest = float((outside.least - nearest[free]).min())
    for step in range(GROWTH + AT_REST):
        if inner.any():
            points[inner] = factor.solve(inertia[inner, None] * points[inner] - held @ points[beside])
        wanted = nearest[free] + min(0.0, lowest * (1.0 - (step + 1) / GROWTH))
        points[free] = outside.pushed(points[free], wanted)
    return points


def _drawn_in(mesh: TriangleMesh, filled: NDArray[np.bool_], distance: SurfaceDistance, usual: float) -> TriangleMesh:
    """Return the mesh with its fillings no farther from the mannequin than what is around, the less was seen near them.

    The error of going on as seen cloth does grows as the square of the distance from it, for its curvature changes.

    Args:
        mesh: A garment.
        filled: Which vertices no sensor saw, shape (V,).
        distance: Signed distances to the mannequin [m].
        usual: None is drawn nearer than this [m].
    """
    patch, source = _with_rings(mesh, filled)
    free = filled[source]
    foot = distance.signed(patch.vertices)
    away = foot.distance
    around = np.maximum(extend_smoothly(patch, away[:, None], free, order=1)[:, 0], usual)
    unseen = cKDTree(patch.vertices[~free]).query(patch.vertices)[0] / CONTINUES
    share = unseen**4 / (1.0 + unseen**4) * np.interp(away, HANGS, (1.0, 0.0))
    way = np.where(free & (away > around), share * (1.0 - around / np.maximum(away, usual)), 0.0)
    vertices = mesh.vertices.copy()
    vertices[source] += way[:, None] * (foot.point - patch.vertices)
    return TriangleMesh(vertices, mesh.faces, mesh.colors)


class KeptOutside:
    """Keeps moving points off a mannequin: only those are looked up that may have come too near since they last were.

    A signed distance changes by no more than its point moves.

    Args:
        distance: Signed distances to the mannequin [m].
        points: Where they start [m], shape (N, 3).
    """

    def __init__(self, distance: SurfaceDistance, points: FloatArray) -> None:
        self.distance, self.looked_up = distance, points.copy()
        self.least = distance.signed(points).distance  # of the places looked up

    def pushed(self, points: FloatArray, wanted: FloatArray) -> FloatArray:
        """Return the points (N, 3), none nearer than wanted (N,) [m]."""
        close = self.least - np.linalg.norm(points - self.looked_up, axis=1) < wanted
        near = self.distance.signed(points[close])
        self.looked_up[close], self.least[close] = points[close], near.distance
        outward = (points[close] - near.point) / np.where(near.distance == 0.0, 1.0, near.distance)[:, None]
        moved = points.copy()
        moved[close] += np.maximum(wanted[close] - near.distance, 0.0)[:, None] * outward
        return moved


class Pierced(NamedTuple):
    """A filling that a part of the mannequin goes through.

    Args:
        faces: Of it, among those that there were before splits, shape (N,).
        reason: In words.
    """

    faces: IntArray
    reason: str


def pierced_fillings(lifted: Lifted, distance: SurfaceDistance, bare: BareParts | None) -> list[Pierced]:
    """Return the fillings that a part of the mannequin goes through: what was filled is an opening, or holds one.

    They still run through the mannequin, or were lifted over a part that was seen bare.

    Args:
        lifted: As `lift_fillings` leaves them.
        distance: Signed distances to the mannequin [m].
        bare: What was seen of the bare mannequin, if it is known.
    """
    before, after = lifted.before, lifted.after
    faces = np.flatnonzero(lifted.filled[after.faces].any(axis=1))
    if len(faces) == 0:
        return []
    middle = after.vertices[after.faces[faces]].mean(axis=1)
    inside = distance.signed(middle).distance
    first = distance.signed(before.vertices[before.faces[faces]].mean(axis=1)).distance
    count, piece = face_components(TriangleMesh(after.vertices, after.faces[faces]))
    found = []
    for hole in range(count):
        mine, whole = piece == hole, (piece == hole) & (faces < lifted.whole)
        deepest = np.flatnonzero(mine)[int(np.argmin(inside[mine]))]
        if inside[deepest] < -LEFT_INSIDE:
            through = f"runs through the mannequin at {_place(middle[deepest])}, {-1e3 * inside[deepest]:.0f} mm inside"
        elif bare is not None and first[whole].min(initial=0.0) < -DEEP and np.mean(bare.under(middle[whole])) > BARE:
            through = (
                f"at {_place(middle[whole].mean(axis=0))} covers mannequin that was seen bare, and was "
                f"{-1e3 * first[whole].min():.0f} mm inside it"
            )
        else:
            continue
        found.append(Pierced(faces[whole].astype(np.int32), f"a filled hole {through}: {LITTLE_SEEN}"))
    return found


def check_lifted(lifted: Lifted, distance: SurfaceDistance, bare: BareParts | None) -> None:
    """Refuse fillings that a part of the mannequin goes through.

    Args:
        lifted, distance, bare: As in `pierced_fillings`.

    Raises:
        GarmentError: there is one.
    """
    pierced = pierced_fillings(lifted, distance, bare)
    if pierced:
        raise GarmentError(pierced[0].reason, hint=HINT)


def _place(point: FloatArray) -> str:
    return f"({point[0]:.2f}, {point[1]:.2f}, {point[2]:.2f}) m"
