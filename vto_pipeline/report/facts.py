"""The numbers of a surface."""

from __future__ import annotations

from typing import Any

from vto_pipeline.geometry.topology import edge_face_counts, face_components, surface_area
from vto_pipeline.model.mesh import TriangleMesh


def surface_facts(mesh: TriangleMesh) -> dict[str, Any]:
    """Return counts of vertices, triangles, pieces and edges of more than two faces, size, area, and if it is closed.

    Lengths are in metres where the mesh is metric, and named so.
    """
    faces = edge_face_counts(mesh)[1]
    return {
        "vertices": len(mesh.vertices),
        "triangles": len(mesh.faces),
        "size_m": [float(side) for side in mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0)],
        "area_m2": surface_area(mesh),
        "pieces": face_components(mesh)[0],
        "closed": bool((faces != 1).all()),
        "edges_of_more_than_two_faces": int((faces > 2).sum()),
    }
