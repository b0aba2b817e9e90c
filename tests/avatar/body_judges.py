"""Judges that share no code with the project."""

import igl
import ipctk
import numpy as np
import trimesh
from scipy.spatial import ConvexHull


def crossing(vertices: np.ndarray, faces: np.ndarray) -> bool:
    """Whether a mesh passes through itself, by ipctk's exact test."""
    edges = trimesh.Trimesh(vertices, faces, process=False).edges_unique
    return ipctk.has_intersections(ipctk.CollisionMesh(vertices, edges, faces), vertices)


def independent_girth(vertices: np.ndarray, faces: np.ndarray, height: float, near: float) -> float:
    """Hull of the trimesh section's loop whose middle is nearest to x = near."""
    cut = trimesh.Trimesh(vertices, faces, process=False).section([0, 1, 0], [0, height, 0])
    loop = min(cut.discrete, key=lambda points: abs(points[:, 0].mean() - near))
    return ConvexHull(loop[:, [0, 2]]).area


def distances(points: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Distance of points from a surface [m]."""
    return np.sqrt(igl.point_mesh_squared_distance(points, vertices, faces.astype(np.int64))[0])


def inside(points: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Whether points lie inside a closed surface, by its solid angle."""
    a, b, c = (vertices[faces[:, k]] - points[:, None] for k in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=2) for v in (a, b, c))
    det = (a * np.cross(b, c)).sum(axis=2)
    half = np.arctan2(det, la * lb * lc + (a * b).sum(2) * lc + (b * c).sum(2) * la + (c * a).sum(2) * lb)
    return half.sum(axis=1) / (2 * np.pi) > 0.5
