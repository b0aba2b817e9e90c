"""A garment in space back to the sewing pattern it was made from: cut along its seams, each piece laid flat."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from vto_pipeline.garment.unsewn.cut import Bools, Piece, Run, cut_apart, runs
from vto_pipeline.garment.unsewn.flatten import flat_areas, flatten, stretches
from vto_pipeline.garment.unsewn.names import panel_names
from vto_pipeline.garment.unsewn.outline import crosses_itself, sharp_corners, smoothed
from vto_pipeline.garment.unsewn.rims import Rims
from vto_pipeline.geometry.topology import edges, face_areas
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.pattern import Edge, Panel, Pattern, Placement, Side, Stitch

_APART_M = 0.05  # between panels laid side by side
_KEPT_M = 0.015  # of a panel, inside its outline: squares of which one point is kept with where it was worn
_ROUNDED = 4  # digits after the point of those, a tenth of a millimetre
_MUCH = 0.05  # stretch left in a twentieth of a panel that a dart or another seam would take out


@dataclass(frozen=True)
class FlatPiece:
    """How a piece went flat.

    Args:
        name: Of the panel.
        area: Of the panel's outline [m²].
        area_in_space: Of the piece [m²].
        stretch: Median and 95th percentile over the area of how far a principal stretch from panel to space is from 1.
        length_error: 95th percentile of how much edges of the mesh have changed their length [m].
    """

    name: str
    area: float
    area_in_space: float
    stretch: tuple[float, float]
    length_error: float


@dataclass(frozen=True)
class Unsewn:
    """A garment that was taken apart.

    Args:
        pattern: Its panels side by side, their warp along y, placed in space where they came from.
        pieces: How each panel went flat.
        mesh: The garment, its texture coordinates the panels [m].
    """

    pattern: Pattern
    pieces: tuple[FlatPiece, ...]
    mesh: TriangleMesh


def unsew(
    mesh: TriangleMesh,
    seam: IntArray,
    warp: FloatArray,
    fabric: Fabric,
    rims: Rims | None,
    noise: float,
    name: str,
    job: Job,
) -> Unsewn:
    """Cut a garment along its seams and lay the pieces flat.

    Args:
        mesh: The garment [m], manifold and oriented, +Y up, +Z the front.
        seam: Which line each half-edge is on, both sides of each seam, shape (3F,); -1: none. Along one line, nothing
            is taken for a corner: where cloth is gathered, it lies flat with a wavy edge.
        warp: Which way the warp runs in each face, shape (F, 3); zero: unknown.
        fabric: Which stretch is taken first.
        rims: Its openings, if they tell its type: panels are named after them.
        noise: Standard deviation of vertices along the outlines that is not to be in the panels [m].
        name: Of the pattern.
        job: Receives panels that a dart would do good, and outlines that cross themselves.

    Raises:
        GarmentError: a piece is no disc, or cannot be laid flat.
    """
    pieces = cut_apart(mesh, seam >= 0)
    flat = []
    for number, piece in enumerate(pieces):
        job.progress(number / len(pieces), f"laying piece {number + 1} of {len(pieces)} flat")
        flat.append(flatten(piece.mesh, warp[piece.face], fabric))
    flat = _side_by_side(flat)
    names = panel_names(pieces, rims)
    sharp = [_corners(piece, x, seam) for piece, x in zip(pieces, flat, strict=True)]
    found = runs(mesh, pieces, sharp)
    panels = tuple(
        _panel(names[k], piece, flat[k], [run for run in found if run.piece == k], noise)
        for k, piece in enumerate(pieces)
    )
    texture = np.zeros((len(mesh.faces), 3, 2))
    for piece, x in zip(pieces, flat, strict=True):
        texture[piece.face] = x[piece.mesh.faces]
    figures = tuple(_figures(panel, piece, x) for panel, piece, x in zip(panels, pieces, flat, strict=True))
    _tell(figures, panels, job)
    whole = TriangleMesh(mesh.vertices, mesh.faces, texture=texture)
    return Unsewn(Pattern(name, panels, _stitches(found, names), worn=True), figures, whole)


def _corners(piece: Piece, flat: FloatArray, seam: IntArray) -> Bools:
    line = seam[piece.outline]
    inside = (line >= 0) & (line == np.roll(line, 1))
    return sharp_corners(flat[piece.start]) & ~inside


def _panel(name: str, piece: Piece, flat: FloatArray, own: Sequence[Run], noise: float) -> Panel:
    count = len(piece.start)
    outline = [
        Edge("polyline", smoothed(flat[piece.start[np.arange(run.first, run.first + run.count + 1) % count]], noise))
        for run in own
    ]
    grain = flat.mean(axis=0) + 0.25 * np.ptp(flat[:, 1]) * np.array([[0.0, -1.0], [0.0, 1.0]])
    return Panel(name, tuple(outline), grain=grain, placement=_placement(piece, flat))


def _placement(piece: Piece, flat: FloatArray) -> Placement:
    """Return where a panel is nearest to the piece it came from, and where points of it were: its folds in short."""
    space = piece.mesh.vertices
    upright = np.column_stack([flat, np.zeros(len(flat))])
    turn, _ = Rotation.align_vectors(space - space.mean(axis=0), upright - upright.mean(axis=0))
    rotation = turn.as_matrix()
    inside = np.unique(np.floor(flat / _KEPT_M), axis=0, return_index=True)[1]
    kept = np.union1d(piece.start, inside)
    worn_at = np.round(np.column_stack([flat, space])[kept], _ROUNDED)
    return Placement(rotation, space.mean(axis=0) - rotation @ upright.mean(axis=0), worn_at)


def _stitches(found: Sequence[Run], names: Sequence[str]) -> tuple[Stitch, ...]:
    number: dict[int, int] = {}
    count: dict[int, int] = {}
    for k, run in enumerate(found):
        number[k] = count.get(run.piece, 0)
        count[run.piece] = number[k] + 1
    return tuple(
        Stitch((Side(names[run.piece], number[k]),), (Side(names[found[run.sewn].piece], number[run.sewn], False),))
        for k, run in enumerate(found)
        if run.sewn > k
    )


def _side_by_side(flat: Sequence[FloatArray]) -> list[FloatArray]:
    laid, x = [], 0.0
    for one in flat:
        laid.append(one - one.min(axis=0) + [x, 0.0])
        x = float(laid[-1][:, 0].max()) + _APART_M
    return laid


def _figures(panel: Panel, piece: Piece, flat: FloatArray) -> FlatPiece:
    area = face_areas(piece.mesh)
    off = np.abs(stretches(piece.mesh, flat) - 1.0).max(axis=1)
    middle, most = (float(np.quantile(off, q, weights=area, method="inverted_cdf")) for q in (0.5, 0.95))
    a, b = edges(piece.mesh).T
    lengths = [np.linalg.norm(x[a] - x[b], axis=1) for x in (flat, piece.mesh.vertices)]
    error = float(np.percentile(np.abs(lengths[0] - lengths[1]), 95))
    return FlatPiece(
        panel.name, float(flat_areas(flat, piece.mesh.faces).sum()), float(area.sum()), (middle, most), error
    )


def _tell(figures: Sequence[FlatPiece], panels: Sequence[Panel], job: Job) -> None:
    for one, panel in zip(figures, panels, strict=True):
        if one.stretch[1] > _MUCH:
            job.warn(
                f"panel {one.name}: where it is worst, {one.stretch[1]:.1%} of stretch is left; a dart or another seam "
                "would take it out"
            )
        if crosses_itself(np.concatenate([edge.points[:-1] for edge in panel.edges])):
            job.warn(f"panel {one.name}: its outline crosses itself, so it cannot be cut from one layer of cloth")
    job.measure(
        panels=len(figures),
        cloth_m2=sum(one.area for one in figures),
        cloth_in_space_m2=sum(one.area_in_space for one in figures),
        stretch_p95_share=max(one.stretch[1] for one in figures),
    )
