"""Clean-up of the faces of a body, so that inside and outside are defined; vertices stay unchanged."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.model.arrays import FloatArray, IntArray


class CleanFaces(NamedTuple):
    """Faces of a body after cleaning.

    Args:
        faces: Shape (F, 3).
        sealed: Whether each edge has two faces that run against each other: no hole, no rim, no branch.
        welded: Vertices that stood where another stands, and gave way to it.
        dropped: Faces with a repeated corner, or with the corners of another.
        turned: Faces oriented against most of their component.
    """

    faces: IntArray
    sealed: bool
    welded: int
    dropped: int
    turned: int

    def __str__(self) -> str:
        found = (
            (self.welded, "doubled vertices welded"),
            (self.dropped, "degenerate or doubled faces dropped"),
            (self.turned, "faces turned to agree with their neighbours"),
        )
        return ", ".join(f"{count} {what}" for count, what in found if count)


def clean_faces(keyframes: FloatArray, faces: IntArray) -> CleanFaces:
    """Return the cleaned faces of a body.

    Faces without area but with three different corners stay: to drop one would open a slit. A body that shows its
    inner side is left so: it may be a room.

    Args:
        keyframes: Where its vertices are [m], shape (K, V, 3); what coincides in all is one.
        faces: Shape (F, 3).
    """
    places = np.ascontiguousarray(keyframes.transpose(1, 0, 2).reshape(keyframes.shape[1], -1)) + 0.0  # no -0.0
    _, first, label = np.unique(places, axis=0, return_index=True, return_inverse=True)
    own = first[label.reshape(-1)]
    mended: IntArray = own[faces].astype(np.int32)
    kept = _distinct_faces(mended)
    mended = mended[kept]
    sealed, turned = _is_watertight(mended), 0
    if not sealed:
        mended, turned = _orient_components(keyframes[0], mended)
        sealed = turned > 0 and _is_watertight(mended)
    return CleanFaces(mended, sealed, int((own != np.arange(len(own))).sum()), int((~kept).sum()), turned)


def _distinct_faces(faces: IntArray) -> NDArray[np.bool_]:
    """Return which faces have three corners and are the first with them, shape (F,)."""
    corners = np.sort(faces, axis=1)
    first = np.zeros(len(faces), np.bool_)
    first[np.unique(corners, axis=0, return_index=True)[1]] = True
    return np.asarray(first & (np.diff(corners, axis=1) > 0).all(axis=1))


def _is_watertight(faces: IntArray) -> bool:
    """Return whether each half-edge runs once, and once back."""
    start, end = faces.reshape(-1).astype(np.int64), np.roll(faces, -1, axis=1).reshape(-1)
    size = int(faces.max()) + 1
    ahead, back = np.sort(start * size + end), np.sort(end * size + start)
    return bool((np.diff(ahead) > 0).all() and np.array_equal(ahead, back))


def _orient_components(vertices: FloatArray, faces: IntArray) -> tuple[IntArray, int]:
    """Return the faces, each oriented like most of its component by area, and how many were flipped."""
    import igl

    alike, piece = igl.bfs_orient(faces.astype(np.int64))
    kept = np.asarray(np.any([(alike == np.roll(faces, k, axis=1)).all(axis=1) for k in range(3)], axis=0))
    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    most_kept = np.bincount(piece, np.where(kept, area, -area)) >= 0.0
    turn = kept != most_kept[piece]
    return np.where(turn[:, None], faces[:, ::-1], faces).astype(np.int32), int(turn.sum())
