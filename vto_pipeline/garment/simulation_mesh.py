"""From any garment mesh to the simulation mesh: repaired, in even triangles, each piece separately."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from vto_pipeline.errors import GarmentError
from vto_pipeline.geometry.intersections import self_intersections
from vto_pipeline.geometry.remeshing.holes import fill_holes
from vto_pipeline.geometry.remeshing.remesh import SAME_RIM, RemeshConfig, edge_lengths, remesh
from vto_pipeline.geometry.remeshing.repair import RepairConfig, is_manifold, is_oriented, repair
from vto_pipeline.geometry.remeshing.rims import perimeter
from vto_pipeline.geometry.topology import (
    boundary_loops,
    boundary_walks,
    component_areas,
    concatenate,
    face_components,
    half_edges,
    submesh,
    surface_area,
)
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config

_ACROSS = 3.0  # edges that a strap is wide at least: it needs finer triangles than the cloth it holds
_TRIES = 3  # each with half the edge of the one before
_LEAST_EDGE_MM = 1.0  # the remesher's
_CUT_SHORT = 0.15  # of a piece's area: chords take a few per cent, and folds tighter than the edges much more
_IN_CORNERS = 0.5  # of the least angle, in a panel: sharp corners of its outline make sharp triangles
_PINHOLE = 3.0  # edges around: what triangles of that size cannot go round, and no limb goes through


class SimulationMeshConfig(Config):
    """How fine the simulation mesh is."""

    edge_mm: float = Field(10.0, ge=2, le=100, description="Target edge length [mm]")
    tolerance: float = Field(
        0.2, ge=0, le=1, description="A piece whose median edge differs by less may be used as it is"
    )
    least_angle_deg: float = Field(20.0, ge=0, le=60, description="A piece with sharper triangles is remeshed [degree]")
    least_piece: float = Field(
        4.0,
        ge=0,
        le=1000,
        description="Pieces smaller than so many squares of the target edge are dropped, as buttons are. So are those "
        "that fit in a box of four: they would fall off",
    )


def remesh_for_simulation(
    garment: TriangleMesh, config: SimulationMeshConfig, job: Job, laid: FloatArray | None = None
) -> TriangleMesh:
    """Return the garment in near-equilateral triangles of the wanted size, its pieces and their openings kept.

    A piece that is good enough is used as it is, one too narrow for such triangles is given finer ones, and one that
    no size suits stays as it was. Pieces too small to be cloth are dropped. All of it is reported.

    Args:
        garment: Any triangles [m].
        config: Settings.
        job: Receives what was done.
        laid: Corners of its triangles in the panels that it was sewn from, shape (F, 3, 2) [m]. They are judged there:
            that is their shape without forces, and other triangles would lie across the seams.

    Raises:
        InputError: no face has an area.
    """
    usable = is_manifold(garment) and is_oriented(garment)
    sound = garment if usable else repair(garment, RepairConfig(), job)
    pieces = list(_pieces(sound, config, job))
    corners = laid if sound is garment else None
    made = []
    for k, (piece, own) in enumerate(pieces):
        job.progress(k / len(pieces), "remeshing")
        made.append(_remesh_piece(piece, config, job, None if corners is None else corners[own]))
    kept = all(one is piece for one, (piece, _) in zip(made, pieces, strict=True))
    if kept and len(pieces) == face_components(sound)[0]:
        return sound
    whole = concatenate(made)
    length = 1e3 * edge_lengths(whole)
    change = _figure(job, "opening_change")
    if change > SAME_RIM:
        job.warn(f"an opening is {change:.0%} longer or shorter than the garment's: smaller edges (edge_mm) follow it")
    job.measure(
        pieces=len(made),
        vertices=len(whole.vertices),
        faces=len(whole.faces),
        edge_median_mm=float(np.median(length)),
        edge_p5_mm=float(np.percentile(length, 5)),
        edge_p95_mm=float(np.percentile(length, 95)),
    )
    return whole


def reason_to_skip_remeshing(
    mesh: TriangleMesh, config: SimulationMeshConfig, laid: FloatArray | None = None
) -> str | None:
    """Return why a mesh can be simulated as it is, or None; laid: corners of its triangles in panels, (F, 3, 2) [m]."""
    if not is_manifold(mesh):
        return None
    median = float(np.median(edge_lengths(mesh))) * 1e3
    if abs(median / config.edge_mm - 1.0) > config.tolerance:
        return None
    corners, share = (mesh.vertices[mesh.faces], 1.0) if laid is None else (laid, _IN_CORNERS)
    sharpest = float(np.rad2deg(least_angles(corners).min()))
    if sharpest < share * config.least_angle_deg:
        return None
    return f"edges are {median:.1f} mm at the median and no angle is below {sharpest:.0f}°: used as it is"


def least_angles(corners: FloatArray) -> FloatArray:
    """Return the least angle of triangles (F, 3, D) [rad], shape (F,); zero for one without area."""
    side = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    a, b, c = np.sort(side, axis=1).T  # the least angle lies opposite the shortest side
    cosine = (b**2 + c**2 - a**2) / np.maximum(2.0 * b * c, 1e-30)
    return np.where(b > 0.0, np.arccos(np.clip(cosine, -1.0, 1.0)), 0.0)


def _pieces(
    mesh: TriangleMesh, config: SimulationMeshConfig, job: Job
) -> Iterator[tuple[TriangleMesh, NDArray[np.bool_]]]:
    """Yield the pieces that are cloth and their faces, in the order of these; the largest always is."""
    piece, area = component_areas(mesh)
    if len(area) == 1:
        yield mesh, np.ones(len(mesh.faces), dtype=bool)
        return
    least = config.least_piece * (1e-3 * config.edge_mm) ** 2
    longest = np.array([np.ptp(mesh.vertices[mesh.faces[piece == k]], axis=(0, 1)).max() for k in range(len(area))])
    small = ((area < least) | (longest < 2.0 * np.sqrt(least))) & (area < area.max())
    if small.any():
        lost = f"{1e4 * float(area[small].sum()):.1f} cm² in all"
        squares = f"{config.least_piece:g} squares of the target edge"
        job.note(f"dropped {int(small.sum())} of {len(area)} pieces smaller than {squares}, or in a small box: {lost}")
    for k in np.flatnonzero(~small):
        yield submesh(mesh, piece == k)[0], piece == k


def _remesh_piece(piece: TriangleMesh, config: SimulationMeshConfig, job: Job, laid: FloatArray | None) -> TriangleMesh:
    """Return a piece in even triangles; laid: corners of those that it has in panels, (F, 3, 2) [m]."""
    reason = reason_to_skip_remeshing(piece, config, laid)
    if reason and not job.force_all:
        job.leave_out("remeshing", reason)
        return piece
    edge = min(config.edge_mm, 1e3 * _width(piece) / _ACROSS)
    if edge < config.edge_mm:
        job.note(f"a piece of {len(piece.faces)} faces is narrow: its edges become {max(edge, _LEAST_EDGE_MM):.1f} mm")
    for k in range(_TRIES):
        tried = Job()
        wanted = max(0.5**k * edge, _LEAST_EDGE_MM)
        try:
            made = remesh(_without_pinholes(piece, 1e-3 * wanted, tried), RemeshConfig(edge_mm=wanted), tried)
        except GarmentError:
            continue
        job.notes += tried.notes
        for name in ("hausdorff_mm", "deviation_rms_mm", "opening_change"):
            job.measure(**{name: max(_figure(job, name), _figure(tried, name))})
        _warn_of_crossings(piece, made, job)
        lost = -_figure(tried, "area_change")
        if lost > _CUT_SHORT:
            job.warn(
                f"remeshing cut {lost:.0%} of a piece's cloth short: it has folds tighter than edges of {wanted:g} mm"
            )
        return made
    job.warn(f"a piece of {len(piece.faces)} faces could not be remeshed and is used as it is")
    return piece


def _warn_of_crossings(before: TriangleMesh, after: TriangleMesh, job: Job) -> None:
    """Warn where layers that lay apart cross: what is put back on the surface may meet the wrong one of a fold."""
    pairs = self_intersections(after)
    if len(pairs) == 0 or len(self_intersections(before)) > 0:
        return
    x, y, z = after.vertices[after.faces[pairs[0, 0]]].mean(axis=0)
    job.warn(
        f"remeshing made {len(pairs)} pairs of triangles cross, near ({x:.2f}, {y:.2f}, {z:.2f}). Layers lie closer "
        "there than such triangles can tell apart, and may jam; try another edge length (edge_mm)"
    )


def _without_pinholes(piece: TriangleMesh, edge: float, job: Job) -> TriangleMesh:
    """Return a piece with its eyelets and the ends of its buckles filled, but not the only opening it has.

    Raises:
        GarmentError: no filling leaves the mesh manifold.
    """
    walks = boundary_walks(piece)
    around = np.array([perimeter(piece, half_edges(piece)[walk, 0]) for walk in walks])
    small = around < _PINHOLE * edge
    if not small.any() or small.all():
        return piece
    job.note(
        f"filled {int(small.sum())} openings of {1e3 * around[small].max():.0f} mm around and less: "
        f"{_PINHOLE:g} edges of {1e3 * edge:.0f} mm cannot go round them"
    )
    return fill_holes(piece, [walk for walk, one in zip(walks, small, strict=True) if one])


def _width(piece: TriangleMesh) -> float:
    """Return how wide a strap of the same area and perimeter would be [m]; infinite without a border."""
    around = sum(perimeter(piece, loop) for loop in boundary_loops(piece))
    area = surface_area(piece)
    return 2.0 * area / around if around > 0.0 else np.inf


def _figure(job: Job, name: str) -> float:
    value = job.metrics.get(name, 0.0)
    assert isinstance(value, float)
    return value
