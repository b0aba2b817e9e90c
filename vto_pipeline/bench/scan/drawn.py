"""A scanned garment, unlit, as a camera sees it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.geometry.topology import face_area_vectors
from vto_pipeline.model.arrays import ByteArray, FloatArray, IntArray
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.texture import TexturedMesh
from vto_pipeline.numerics.rasterise import rasterise

SAMPLES = 3
"""Per pixel and direction, of a drawn picture."""


class _Shown(NamedTuple):
    """What the samples of a picture show, in all (H, W) of which N show the mesh.

    Args:
        where: These, shape (H, W).
        face: Their triangles, shape (N,).
        share: Of the triangles' corners, shape (N, 3).
        outside: Whether the outside is seen, shape (N,).
    """

    where: NDArray[np.bool_]
    face: IntArray
    share: FloatArray
    outside: NDArray[np.bool_]


def draw(textured: TexturedMesh, camera: Intrinsics, world_from_cam: FloatArray) -> tuple[ByteArray, NDArray[np.bool_]]:
    """Draw a textured mesh as a camera without distortion sees it.

    Returns:
        sRGB, shape (H, W, 3), and which pixels show the outside, and texels that a photo had shown, shape (H, W).
    """
    shown = _shown(textured.mesh, camera, world_from_cam)
    assert textured.mesh.texture is not None
    place = np.einsum("nk,nkd->nd", shown.share, textured.mesh.texture[shown.face])
    seen = np.zeros(shown.where.shape)
    marks = np.where(textured.seen, 255, 0).astype(np.uint8)[..., None]
    seen[shown.where] = (sample(marks, place)[:, 0] > 128) & shown.outside
    whole = seen.reshape(camera.height, SAMPLES, camera.width, SAMPLES).min(axis=(1, 3)) > 0
    return _averaged(shown, sample(textured.picture, place)), whole


def draw_vertex_colors(mesh: TriangleMesh, camera: Intrinsics, world_from_cam: FloatArray) -> ByteArray:
    """Draw a mesh with colours at its vertices as a camera without distortion sees it; sRGB, shape (H, W, 3)."""
    shown = _shown(mesh, camera, world_from_cam)
    assert mesh.colors is not None
    corners = mesh.colors[mesh.faces[shown.face]].astype(np.float64)
    return _averaged(shown, np.einsum("nk,nkd->nd", shown.share, corners))


def sample(picture: ByteArray, place: FloatArray) -> FloatArray:
    """Return a picture's colours at texture coordinates, v up, bilinearly, shape (N, D)."""
    import cv2

    height, width = picture.shape[:2]
    x = (place[:, 0] * width - 0.5).astype(np.float32)
    y = ((1.0 - place[:, 1]) * height - 0.5).astype(np.float32)
    rows = -(-len(x) // 30_000)  # cv2 takes no longer columns
    columns, lines = (np.resize(one, (rows, 30_000)) for one in (x, y))
    found = cv2.remap(picture, columns, lines, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(found, dtype=np.float64).reshape(rows * 30_000, -1)[: len(x)]


def _shown(mesh: TriangleMesh, camera: Intrinsics, world_from_cam: FloatArray) -> _Shown:
    fine = camera.without_distortion().resized(SAMPLES * camera.width, SAMPLES * camera.height)
    cam_from_world = np.linalg.inv(world_from_cam)
    local = mesh.vertices @ cam_from_world[:3, :3].T + cam_from_world[:3, 3]
    z = np.maximum(local[:, 2], 1e-6)
    placed = np.column_stack([fine.fx * local[:, 0] / z + fine.cx, fine.fy * local[:, 1] / z + fine.cy, z])
    face, weight, _ = rasterise(placed[mesh.faces], fine.width, fine.height)
    where = face >= 0
    face = face[where]
    share = np.column_stack([1.0 - weight[where].sum(axis=1), weight[where]])
    share = share / z[mesh.faces[face]]  # interpolated as perspective has it
    towards = world_from_cam[:3, 3] - mesh.vertices[mesh.faces[:, 0]]
    outside = (face_area_vectors(mesh) * towards).sum(axis=1) > 0
    return _Shown(where, face, share / share.sum(axis=1, keepdims=True), outside[face])


def _averaged(shown: _Shown, colors: FloatArray) -> ByteArray:
    """Return the samples' colours (N, 3) as a picture, black where they show nothing."""
    height, width = shown.where.shape
    picture = np.zeros((height, width, 3))
    picture[shown.where] = colors
    blocks = picture.reshape(height // SAMPLES, SAMPLES, width // SAMPLES, SAMPLES, 3)
    return np.rint(blocks.mean(axis=(1, 3))).astype(np.uint8)
