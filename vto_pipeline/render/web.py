"""Parts within the limits of a web page: fewer triangles, smaller pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vto_pipeline.errors import InputError
from vto_pipeline.geometry.closest import barycentric, closest_points
from vto_pipeline.geometry.remeshing.decimate import decimate
from vto_pipeline.geometry.topology import concatenate, face_components, submesh
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import GlbPart

_TRIES = 4
"""Of thinning out; borders may keep more than was wanted."""

_FEW = 32
"""Triangles that every chart keeps."""


def thin_parts(parts: Sequence[GlbPart], triangles: int) -> list[GlbPart]:
    """Return parts that have at most so many triangles together; each keeps its share.

    Vertices at borders and seams stay. Others take what the nearest place of the former surface had.

    Raises:
        InputError: borders and seams alone need more.
    """
    count = had = sum(len(part.mesh.faces) for part in parts)
    thinned, wanted = list(parts), float(triangles)
    for _ in range(_TRIES):
        if count <= triangles:
            break
        thinned = [_thinned(part, wanted / had) for part in parts]
        count = sum(len(part.mesh.faces) for part in thinned)
        wanted *= 0.98 * triangles / count
    if count <= triangles:
        return thinned
    raise InputError(f"{had} triangles cannot be thinned out to {triangles}", hint=f"at last {count} were left")


def shrink_pictures(parts: Sequence[GlbPart], side: int) -> list[GlbPart]:
    """Return parts whose pictures are at most so many pixels wide and high."""
    return [part if part.texture is None else replace(part, texture=_shrunk(part.texture, side)) for part in parts]


def _shrunk(picture: ByteArray, side: int) -> ByteArray:
    import cv2

    height, width = picture.shape[:2]
    if max(height, width) <= side:
        return picture
    scale = side / max(height, width)
    size = max(1, round(scale * width)), max(1, round(scale * height))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _thinned(part: GlbPart, share: float) -> GlbPart:
    """Return a part with a share of its triangles, chart by chart, so that none takes its picture from another."""
    count, chart = face_components(part.mesh)
    meshes: list[TriangleMesh] = []
    colors: list[ByteArray] = []
    normals: list[FloatArray] = []
    uv: list[FloatArray] = []
    for k in range(count):
        former, kept = submesh(part.mesh, chart == k)
        thin = decimate(former, max(_FEW, round(share * len(former.faces))))
        face, _, _ = closest_points(thin.vertices, former.vertices, former.faces)
        corners = former.faces[face]
        weight = barycentric(thin.vertices, former.vertices[corners])
        meshes.append(thin)
        for each, values in ((normals, part.normals), (uv, part.uv)):
            if values is not None:
                each.append(np.einsum("nc,ncd->nd", weight, values[kept][corners]))
        if thin.colors is not None:
            colors.append(thin.colors)
    whole = concatenate(meshes)
    return replace(
        part,
        mesh=replace(whole, colors=np.vstack(colors)) if colors else whole,
        normals=np.vstack(normals) if normals else None,
        uv=np.vstack(uv) if uv else None,
    )
