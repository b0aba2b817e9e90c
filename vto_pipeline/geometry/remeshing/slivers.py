"""Slivers: triangles with hardly any area, whose sides are flipped until there are none, or none can be.

Remeshing leaves them at rims. Three vertices in a row there may be a triangle of their own, an ear; and where smoothing
has pushed a vertex up to the rim, it has a fan of triangles along it. A sliver's tip weighs nothing, and what bends
across its long side has hardly a lever: so it never comes to rest.
"""

from __future__ import annotations

import numpy as np

from vto_pipeline.geometry.topology import edges, opposite_half_edges
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

_SHARP = 0.15  # sine of the least angle, 9°: a sliver
_ROUNDS = 12  # each flips at most one side of a triangle: a fan along a rim is taken down one by one


def flip_slivers(mesh: TriangleMesh) -> TriangleMesh:
    """Return the mesh with sides of its ears and slivers flipped, where that makes the least angle of the two larger.

    Vertices stay. What lies on either side may be folded over by a flip: such a one is not made.

    Args:
        mesh: Manifold and oriented.
    """
    faces = mesh.faces
    for _ in range(_ROUNDS):
        flipped = _flip_some(TriangleMesh(mesh.vertices, faces))
        if flipped is faces:
            break
        faces = flipped
    return mesh if faces is mesh.faces else TriangleMesh(mesh.vertices, faces)


def _flip_some(mesh: TriangleMesh) -> IntArray:
    """Return the faces after the best flip of each sliver or ear, each face in one flip at most."""
    opposite = opposite_half_edges(mesh).reshape(-1, 3)
    sharp = _least_sines(mesh.vertices[mesh.faces])
    found = (sharp < _SHARP) | ((opposite >= 0).sum(axis=1) == 1)
    faces, changed = mesh.faces, np.zeros(len(mesh.faces), np.bool_)
    known = {(int(a), int(b)) for a, b in edges(mesh)} if found.any() else set()
    for f in np.flatnonzero(found)[np.argsort(sharp[found], kind="stable")].tolist():
        best, made = 0.0, None
        for k in np.flatnonzero(opposite[f] >= 0).tolist():
            g, m = divmod(int(opposite[f, k]), 3)
            if changed[f] or changed[g]:
                continue
            a, b, tip = np.roll(mesh.faces[f], -k).tolist()
            c = int(mesh.faces[g, (m + 2) % 3])
            after = np.array([[tip, a, c], [tip, c, b]], faces.dtype)
            gain = float(_least_sines(mesh.vertices[after]).min()) - min(sharp[f], sharp[g])
            if gain > best and (min(tip, c), max(tip, c)) not in known and _lies_flat(mesh, f, g, after):
                best, made = gain, (g, after)
        if made is not None:
            g, after = made
            faces = faces.copy() if faces is mesh.faces else faces
            faces[[f, g]] = after
            changed[[f, g]] = True
            tip, _, c = after[0].tolist()
            known.add((min(tip, c), max(tip, c)))
    return faces


def _lies_flat(mesh: TriangleMesh, f: int, g: int, after: IntArray) -> bool:
    """Return whether both faces after a flip face as the two did before."""
    normal = _normals(mesh.vertices[mesh.faces[[f, g]]]).sum(axis=0)
    return bool((_normals(mesh.vertices[after]) @ normal > 0.0).all())


def _normals(corners: FloatArray) -> FloatArray:
    """Return the normals of these faces (N, 3, 3), as long as twice their areas."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _least_sines(corners: FloatArray) -> FloatArray:
    """Return the least sine of an angle of each of these faces (N, 3, 3), shape (N,)."""
    side = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    area = np.linalg.norm(_normals(corners), axis=1)
    return np.asarray(area * side.min(axis=1) / np.maximum(side.prod(axis=1), np.finfo(float).tiny))
