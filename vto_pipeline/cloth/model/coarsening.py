"""Coarser meshes of a garment, and transfer back to the fine one."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vto_pipeline.errors import GarmentError, InputError
from vto_pipeline.geometry.remeshing.flat_faces import carry_flat_faces
from vto_pipeline.geometry.remeshing.remesh import RemeshConfig, remesh
from vto_pipeline.geometry.riding.binding import Binding, apply, bind
from vto_pipeline.geometry.topology import surface_area
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.garment import Garment
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

_ROUNDS = 5  # of the remesher: more make no better triangles
_SHORTEST, _LONGEST = 1e-3, 0.1  # m, edges that it makes
_FEWER = 4  # times fewer vertices on the next coarser mesh: edges twice as long
_LAYERED = 0.03  # m: of longer edges, layers about an arm cannot lie clear of it and of each other


class CoarseGarment(NamedTuple):
    """A garment in fewer triangles.

    Args:
        garment: Where the fine one is, and of its rest shape.
        binding: Of the fine garment on it, at rest.
    """

    garment: Garment
    binding: Binding

    def prolong(self, positions: FloatArray) -> FloatArray:
        """Return where the fine garment's vertices are when the coarse one's are here; [m], shapes (V, 3)."""
        return apply(self.binding, positions)


def coarsen(fine: Garment, vertices: int, longest: float = _LONGEST) -> CoarseGarment:
    """Return a garment with about this many vertices.

    It is remeshed at rest, where it is smooth and clear of itself, onto the rest surface of the fine one; so both have
    the same lengths, but for chords across bends, and the same panels. Where the fine one is now is read off at the
    same places of it.

    Args:
        fine: The garment.
        vertices: How many are wanted.
        longest: Edges it may have [m].

    Raises:
        InputError: as `remesh`, or edges would be too long or too short for it; GarmentError: as `remesh`.
    """
    laid = TriangleMesh(fine.rest.positions, fine.mesh.faces)
    area = surface_area(laid)
    edge = np.sqrt(area / (vertices * np.sqrt(0.75)))  # V corners of equilateral triangles cover V √3/2 l²
    if not _SHORTEST <= edge <= longest:
        raise InputError(f"edges would be {1e3 * edge:.3g} mm, of {1e3 * _SHORTEST:.3g} to {1e3 * longest:.3g}")
    coarse = remesh(laid, RemeshConfig(edge_mm=1e3 * edge, iterations=_ROUNDS), Job())
    now = apply(bind(coarse, laid), fine.mesh.vertices)
    panels = None if fine.rest.panels is None else carry_flat_faces(laid, fine.rest.panels, coarse)
    rest = replace(fine.rest, positions=coarse.vertices, panels=panels)
    garment = Garment(TriangleMesh(now, coarse.faces), rest)
    return CoarseGarment(garment, bind(laid, coarse))


def coarser_ones(garment: Garment, most: int, job: Job) -> list[CoarseGarment]:
    """Return coarser garments, each of a quarter of the vertices of the last, until one has no more than `most`."""
    made: list[CoarseGarment] = []
    what = "coming to rest on a coarser mesh first"
    while (count := len(garment.mesh.vertices)) > most:
        try:
            made.append(coarsen(garment, count // _FEWER, _LAYERED))
        except (InputError, GarmentError) as error:
            job.leave_out(what, f"{count} vertices cannot be reduced to {count // _FEWER}: {error.problem}")
            return made
        garment = made[-1].garment
    if not made:
        job.leave_out(what, f"{count} vertices; it pays off above {most} (coarsen_above)")
    return made
