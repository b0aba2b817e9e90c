"""Fillings in the places where photos show them; what no photo confirms follows."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.garment.lifting import KeptOutside
from vto_pipeline.geometry.intersections import meeting_vertices, self_intersections
from vto_pipeline.geometry.laplace import extend_smoothly
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

ALONE = 4
"""So often only what crosses is doubted; then rings of faces around it, too, twice as many each time."""

LookAgain = Callable[[TriangleMesh, NDArray[np.bool_]], tuple[FloatArray, NDArray[np.bool_]]]
"""Of a garment and which of its vertices (V,) were filled: their places (V, 3), and which of these photos confirm."""


def confirm_fillings(
    mesh: TriangleMesh,
    observed: NDArray[np.bool_],
    look: LookAgain,
    distance: SurfaceDistance | None,
    least: float,
    job: Job,
) -> tuple[TriangleMesh, NDArray[np.bool_]]:
    """Move what was filled to where photos show it; the rest of each filling follows harmonically.

    Nothing comes nearer to the mannequin than it may, or than it was. What would make the surface cross itself is not
    taken as confirmed and follows, too, with more around it each time: in the end its filling stays as it was.

    Args:
        mesh: A garment, its holes filled.
        observed: Which of its vertices a sensor saw, shape (V,): they stay.
        look: Looks for the others in the photos.
        distance: Signed distances to the mannequin [m], or None.
        least: Nothing that was filled may be nearer to it [m].
        job: Receives how many vertices were confirmed, how far they moved, and the seconds.

    Returns:
        The garment; which of its vertices are observed or confirmed, shape (V,).
    """
    start = perf_counter()
    places, found = look(mesh, ~observed)
    way = places - mesh.vertices
    moved, found = moved_uncrossed(mesh, way, observed, found & ~observed, distance, least)
    found &= np.linalg.norm(moved.vertices - mesh.vertices - way, axis=1) <= least
    far = 1e3 * np.linalg.norm(way[found], axis=1) if found.any() else np.zeros(1)
    job.measure(
        filled_vertices=int((~observed).sum()),
        confirmed_vertices=int(found.sum()),
        confirmed_moved_median_mm=round(float(np.median(far)), 3),
        confirmed_moved_p95_mm=round(float(np.percentile(far, 95)), 3),
        confirmed_s=round(perf_counter() - start, 1),
    )
    return moved, observed | found


def moved_uncrossed(
    mesh: TriangleMesh,
    way: FloatArray,
    observed: NDArray[np.bool_],
    found: NDArray[np.bool_],
    distance: SurfaceDistance | None,
    least: float,
) -> tuple[TriangleMesh, NDArray[np.bool_]]:
    """Move vertices their ways, but none that makes the surface cross itself where it did not.

    Args:
        mesh: A garment, its holes filled.
        way: Of each vertex [m], shape (V, 3).
        observed: Which of them stay, shape (V,).
        found: Which others go their ways, shape (V,); the rest follows harmonically.
        distance: Signed distances to the mannequin [m], or None.
        least: What moves may not come nearer to it, or than it was [m].

    Returns:
        The garment; which of its vertices went their ways, shape (V,).
    """
    crossing, found = self_intersections(mesh), found.copy()
    for number in count():
        moved = TriangleMesh(_followed(mesh, way, observed, found, distance, least), mesh.faces, mesh.colors)
        doubted = meeting_vertices(_more(self_intersections(moved), crossing), mesh.faces, len(found))
        if not doubted.any():
            break
        for _ in range(2 ** (number - ALONE) if number >= ALONE else 0):
            doubted[mesh.faces[doubted[mesh.faces].any(axis=1)]] = True
        found &= ~doubted
    return moved, found


def _followed(
    mesh: TriangleMesh,
    way: FloatArray,
    observed: NDArray[np.bool_],
    found: NDArray[np.bool_],
    distance: SurfaceDistance | None,
    least: float,
) -> FloatArray:
    """Places of all vertices (V, 3) once those found went their way and the rest followed, outside the mannequin."""
    way = extend_smoothly(mesh, np.where(found[:, None], way, 0.0), ~(observed | found), order=1)
    moves = np.any(way != 0.0, axis=1)
    places = mesh.vertices + way
    if distance is not None and moves.any():
        outside = KeptOutside(distance, mesh.vertices[moves])
        places[moves] = outside.pushed(places[moves], np.minimum(outside.least, least))
    return places


def _more(pairs: IntArray, before: IntArray) -> IntArray:
    """Pairs of faces that were not among those before, shape (K, 2)."""
    known = set(map(tuple, before.tolist()))
    return pairs[np.array([tuple(pair) not in known for pair in pairs.tolist()], dtype=bool)]
