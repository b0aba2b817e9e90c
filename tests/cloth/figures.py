"""A figure of capsules whose arms are held at a known angle, and a tunic made for other arms: all axes are known."""

import igl
import numpy as np

from vto_pipeline.geometry.topology import submesh
from vto_pipeline.model.mesh import TriangleMesh

SHOULDER, ARM, HEIGHT = np.array([0.16, 1.32, 0.0]), 0.55, 1.7
EASE = 0.03  # m between body and cloth


def arm_end(side, below):
    """Where an arm ends that is held so far below the horizontal [rad]; side is 1 on the wearer's left."""
    return (SHOULDER + ARM * np.array([np.cos(below), -np.sin(below), 0.0])) * [side, 1.0, 1.0]


def bones(below):
    """Ends and radius of each capsule: trunk (two), head, arms, legs."""
    left = [(SHOULDER * [s, 1, 1], arm_end(s, below), 0.04) for s in (1.0, -1.0)]
    legs = [(np.array([s * 0.09, 0.85, 0.0]), np.array([s * 0.12, 0.06, 0.0]), 0.06) for s in (1.0, -1.0)]
    trunk = [(np.array([0.0, 0.9, 0.0]), np.array([0.0, 1.25, 0.0]), 0.14)]
    shoulders = [(SHOULDER, SHOULDER * [-1, 1, 1], 0.06)]
    head = [(np.array([0.0, 1.3, 0.0]), np.array([0.0, 1.62, 0.0]), 0.07)]
    return trunk + shoulders + head + left + legs


def capsules(points, parts, wider=0.0):
    """Signed distance to the union of capsules, shape (N,)."""
    found = np.full(len(points), np.inf)
    for a, b, radius in parts:
        t = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        found = np.minimum(found, np.linalg.norm(points - a - t[:, None] * (b - a), axis=1) - radius - wider)
    return found


def surface(field, cell):
    """The zero level of a field as triangles, oriented outward."""
    low, high = np.array([-0.85, -0.05, -0.25]), np.array([0.85, 1.8, 0.25])
    size = np.ceil((high - low) / cell).astype(int) + 1
    i, j, k = np.meshgrid(*(np.arange(s) for s in size), indexing="ij")
    points = low + cell * np.column_stack([axis.ravel(order="F") for axis in (i, j, k)])
    v, f, _ = igl.marching_cubes(field(points), points, *(int(s) for s in size), 0.0)
    a, b, c = v[f].transpose(1, 0, 2)
    volume = np.einsum("fd,fd->", a, np.cross(b, c))
    return TriangleMesh(v, (f if volume > 0 else f[:, ::-1]).astype(np.int32).copy())


def figure(below, cell=0.02):
    """The figure, its arms so far below the horizontal [rad]."""
    return surface(lambda p: capsules(p, bones(below)), cell)


def tunic(below=0.0, sleeve=0.4, hem=0.75, sewn_shut=False, cell=0.02):
    """A tunic for arms at an angle; it ends at the hem, the neck, and `sleeve` metres along each arm.

    Args:
        below: Of the arms it is made for [rad].
        sleeve: Length from the shoulder [m].
        hem: Height [m].
        sewn_shut: Whether the sleeves end closed.
    """
    parts = bones(below)[:2] + [
        (SHOULDER * [s, 1, 1], SHOULDER * [s, 1, 1] + (arm_end(s, below) - SHOULDER * [s, 1, 1]) * sleeve / ARM, 0.045)
        for s in (1.0, -1.0)
    ]
    parts.append((np.array([0.0, 0.6, 0.0]), np.array([0.0, 1.0, 0.0]), 0.14))
    neck = (np.array([0.0, 1.3, 0.0]), np.array([0.0, 1.5, 0.0]), 0.07)
    closed = surface(lambda p: capsules(p, [*parts, neck], EASE), cell)
    x = closed.vertices
    keep = (x[:, 1] > hem) & (x[:, 1] < 1.42)
    for s in (1.0, -1.0) if not sewn_shut else ():
        shoulder = SHOULDER * [s, 1, 1]
        along = (x - shoulder) @ (arm_end(s, below) - shoulder) / ARM
        keep &= along < sleeve
    return submesh(closed, keep[closed.faces].all(axis=1))[0]
