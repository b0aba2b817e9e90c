"""What ipctk, which shares no code with the project, says of a garment on a body."""

import ipctk
import numpy as np


def crosses(cloth, body):
    """Whether the garment and what of the body is near it cross, each other or the garment itself."""
    corners = body.vertices[body.faces]
    low, high = cloth.vertices.min(axis=0), cloth.vertices.max(axis=0)
    near = body.faces[((corners.min(axis=1) <= high) & (corners.max(axis=1) >= low)).all(axis=1)]
    vertices = np.vstack([cloth.vertices, body.vertices])
    faces = np.vstack([cloth.faces, near + len(cloth.vertices)])
    return _cross(vertices, faces)


def self_crosses(cloth):
    """Whether a garment crosses itself."""
    return _cross(np.array(cloth.vertices), np.array(cloth.faces))


def _cross(vertices, faces):
    return ipctk.has_intersections(ipctk.CollisionMesh(vertices, ipctk.edges(faces), faces), vertices)
