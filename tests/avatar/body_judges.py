"""Judges that share no code with the project."""

import igl
import ipctk
import numpy as np
import trimesh
from scipy.spatial import ConvexHull

from vto_pipeline.model.body import Avatar
from vto_pipeline.model.mesh import TriangleMesh


def crossing(vertices: np.ndarray, faces: np.ndarray) -> bool:
    """Whether a mesh passes through itself, by ipctk's exact test."""
    edges = trimesh.Trimesh(vertices, faces, process=False).edges_unique
    return ipctk.has_intersections(ipctk.CollisionMesh(vertices, edges, faces), vertices)


def meet(one: TriangleMesh, other: TriangleMesh) -> bool:
    """Whether two surfaces pass through each other, or one of them through itself, by ipctk's exact test."""
    faces = np.vstack([one.faces, other.faces + len(one.vertices)])
    return crossing(np.vstack([one.vertices, other.vertices]), faces)


def cross(one: TriangleMesh, other: TriangleMesh) -> bool:
    """Whether two surfaces pass through each other; what passes through itself does not count.

    All edges of the one are held against all triangles of the other.
    """
    return _pierced(one, other) or _pierced(other, one)


def _pierced(one: TriangleMesh, other: TriangleMesh) -> bool:
    """Whether an edge of the one goes through a triangle of the other, by signed volumes."""
    low, high = other.vertices.min(axis=0), other.vertices.max(axis=0)
    edges = trimesh.Trimesh(one.vertices, one.faces, process=False).edges_unique
    ends = one.vertices[edges]
    ends = ends[((ends.max(axis=1) >= low) & (ends.min(axis=1) <= high)).all(axis=1)]
    for p, q in ends:
        a, b, c = other.vertices[other.faces.T]
        near = ((np.maximum(p, q) >= np.minimum(np.minimum(a, b), c)).all(axis=1)) & (
            (np.minimum(p, q) <= np.maximum(np.maximum(a, b), c)).all(axis=1)
        )
        a, b, c = a[near], b[near], c[near]
        sides = [(np.cross(b - a, c - a) * (end - a)).sum(axis=1) > 0 for end in (p, q)]
        turns = [(np.cross(v - p, w - p) @ (q - p)) > 0 for v, w in ((a, b), (b, c), (c, a))]
        if ((sides[0] != sides[1]) & (turns[0] == turns[1]) & (turns[1] == turns[2])).any():
            return True
    return False


def independent_girth(vertices: np.ndarray, faces: np.ndarray, height: float, near: float | None) -> float:
    """Hull of the trimesh section's loop whose middle is nearest to x = near; of the whole section without one."""
    cut = trimesh.Trimesh(vertices, faces, process=False).section([0, 1, 0], [0, height, 0])
    if near is None:
        return ConvexHull(cut.vertices[:, [0, 2]]).area
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


def slice_body(body: Avatar) -> dict[str, float]:
    """Measure a body in its bind pose by trimesh's sections and the hull of their loops [m], and its volume [m3].

    Only the levels and the landmarks are taken from the body; girths of trunk, legs and left arm, lengths, heights.
    """
    v, loops = body.bind_vertices, body.loops
    mesh = trimesh.Trimesh(v, body.faces, process=False)
    at = {name: v[vertex] for name, vertex in body.landmarks.items()}
    out = {}
    for name in ("head", "neck", "chest", "underbust", "waist", "navel", "high_hip", "hip"):
        # the hip's tape goes round both legs where it lies below the crotch
        reach = np.abs(v[loops[name], 0]).max() + 0.01
        out[f"{name}_girth"] = _taut(mesh, v[loops[name]].mean(axis=0), np.array([0.0, 1.0, 0.0]), reach)
        out[f"{name}_height"] = v[loops[name], 1].mean() - v[:, 1].min()
    for name in ("thigh", "knee", "calf", "ankle"):
        out[f"{name}_girth"] = _taut(mesh, v[loops[f"left_{name}"]].mean(axis=0), np.array([0.0, 1.0, 0.0]))
    along = v[loops["left_wrist"]].mean(axis=0) - v[loops["left_upper_arm"]].mean(axis=0)
    for name in ("upper_arm", "elbow", "forearm", "wrist"):
        out[f"{name}_girth"] = _taut(mesh, v[loops[f"left_{name}"]].mean(axis=0), along / np.linalg.norm(along))
    arm = np.array([at[f"left_{name}"] for name in ("shoulder_point", "elbow_point", "wrist_point")])
    return out | {
        "stature": np.ptp(v[:, 1]),
        "inside_leg": at["crotch_point"][1] - v[:, 1].min(),
        "back_neck_height": at["back_neck"][1] - v[:, 1].min(),
        "shoulder_height": at["left_shoulder_point"][1] - v[:, 1].min(),
        "knee_height": v[loops["left_knee"], 1].mean() - v[:, 1].min(),
        "back_shoulder_width": np.linalg.norm(at["left_shoulder_point"] - at["right_shoulder_point"]),
        "outer_arm_length": np.linalg.norm(np.diff(arm, axis=0), axis=1).sum(),
        "volume": mesh.volume if mesh.is_watertight else np.nan,
    }


def _taut(mesh: trimesh.Trimesh, origin: np.ndarray, normal: np.ndarray, reach: float | None = None) -> float:
    """Perimeter of the hull of the section's loop about the origin, or of all within `reach` of the median plane."""
    # a hair off the row: a plane through vertices is ambiguous for any slicer
    origin = origin + 1e-5 * normal
    loops = mesh.section(normal, origin).discrete
    if reach is None:
        points = min(loops, key=lambda loop: np.linalg.norm(loop.mean(axis=0) - origin))
    else:
        points = np.concatenate([loop for loop in loops if abs(loop[:, 0].mean()) < reach])
    flat = trimesh.transform_points(points, trimesh.geometry.plane_transform(origin, normal))
    return ConvexHull(flat[:, :2]).area
