"""Fillings of scan holes lifted off the mannequin: cloth was there, and cloth is never inside.

A smooth filling over a shoulder that was not seen cuts through it. It is let relax, as a thin plate, while the
mannequin grows into it from within (an obstacle problem; Glowinski 1984). What then still runs through the mannequin is
no hole: a limb comes out there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import diags
from scipy.sparse.linalg import splu

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.bare_parts import BareParts
from vto_pipeline.geometry.laplace import bending, extend_smoothly
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_loops, face_components, submesh
from vto_pipeline.model.arrays import FloatArray
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
LEFT_INSIDE = 0.005
"""Lifted triangles cut a curved mannequin by no more [m]."""
HINT = "take more photos of that place, from above or below; are scan and mannequin aligned?"


def lift_fillings(
    mesh: TriangleMesh, filled: NDArray[np.bool_], distance: SurfaceDistance, least: float
) -> tuple[TriangleMesh, NDArray[np.bool_]]:
    """Return the mesh with its fillings outside the mannequin, and which vertices had to be moved for that, (V,).

    They end as far off as cloth usually rests on this mannequin, and nearer only beside cloth that is.

    Args:
        mesh: A garment; other vertices stay where they are.
        filled: Which vertices no sensor saw, shape (V,).
        distance: Signed distances to the mannequin [m].
        least: Nothing that was filled is nearer than this [m].
    """
    away = distance.signed(mesh.vertices).distance
    usual = max(float(np.quantile(away[~filled], USUAL)), least)
    if not filled.any() or away[filled].min() >= usual:
        return mesh, np.zeros(len(filled), dtype=bool)
    near = filled.copy()
    for _ in range(RINGS):
        near[mesh.faces[near[mesh.faces].any(axis=1)]] = True
    patch, source = submesh(mesh, np.asarray(near[mesh.faces].all(axis=1)))
    free = filled[source]
    nearest = np.clip(away[source], least, usual)[:, None]
    nearest = np.maximum(extend_smoothly(patch, nearest, free, order=1)[:, 0], least)
    vertices = mesh.vertices.copy()
    vertices[source] = _relaxed(patch, free, distance, nearest)
    return TriangleMesh(vertices, mesh.faces, mesh.colors), filled & (away < usual)


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
    lowest = float((distance.signed(points[free]).distance - nearest[free]).min())
    for step in range(GROWTH + AT_REST):
        if inner.any():
            points[inner] = factor.solve(inertia[inner, None] * points[inner] - held @ points[beside])
        wanted = nearest[free] + min(0.0, lowest * (1.0 - (step + 1) / GROWTH))
        near = distance.signed(points[free])
        outward = (points[free] - near.point) / np.where(near.distance == 0.0, 1.0, near.distance)[:, None]
        points[free] += np.maximum(wanted - near.distance, 0.0)[:, None] * outward
    return points


def check_lifted(
    before: TriangleMesh,
    after: TriangleMesh,
    filled: NDArray[np.bool_],
    distance: SurfaceDistance,
    bare: BareParts | None,
) -> None:
    """Refuse fillings that a part of the mannequin goes through: what was filled is an opening, or holds one.

    Args:
        before, after: The garment before and after its fillings were lifted.
        filled: Which vertices no sensor saw, shape (V,).
        distance: Signed distances to the mannequin [m].
        bare: What was seen of the bare mannequin, if it is known.

    Raises:
        GarmentError: one still runs through the mannequin, or was lifted over a part that was seen bare.
    """
    faces = np.flatnonzero(filled[after.faces].any(axis=1))
    if len(faces) == 0:
        return
    middle = after.vertices[after.faces[faces]].mean(axis=1)
    inside = distance.signed(middle).distance
    if inside.min() < -LEFT_INSIDE:
        raise GarmentError(
            f"a filled hole runs through the mannequin at {_place(middle[int(np.argmin(inside))])}, "
            f"{-1e3 * inside.min():.0f} mm inside: too little was seen beside an opening",
            hint=HINT,
        )
    if bare is None:
        return
    first = distance.signed(before.vertices[before.faces[faces]].mean(axis=1)).distance
    count, piece = face_components(TriangleMesh(after.vertices, after.faces[faces]))
    for hole in range(count):
        mine = piece == hole
        if first[mine].min() < -DEEP and np.mean(bare.under(middle[mine])) > BARE:
            raise GarmentError(
                f"a filled hole at {_place(middle[mine].mean(axis=0))} covers mannequin that was seen bare, and was "
                f"{-1e3 * first[mine].min():.0f} mm inside it: too little was seen beside an opening",
                hint=HINT,
            )


def _place(point: FloatArray) -> str:
    return f"({point[0]:.2f}, {point[1]:.2f}, {point[2]:.2f}) m"
