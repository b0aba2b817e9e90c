"""Bodies as they come: crossing themselves, open, torn, with triangles doubled, turned or without area."""

import numpy as np
import trimesh

from vto_pipeline.model.mesh import TriangleMesh


def fine_box(size, center=(0.0, 0.0, 0.0), edge=0.03):
    """A box of small triangles."""
    mesh = trimesh.creation.box(size).subdivide_to_size(edge)
    return TriangleMesh(mesh.vertices + np.asarray(center), mesh.faces)


def together(*meshes):
    """One mesh of several that may pass through each other."""
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    return TriangleMesh(np.vstack([mesh.vertices for mesh in meshes]), np.vstack(faces))


def from_box(points, size, center=(0.0, 0.0, 0.0)):
    """Signed distance from a box [m]."""
    over = np.abs(points - np.asarray(center)) - 0.5 * np.asarray(size)
    return np.linalg.norm(np.maximum(over, 0.0), axis=1) + np.minimum(over.max(axis=1), 0.0)


def soup(mesh):
    """The same triangles, each with vertices of its own."""
    return TriangleMesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3))


def doubled(mesh, rng):
    """Every tenth triangle twice, in another turn of its corners."""
    chosen = rng.permutation(len(mesh.faces))[: len(mesh.faces) // 10]
    return TriangleMesh(mesh.vertices, np.vstack([mesh.faces, np.roll(mesh.faces[chosen], 1, axis=1)]))


def flipped(mesh, rng):
    """Every tenth triangle turned over."""
    faces = mesh.faces.copy()
    chosen = rng.permutation(len(faces))[: len(faces) // 10]
    faces[chosen] = faces[chosen][:, ::-1]
    return TriangleMesh(mesh.vertices, faces)


def slit(mesh, rng):
    """Some edges with a vertex on one side only, and a triangle without area to close the slit."""
    vertices, faces = list(mesh.vertices), [tuple(face) for face in mesh.faces]
    for f in rng.permutation(len(mesh.faces))[: len(mesh.faces) // 20]:
        a, b, c = faces[f]
        vertices.append(0.5 * (vertices[a] + vertices[b]))
        m = len(vertices) - 1
        faces[f] = (a, m, c)
        faces += [(m, b, c), (a, b, m)]
    return TriangleMesh(np.array(vertices), np.array(faces))
