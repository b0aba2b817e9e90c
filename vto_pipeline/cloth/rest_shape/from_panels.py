"""Rest shape of a garment whose texture coordinates are the flat pieces of cloth it is sewn from, at true scale.

Programs of pattern makers and cloth simulators write them so (CLO, Marvelous Designer, ARCSim): a corner's texture
coordinates are where it lies in its panel. Then they are the cut, and the shape in space only is how the garment
was worn, stretched or crumpled. Charts made for painting look alike, but lie in a unit square: their scale gives them
away, or else how much they stretch, or that two pieces share a place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vto_pipeline.geometry.remeshing.flat_faces import carry_flat_faces, panel_of_faces
from vto_pipeline.geometry.topology import face_areas, laid_edge_lengths
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.units import LENGTH_M

_SCALE = 0.1  # by which the median face may be larger or smaller than its panel: worn cloth is stretched by less
_STRETCH = (0.8, 1.25)  # of cloth as it is worn, in any direction
_MOST = 0.8  # of the area has to be within that
_OVERLAP = 0.02  # of the area may share its place with other panels: less is rounding at seams and darts
_FLAT = 1e-9  # of the mean area: faces of less have no directions


class Panels(NamedTuple):
    """What texture coordinates are as panels.

    Args:
        laid: Corners of each face in the plane [m], v along the warp, shape (F, 3, 2).
        unit: Their unit in the file.
        pieces: How many there are.
        scale: Of the median face, length in space over that in the plane.
        within: Share of the area whose stretch is that of worn cloth.
        overlap: Share of the area whose place another face shares.
    """

    laid: FloatArray
    unit: str
    pieces: int
    scale: float
    within: float
    overlap: float

    @property
    def doubt(self) -> str:
        """Why they are no panels at true scale; empty if nothing speaks against it."""
        if abs(self.scale - 1.0) > _SCALE:
            return f"the median face is {self.scale:.2f} times as long as there, in {self.unit}"
        if self.within < _MOST:
            return f"only {self.within:.0%} of the cloth is stretched by no more than cloth is"
        return f"{self.overlap:.0%} of the cloth shares its place with other cloth" if self.overlap > _OVERLAP else ""


def find_panels(garment: TriangleMesh) -> Panels:
    """Return the texture coordinates of a garment in the metric unit that makes them most nearly true to scale.

    Args:
        garment: With texture coordinates [m].
    """
    assert garment.texture is not None
    area = face_areas(garment)
    flat = 0.5 * np.abs(np.linalg.det(garment.texture[:, 1:] - garment.texture[:, :1]))
    sound = (area > _FLAT * area.mean()) & (flat > _FLAT * flat.mean())
    if not sound.any():
        return Panels(garment.texture, "m", 0, np.inf, 0.0, 0.0)
    weight = area[sound]
    middle = float(np.quantile(np.sqrt(weight / flat[sound]), 0.5, weights=weight, method="inverted_cdf"))
    unit = min(LENGTH_M, key=lambda name: abs(np.log(middle / LENGTH_M[name])))
    laid = LENGTH_M[unit] * garment.texture
    stretch = _stretches(garment.vertices[garment.faces[sound]], laid[sound])
    within = (stretch[:, 0] < _STRETCH[1]) & (stretch[:, 1] > _STRETCH[0])
    shared = _share_a_place(laid[sound])
    return Panels(
        laid,
        unit,
        int(panel_of_faces(garment, laid).max()) + 1,
        middle / LENGTH_M[unit],
        float(weight[within].sum() / area.sum()),
        float(weight[shared].sum() / weight.sum()),
    )


def panels_of(garment: TriangleMesh, insist: bool, job: Job) -> Panels | None:
    """Return the texture coordinates of a garment as panels, or None where they are charts for painting.

    Args:
        garment: With texture coordinates [m].
        insist: Take them whatever they look like, at the scale of the median face where theirs is not true.
        job: Receives the doubt.
    """
    found = find_panels(garment)
    if not found.doubt:
        return found
    if not insist:
        job.note(f"texture coordinates not taken for panels: {found.doubt}; rest_shape.mode=panels takes them")
        return None
    job.warn(f"texture coordinates taken for panels, as requested, though {found.doubt}")
    return found._replace(laid=found.scale * found.laid) if abs(found.scale - 1.0) > _SCALE else found


def panels_on(mesh: TriangleMesh, garment: TriangleMesh, panels: Panels, job: Job) -> FloatArray:
    """Return the faces of a simulation mesh as they lie in the panels [m], shape (F, 3, 2).

    Args:
        mesh: Made of the garment, in the same place.
        garment: As it was given.
        panels: Its panels.
        job: Receives what they are, and how the garment is stretched as it was given.
    """
    laid = carry_flat_faces(garment, panels.laid, mesh)
    stretch = laid_edge_lengths(mesh, mesh.vertices[mesh.faces]) / laid_edge_lengths(mesh, laid) - 1.0
    low, high = np.percentile(stretch, [5, 95])
    flat = 0.5 * np.abs(np.linalg.det(laid[:, 1:] - laid[:, :1]))
    job.note(
        f"rest shape taken from the texture coordinates: they are panels at true scale ({panels.pieces} pieces, in "
        f"{panels.unit}). As given, edges are stretched by {np.median(stretch):+.1%}, most by {low:+.1%} to "
        f"{high:+.1%}. rest_shape.mode=as_scanned keeps the shape in space."
    )
    job.measure(
        panels=panels.pieces,
        cloth_m2=float(flat.sum()),
        given_stretch_median_share=float(np.median(stretch)),
        given_stretch_p95_share=float(np.percentile(np.abs(stretch), 95)),
    )
    return laid


def _stretches(corners: FloatArray, laid: FloatArray) -> FloatArray:
    """Return the largest and the least stretch of faces (F, 3, 3) from the plane (F, 3, 2), shape (F, 2)."""
    in_space, in_plane = (np.swapaxes(x[:, 1:] - x[:, :1], 1, 2) for x in (corners, laid))
    return np.asarray(np.linalg.svd(in_space @ np.linalg.inv(in_plane), compute_uv=False))


def _share_a_place(laid: FloatArray) -> NDArray[np.bool_]:
    """Return which flat faces (F, 3, 2) have their middle in another one, shape (F,)."""
    middle = laid.mean(axis=1)
    reach = np.linalg.norm(laid - middle[:, None], axis=2).max(axis=1)
    near = cKDTree(middle).query_ball_point(middle, reach)
    owner = np.repeat(np.arange(len(laid)), [len(one) for one in near])
    point = np.concatenate([np.asarray(one, dtype=np.int64) for one in near])
    owner, point = owner[owner != point], point[owner != point]
    to = laid[owner] - middle[point, None]
    turn = np.stack([np.linalg.det(to[:, [k, (k + 1) % 3]]) for k in range(3)], axis=1)
    inside = (turn > 0.0).all(axis=1) | (turn < 0.0).all(axis=1)
    shared = np.zeros(len(laid), np.bool_)
    shared[point[inside]] = True
    return shared
