"""Panels sewn: one mesh whose seams are closed, and whose texture coordinates are the panels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import Field
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.pattern.figures import seam_figures
from vto_pipeline.garment.pattern.sampling import Samples, sample_edges
from vto_pipeline.garment.pattern.triangulate import FlatPanel, triangulate_panel
from vto_pipeline.garment.pattern.where import as_it_stands, as_worn
from vto_pipeline.geometry.topology import edge_face_counts, face_components
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.pattern import Panel, Pattern
from vto_pipeline.model.settings import Config

_APART_M = 0.05  # between panels laid side by side
_MISMATCH = 0.02  # of a seam: easing in more is worth a warning


class SewConfig(Config):
    """How panels become one mesh."""

    edge_mm: float = Field(10.0, gt=0.5, lt=100.0, description="target edge length of the mesh [mm]")
    size: str = Field("", description="the size to sew; empty: the only one, or the first")


@dataclass(frozen=True)
class Sewn:
    """A sewn pattern.

    Args:
        mesh: In space where its panels are placed; seams are welded, so that edges there are as long as it comes. Its
            texture coordinates are the panels [m], v along the warp, side by side.
        panels: Names.
        panel: Which each face belongs to, shape (F,).
        frames: Where the axes of each face's panel point as it is placed, orthonormal columns, shape (F, 3, 2).
        angle: The smallest of all triangles [rad].
        in_shape: Whether it is where its cloth was worn; else its panels stand flat.
    """

    mesh: TriangleMesh
    panels: tuple[str, ...]
    panel: IntArray
    frames: FloatArray
    angle: float
    in_shape: bool = False


def sew(pattern: Pattern, config: SewConfig, job: Job) -> Sewn:
    """Triangulate the panels of a pattern and weld its seams.

    Args:
        pattern: With stitches, and with all panels placed in space.
        config: Edge length and size.
        job: Receives seams that do not match, and the figures.

    Raises:
        InputError: no such size.
        GarmentError: a panel is placed nowhere or crosses itself, or the seams make no surface.
    """
    pattern = pattern.of_size(config.size or pattern.sizes[0])
    unplaced = [panel.name for panel in pattern.panels if panel.placement is None]
    if unplaced:
        problem = f"the file does not say where panels stand in space: {', '.join(unplaced[:5])}"
        raise GarmentError(problem, hint="JSON of GarmentCode does; for others, vto pattern --plan FILE does")
    edge = 1e-3 * config.edge_mm
    samples = sample_edges(pattern, edge)
    flat = [triangulate_panel(panel, samples, edge) for panel in pattern.panels]
    for seam in seam_figures(pattern):
        if seam.share > _MISMATCH:
            job.warn(f"{seam.first} is sewn to {seam.second}, whose length differs by {1e3 * seam.mismatch:+.0f} mm")
    sewn = _welded(pattern.panels, flat, samples)
    job.measure(
        panels=len(flat),
        seams=len(pattern.stitches),
        vertices=len(sewn.mesh.vertices),
        pieces=face_components(sewn.mesh)[0],
        least_angle_deg=float(np.rad2deg(sewn.angle)),
    )
    return sewn


def _welded(panels: Sequence[Panel], flat: Sequence[FlatPanel], samples: Samples) -> Sewn:
    start = np.cumsum([0, *(len(one.points) for one in flat)])
    offset = {one.name: int(k) for one, k in zip(flat, start, strict=False)}
    named = {one.name: one for one in flat}

    def vertex(place: tuple[tuple[str, int], int]) -> int:
        (panel, edge), sample = place
        return offset[panel] + named[panel].vertex(edge, sample)

    links = np.array([[vertex(a), vertex(b)] for a, b in samples.links], dtype=np.int64).reshape(-1, 2)
    graph = coo_array((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(start[-1], start[-1]))
    count, welded = connected_components(graph, directed=False)
    places = [panel.placement for panel in panels if panel.placement is not None]
    worn = all(place.worn_at is not None for place in places)
    where = as_worn if worn else as_it_stands
    placed = np.concatenate([where(place, one.points) for place, one in zip(places, flat, strict=True)])
    sums = np.stack([np.bincount(welded, placed[:, k], count) for k in range(3)], axis=1)
    vertices = np.asarray(sums / np.bincount(welded, minlength=count)[:, None], dtype=np.float64)
    faces = welded[np.concatenate([one.faces + k for one, k in zip(flat, start, strict=False)])].astype(np.int32)
    owner = np.repeat(np.arange(len(flat), dtype=np.int32), [len(one.faces) for one in flat])
    laid = np.concatenate([place[one.faces] for place, one in zip(_side_by_side(panels, flat), flat, strict=True)])
    names = tuple(one.name for one in flat)
    _check_surface(faces, owner, names)
    mesh = TriangleMesh(vertices, faces, texture=laid)
    if (edge_face_counts(mesh)[1] > 2).any():
        raise GarmentError("the seams join more than two panels along one line", hint="sew layers one by one")
    frames = np.stack([place.rotation[:, :2] for place in places])
    return Sewn(mesh, names, owner, frames[owner], float(min(one.angles.min() for one in flat)), worn)


def _side_by_side(panels: Sequence[Panel], flat: Sequence[FlatPanel]) -> list[FloatArray]:
    """Return the points of each panel with its grain upright, beside the one before: no two panels share a place."""
    laid = []
    x = 0.0
    for panel, one in zip(panels, flat, strict=True):
        along = np.array([0.0, 1.0]) if panel.grain is None else panel.grain[1] - panel.grain[0]
        along = along / np.linalg.norm(along)
        upright = one.points @ np.array([[along[1], along[0]], [-along[0], along[1]]])
        place = upright + np.array([x - upright[:, 0].min(), 0.0])
        laid.append(place)
        x = float(place[:, 0].max()) + _APART_M
    return laid


def _check_surface(faces: IntArray, owner: IntArray, names: tuple[str, ...]) -> None:
    """Refuse faces that seams have closed up, and seams of a right side to a wrong side."""
    twice = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
    if twice.any():
        name = names[owner[np.flatnonzero(twice)[0]]]
        raise GarmentError(f"panel {name!r}: a seam closes up a triangle", hint="take shorter edges")
    directed = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2).astype(np.int64)
    keys = directed[:, 0] * (faces.max() + 1) + directed[:, 1]
    _, first, counts = np.unique(keys, return_index=True, return_counts=True)
    if (counts > 1).any():
        name = names[owner[first[np.flatnonzero(counts > 1)[0]] // 3]]
        problem = f"panel {name!r} is sewn with its right side to a wrong side, or to two others"
        raise GarmentError(problem, hint="such seams cannot be sewn yet")
