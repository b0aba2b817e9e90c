"""A start without crossings: untangled, or known crossings left alone."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.cloth.untangle import untangle
from vto_pipeline.geometry.intersections import intersecting_faces, meeting_vertices, self_intersections
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

_HOPELESS = 1.0  # places that meet for each triangle: no tangle, but cloth put into a point or a plane


class Start(NamedTuple):
    """Where a cloth starts.

    Args:
        positions: [m], shape (V, 3).
        crossings: Pairs of faces that met before, each other or the body.
        crossings_left: Pairs of faces that still do.
        crossed: Vertices of those, which are not kept from the rest of the cloth until they are free, shape (V,).
    """

    positions: FloatArray
    crossings: int
    crossings_left: int
    crossed: NDArray[np.bool_]


def find_collision_free_start(
    positions: FloatArray,
    faces: IntArray,
    rest: FloatArray,
    thickness: float,
    job: Job,
    body: TriangleMesh | None = None,
) -> Start:
    """Return the start of a cloth, moved as little as needed so that nothing crosses.

    Args:
        positions: Where it is [m], shape (V, 3).
        faces: Shape (F, 3).
        rest: Its shape without forces [m], shape (V, 3).
        thickness: Gap to leave where something was moved [m].
        job: For progress, and a warning if something is left.
        body: Where the cloth is about it, and nowhere deep inside.
    """
    mesh = TriangleMesh(positions, faces)
    pairs = left = self_intersections(mesh)
    outer = np.empty((0, 2), np.int32) if body is None else intersecting_faces(mesh, body)
    count = remaining = len(pairs) + len(outer)
    places = len(pairs) + len(np.unique(outer[:, 0]))  # a body's triangles may be fine, and many in one of the cloth
    if count > 0 and places <= _HOPELESS * len(faces):
        untangled = untangle(positions, faces, body=body, rest=rest, thickness=thickness, job=job)
        positions, left, remaining = untangled.positions, untangled.pairs, untangled.crossings_left
    elif count > 0:
        job.warn(f"{count} pairs of triangles intersect at the start; not all can be untangled before it moves")
    return Start(positions, count, remaining, meeting_vertices(left, faces, len(positions)))


def freed_of_body(
    positions: FloatArray, faces: IntArray, rest: FloatArray, thickness: float, body: TriangleMesh
) -> FloatArray | None:
    """Return the cloth moved as little as needed so that no triangle crosses the body [m], shape (V, 3).

    Args:
        positions, faces, rest, thickness, body: See `find_collision_free_start`.

    Returns:
        None where some do all the same.
    """
    start = find_collision_free_start(positions, faces, rest, thickness, Job(), body)
    if start.crossings_left > 0 and len(intersecting_faces(TriangleMesh(start.positions, faces), body)) > 0:
        return None
    return start.positions
