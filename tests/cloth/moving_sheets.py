"""Sheets that fold, wind and overlap, and brute force for which of their features come near each other."""

import ipctk
import numpy as np
from cloth_scenes import sheet


def fold(points, layers, gap):
    """A flat sheet of unit width in zigzag: this many layers so far apart."""
    along = points[:, 0] * layers
    return np.column_stack([np.abs(along % 2 - 1) / layers, gap * along, points[:, 2]])


def crumple(points, size, seed):
    """The points after a smooth random motion of about this size."""
    rng = np.random.default_rng(seed)
    waves, phases = rng.normal(0, 4, (3, 3)), rng.uniform(0, 6, 3)
    return points + size * np.sin(points @ waves + phases)


def ramp(turns, columns, rows, inner, outer, rise, widening):
    """A strip that winds about the y axis: a ring sector, a coil on the floor, a spiral ramp."""
    mesh = sheet(columns, rows, 1.0, 1.0, upright=False)
    angle = 2 * np.pi * turns * mesh.vertices[:, 0]
    radius = inner + (outer - inner) * mesh.vertices[:, 2] + widening * angle
    points = np.column_stack([radius * np.sin(angle), rise * angle, radius * np.cos(angle)])
    return points, np.ascontiguousarray(mesh.faces[:, ::-1])


def brute_pairs(low, high, other_low, other_high):
    """The pairs of closed boxes that overlap, in lexicographic order."""
    return np.argwhere(((low[:, None] <= other_high) & (other_low <= high[:, None])).all(axis=2)).astype(np.int32)


def boxes_of(simplices, start, end, radius):
    """Low and high corners of the swept, inflated boxes of simplices (N, K)."""
    low, high = np.minimum(start, end) - radius[:, None], np.maximum(start, end) + radius[:, None]
    return low[simplices].min(axis=1), high[simplices].max(axis=1)


def judge(faces, points):
    """ipctk's mesh."""
    return ipctk.CollisionMesh(np.asfortranarray(points), ipctk.edges(faces), faces)
