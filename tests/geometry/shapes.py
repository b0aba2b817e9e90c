"""Small surfaces with known answers."""

from __future__ import annotations

import numpy as np
import trimesh

from vto_pipeline.model.mesh import TriangleMesh


def sphere(subdivisions: int, radius: float = 1.0) -> TriangleMesh:
    ball = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return TriangleMesh(ball.vertices, ball.faces)


def grid(columns: int, rows: int, step: float = 1.0) -> TriangleMesh:
    """A flat sheet in the xy plane, facing +z."""
    i, j = np.meshgrid(np.arange(columns + 1), np.arange(rows + 1), indexing="ij")
    vertices = np.column_stack([i.ravel() * step, j.ravel() * step, np.zeros(i.size)])
    at = np.arange(i.size).reshape(i.shape)
    a, b, c, d = at[:-1, :-1].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel(), at[:-1, 1:].ravel()
    return TriangleMesh(vertices, np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])]))


def tube(around: int, along: int, radius: float = 0.15, length: float = 0.6, wave: float = 0.01) -> TriangleMesh:
    """An open tube about +Y, outward, whose two rims go up and down by `wave`."""
    turn = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)[:, None]
    up = np.linspace(0.0, length, along)[None, :]
    flat = np.zeros_like(turn * up)
    vertices = np.stack([radius * np.sin(turn) + flat, up + wave * np.sin(3 * turn), radius * np.cos(turn) + flat], -1)
    at = np.arange(around * along).reshape(around, along)
    next_to = np.roll(at, -1, axis=0)
    a, b, c, d = at[:, :-1].ravel(), next_to[:, :-1].ravel(), next_to[:, 1:].ravel(), at[:, 1:].ravel()
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return TriangleMesh(vertices.reshape(-1, 3), faces)


def without(mesh: TriangleMesh, drop: np.ndarray) -> TriangleMesh:
    """The mesh without some faces; vertices keep their indices."""
    return TriangleMesh(mesh.vertices, mesh.faces[~drop])


def centers(mesh: TriangleMesh) -> np.ndarray:
    return mesh.vertices[mesh.faces].mean(axis=1)
