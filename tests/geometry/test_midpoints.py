"""Triangles in four: against another library, and linear where what they carry is."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.testing import assert_allclose

from vto_pipeline.geometry.riding.midpoints import split_edges, split_in_four
from vto_pipeline.model.mesh import Skin, TriangleMesh

BALL = trimesh.creation.icosphere(1, 0.3)
CUP = BALL.submesh([np.flatnonzero(BALL.triangles_center @ [0.1, 1.0, 0.0] > 0.05)], append=True)  # it has a border
MESH = TriangleMesh(CUP.vertices, CUP.faces)


def corners_of(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Triangles, each from its least corner on and in order: the same for the same surface, facing the same way."""
    triangles = np.round(vertices[faces], 9)
    least = np.lexsort(triangles.transpose(2, 0, 1), axis=1)[:, 0]
    turned = np.stack([np.roll(one, -k, axis=0) for one, k in zip(triangles, least, strict=True)]).reshape(-1, 9)
    return turned[np.lexsort(turned.T)]


def test_triangles_are_those_of_another_library() -> None:
    found, ends = split_edges(MESH)
    theirs = trimesh.Trimesh(MESH.vertices, MESH.faces, process=False).subdivide()
    assert len(found.vertices) == len(theirs.vertices)
    assert_allclose(corners_of(found.vertices, found.faces), corners_of(theirs.vertices, theirs.faces), atol=1e-9)
    assert np.array_equal(found.vertices[: len(MESH.vertices)], MESH.vertices)
    assert_allclose(found.vertices, MESH.vertices[ends].mean(axis=1), rtol=0, atol=1e-15)  # rounding


def test_what_is_linear_over_the_mesh_stays_so() -> None:
    """Places in a picture are those of where a corner is, and colours as well, to their rounding."""
    along = np.array([[1.0, 0.3], [0.2, -1.0], [0.5, 0.4]])
    places = MESH.vertices[MESH.faces] @ along
    colors = np.rint(127 + 300 * MESH.vertices).astype(np.uint8)
    skin = Skin(places[:, ::-1], np.zeros((2, 2, 3), np.uint8))
    fine = split_in_four(TriangleMesh(MESH.vertices, MESH.faces, colors, places, skin=skin))
    assert fine.texture is not None
    assert fine.skin is not None
    assert fine.colors is not None
    assert_allclose(fine.texture, fine.vertices[fine.faces] @ along, rtol=0, atol=1e-12)  # rounding
    assert_allclose(fine.colors, 127 + 300 * fine.vertices, rtol=0, atol=1.01)  # rounded twice
    assert len(fine.skin.places) == 4 * len(MESH.faces)
    bare = split_in_four(MESH)
    assert (bare.texture, bare.skin, bare.colors) == (None, None, None)
