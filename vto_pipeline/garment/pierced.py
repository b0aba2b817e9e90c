"""Fillings that a part of the mannequin comes through: they hold an opening, and are opened there.

Where the cloth beside an opening was not seen, the opening and the hole beside it are one loop, and it looks like
neither. A filling over it spans the arm or the neck that comes out. What is inside the mannequin is no cloth; nor is,
from there on, what stands across to it or covers mannequin that was seen bare. What is left goes on as the cloth does.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.garment.bare_parts import BareParts
from vto_pipeline.garment.lifting import Pierced
from vto_pipeline.garment.rims import LEDGE_COSINE, reached
from vto_pipeline.geometry.remeshing.clip import clip_to_positive
from vto_pipeline.geometry.remeshing.repair import RepairConfig, repair
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_loops, face_components, face_normals, submesh
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh


def open_pierced(
    filled: TriangleMesh,
    seen: int,
    pierced: Sequence[Pierced],
    mannequin: TriangleMesh,
    bare: BareParts | None,
    least: float,
    job: Job,
) -> TriangleMesh:
    """Return a garment without what its pierced fillings have in the mannequin, across to it, or over bare parts of it.

    Args:
        filled: The garment before its fillings were lifted.
        seen: Its first faces that no filling made: they come first again.
        pierced: Its fillings that a part of the mannequin goes through.
        mannequin: In the same frame.
        bare: What was seen of the bare mannequin, if it is known.
        least: Cloth is at least so far from the mannequin [m].
        job: Receives what was repaired.
    """
    distance = SurfaceDistance(mannequin)
    own = np.zeros(len(filled.vertices), dtype=bool)
    own[filled.faces[np.concatenate([one.faces for one in pierced])]] = True
    own[filled.faces[:seen]] = False
    beyond = distance.signed(filled.vertices).distance - least
    deepest = -float(beyond[own].min(initial=-least))
    beyond[~own] = deepest  # so far from zero that no cut moves to them
    opened = clip_to_positive(filled, beyond)
    opened = _joined(opened, ~_no_cloth(opened, seen, mannequin, distance, bare), seen)
    return repair(opened, RepairConfig(weld_mm=0.0), job)


def _no_cloth(
    mesh: TriangleMesh, seen: int, mannequin: TriangleMesh, distance: SurfaceDistance, bare: BareParts | None
) -> NDArray[np.bool_]:
    """Return which faces lead from a cut to where they stand no more across to the mannequin, nor cover bare parts."""
    made = np.arange(len(mesh.faces)) >= seen
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    nearest = distance.nearest(middle)
    facing = np.einsum("fd,fd->f", face_normals(mesh), face_normals(mannequin)[nearest.face])
    doubtful = made & (facing < LEDGE_COSINE)
    if bare is not None:
        doubtful |= made & bare.under(middle)
    cut = np.zeros(len(mesh.vertices), dtype=bool)
    loops = boundary_loops(mesh)
    cut[np.concatenate(loops)] = True
    cut[mesh.faces[:seen]] = False
    return reached(mesh, doubtful, doubtful & cut[mesh.faces].any(axis=1))


def _joined(mesh: TriangleMesh, keep: NDArray[np.bool_], seen: int) -> TriangleMesh:
    """Return the kept faces that are connected with the first of the mesh, which are all kept."""
    kept = submesh(mesh, keep)[0]
    _, piece = face_components(kept)
    return submesh(kept, np.isin(piece, piece[:seen]))[0]
