"""Garments put where no one would put them."""

import numpy as np

from vto_pipeline.geometry.topology import edge_faces, edges, vertex_normals
from vto_pipeline.model.mesh import TriangleMesh


def shifted(shirt, *way):
    return TriangleMesh(shirt.vertices + np.array(way), shirt.faces)


def sleeves_up(shirt):
    """The sleeves turned up by 25 degrees at the shoulders, so that the arms leave them through their undersides."""
    x = shirt.vertices.copy()
    middle, width = x.mean(axis=0), np.ptp(x[:, 0])
    for side in (1.0, -1.0):
        sleeve = side * (x[:, 0] - middle[0]) > 0.25 * width
        pivot = np.array([middle[0] + 0.25 * side * width, np.quantile(x[sleeve, 1], 0.7), 0.0])
        c, s = np.cos(np.deg2rad(25)), side * np.sin(np.deg2rad(25))
        x[sleeve] = (x[sleeve] - pivot) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T + pivot
    return TriangleMesh(x, shirt.faces)


def finned(shirt):
    """A hundred of its edges have a third face."""
    pairs = edges(shirt)[edge_faces(shirt)[:, 1] >= 0]
    chosen = pairs[np.random.default_rng(0).choice(len(pairs), 100, replace=False)]
    tips = shirt.vertices[chosen].mean(axis=1) + 0.01 * vertex_normals(shirt)[chosen[:, 0]]
    fins = np.column_stack([chosen, len(shirt.vertices) + np.arange(100)])
    return TriangleMesh(np.vstack([shirt.vertices, tips]), np.vstack([shirt.faces, fins]))


def two(shirt):
    """Two shirts, the one 12 mm over the other."""
    outer = shirt.vertices + 0.012 * vertex_normals(shirt)
    return TriangleMesh(np.vstack([shirt.vertices, outer]), np.vstack([shirt.faces, shirt.faces + len(outer)]))


def upside_down(shirt):
    """The shirt turned about its middle, so that the head is in its hem."""
    middle = shirt.vertices.mean(axis=0)
    return TriangleMesh((shirt.vertices - middle) * [-1.0, -1.0, 1.0] + middle, shirt.faces)
