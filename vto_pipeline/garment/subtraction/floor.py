"""What a scan shows beside what is worn: the floor, and boards or tables that lie about."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.geometry.floor import find_floor
from vto_pipeline.geometry.topology import component_areas, face_area_vectors, submesh
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

LEVEL, ROUGH = 0.5, 0.02
"""Seen from above, a board or a table that lies beside the mannequin shows more than this share of its area: the noise
of a depth camera makes the area half as large again. Its height differs by less than this share of its side (standard
deviation)."""


def not_worn(surface: TriangleMesh, below: float, sigma: float, job: Job) -> NDArray[np.bool_]:
    """Return which vertices lie on or under the floor or on what lies about, shape (V,).

    Args:
        surface: The scan, +Y up [m].
        below: Height that the floor is not above [m].
        sigma: Noise of the scan near the mannequin [m]; that of the floor, which lies farther off, is measured.
        job: Receives both.
    """
    lying = _lying(surface, job)
    floor = find_floor(surface, below)
    if floor is None:
        job.leave_out("floor", "no level surface lies under the mannequin")
        return lying
    job.measure(floor_mm=floor.height * 1e3, floor_noise_mm=floor.noise * 1e3)
    return lying | (surface.vertices[:, 1] < floor.height + 3.0 * max(sigma, floor.noise))


def _lying(surface: TriangleMesh, job: Job) -> NDArray[np.bool_]:
    """Return which vertices belong to a level piece beside the largest, as a board on a table, shape (V,): cloth that
    is worn hangs."""
    piece, area = component_areas(surface)
    lying = np.zeros(len(surface.vertices), dtype=bool)
    for k in np.flatnonzero(np.arange(len(area)) != np.argmax(area)):
        one, source = submesh(surface, piece == k)
        lying[source] = is_level(one, job)
    return lying


def is_level(piece: TriangleMesh, job: Job) -> bool:
    """Return whether a piece of a scan lies level, as nothing does that is worn, and note it.

    Args:
        piece: +Y up [m].
        job: Receives its area and height.
    """
    upward = face_area_vectors(piece)
    size = np.linalg.norm(upward, axis=1)
    height = piece.vertices[piece.faces, 1].mean(axis=1)
    middle = np.average(height, weights=size)
    rough = np.sqrt(np.average(np.square(height - middle), weights=size))
    level = bool(rough < ROUGH * np.sqrt(size.sum()) and abs(upward[:, 1].sum()) > LEVEL * size.sum())
    if level:
        what = f"a level piece of {1e4 * size.sum():.0f} cm² at a height of {1e3 * middle:.0f} mm"
        job.note(f"left out {what}: cloth that is worn hangs")
    return level
