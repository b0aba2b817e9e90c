"""A textured mesh cut at its seams; cameras moved with a mesh."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose

from vto_pipeline.geometry.remeshing.seams import cut_open, split_at_seams
from vto_pipeline.geometry.rigid import transform_cameras, transform_mesh
from vto_pipeline.model.camera import CameraSet, Intrinsics
from vto_pipeline.model.mesh import TriangleMesh


def folded_sheet() -> TriangleMesh:
    """Two squares that share an edge; the second lies elsewhere in the picture. Vertex 6 has no face."""
    vertices = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [1, 0, -1], [1, 1, -1], [9, 9, 9]]
    faces = [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]]
    first = [[[0, 0], [0.4, 0], [0.4, 1]], [[0, 0], [0.4, 1], [0, 1]]]
    second = [[[0.5, 0], [0.9, 0], [0.9, 1]], [[0.5, 0], [0.9, 1], [0.5, 1]]]
    return TriangleMesh(np.array(vertices, float), np.array(faces), texture=np.array(first + second))


def test_every_corner_keeps_its_place_in_space_and_in_the_picture() -> None:
    mesh = folded_sheet()
    source, faces, uv = split_at_seams(mesh)
    assert len(source) == 8  # six used, and the two of the shared edge twice
    assert_allclose(mesh.vertices[source][faces], mesh.vertices[mesh.faces], rtol=0, atol=0)  # the same numbers
    assert_allclose(uv[faces] * (1, -1) + (0, 1), mesh.texture, rtol=0, atol=1e-15)  # one subtraction there and back
    assert len(np.unique(np.column_stack([source, uv]), axis=0)) == len(source)


def test_normals_do_not_break_at_a_seam() -> None:
    mesh = folded_sheet()
    part = cut_open("sheet", mesh, np.zeros((4, 4, 3), np.uint8))
    assert part.normals is not None
    twins = [np.flatnonzero((part.mesh.vertices == mesh.vertices[k]).all(axis=1)) for k in (1, 2)]
    for one, other in twins:
        assert_allclose(part.normals[one], part.normals[other], rtol=0, atol=0)  # one vertex's normal


def test_cameras_see_the_same_after_a_similarity() -> None:
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    moved_from_world = np.eye(4)
    moved_from_world[:3, :3], moved_from_world[:3, 3] = 2.5 * turn, (1.0, -2.0, 0.5)
    pose = np.eye(4)
    pose[:3, 3] = (0.2, 0.1, -3.0)
    camera = Intrinsics(100, 100, 80.0, 80.0, 50.0, 50.0)
    mesh = folded_sheet()
    before = pixels(mesh, camera, CameraSet(("a",), (camera,), pose[None]))
    moved = transform_cameras(CameraSet(("a",), (camera,), pose[None]), moved_from_world)
    assert_allclose(pixels(transform_mesh(mesh, moved_from_world), camera, moved), before, rtol=0, atol=1e-9)
    assert_allclose(np.linalg.det(moved.world_from_cam[0, :3, :3]), 1.0, rtol=0, atol=1e-12)  # a rotation


def pixels(mesh: TriangleMesh, camera: Intrinsics, cameras: CameraSet) -> np.ndarray:
    local = np.linalg.inv(cameras.world_from_cam[0])
    seen = (mesh.vertices @ local[:3, :3].T + local[:3, 3]) @ camera.matrix.T
    return seen[:, :2] / seen[:, 2:]
