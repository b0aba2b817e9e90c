"""A dressed form with known truth: implicit torso and arms, a shirt standing off from it, and what a scanner sees."""

from __future__ import annotations

from dataclasses import dataclass

import igl
import numpy as np
from scipy.spatial.transform import Rotation

from vto_pipeline.geometry.topology import face_components, submesh, vertex_normals
from vto_pipeline.model.mesh import TriangleMesh


def form_distance(p):
    x, y, z = p.T
    torso = ellipsoid(p, (0, 0.45, 0), (0.17, 0.42, 0.11))
    bust = ellipsoid(p, (0, 0.60, 0.055), (0.13, 0.09, 0.08))
    side = ellipsoid(p, (0.09, 0.35, -0.05), (0.08, 0.1, 0.07))
    neck = capsule(p, (0, 0.75, -0.01), (0, 0.93, 0.01), 0.055)
    arms = np.minimum(
        capsule(p, (0.15, 0.70, 0), (0.43, 0.42, 0.04), 0.042), capsule(p, (-0.15, 0.70, 0), (-0.43, 0.42, 0.04), 0.042)
    )
    body = torso
    for part, radius in ((bust, 0.03), (side, 0.03), (neck, 0.04), (arms, 0.03)):
        body = smooth_min(body, part, radius)
    body = np.maximum(body, np.maximum(0.08 - y, y - 0.9))
    stand = np.minimum(
        capsule(p, (0, 0, 0), (0, 0.2, 0), 0.03), np.maximum(np.hypot(x, z) - 0.14, np.abs(y - 0.015) - 0.015)
    )
    return np.minimum(body, np.maximum(stand, -y))


def shirt_region(p):
    """Negative where the shirt is: under the neck line, above the hem, short of the cuffs."""
    x, y, _ = p.T
    along = (np.abs(x) - 0.15) * 0.707 + (0.70 - y) * 0.707
    cuff = np.where(np.abs(x) > 0.26, along - 0.27, -1.0)
    neck = np.where(np.abs(x) < 0.12, y - 0.80, -1.0)
    hem = np.where(np.abs(x) < 0.25, 0.22 - y, -1.0)
    return np.maximum(np.maximum(cuff, neck), hem)


def shirt_gap(p):
    x, y, z = p.T
    around = np.arctan2(z, x)
    loose = np.clip((0.72 - y) / 0.4, 0.0, 1.0)
    return 0.0022 + 0.016 * loose + 0.006 * loose * np.sin(7 * around + 9 * y)


def ellipsoid(p, c, r):
    q = (p - np.array(c)) / np.array(r)
    k0 = np.linalg.norm(q, axis=1)
    k1 = np.maximum(np.linalg.norm(q / np.array(r), axis=1), 1e-9)
    return k0 * (k0 - 1) / k1


def capsule(p, a, b, r):
    a, b = np.array(a, float), np.array(b, float)
    t = np.clip((p - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
    return np.linalg.norm(p - a - t[:, None] * (b - a), axis=1) - r


def smooth_min(a, b, k):
    h = np.maximum(k - np.abs(a - b), 0) / k
    return np.minimum(a, b) - h * h * k / 4


@dataclass
class Scene:
    form: TriangleMesh
    shirt: TriangleMesh  # truth, open, in the form's frame
    scan: TriangleMesh
    is_shirt: np.ndarray  # of the scan's vertices
    on_ledge: np.ndarray  # between shirt and form, label arbitrary
    mannequin_from_surface: np.ndarray


def level_set(field, low, high, cell):
    size = np.ceil((np.array(high) - low) / cell).astype(int) + 1
    i, j, k = np.meshgrid(*(np.arange(s) for s in size), indexing="ij")
    order = np.column_stack([i.ravel(order="F"), j.ravel(order="F"), k.ravel(order="F")])
    points = np.array(low) + order * cell
    v, f, _ = igl.marching_cubes(field(points), points, int(size[0]), int(size[1]), int(size[2]), 0.0)
    return v, f


LOW, HIGH = (-0.52, -0.02, -0.2), (0.52, 0.94, 0.2)


def make_scene(cell=0.006, noise=0.0003, holes=4, motion=None, color=True, seed=0, region=shirt_region):
    """region: Of points (N, 3), negative in cloth. The truth is the shirt's largest piece, of others all."""
    rng = np.random.default_rng(seed)
    form = outward(*level_set(form_distance, LOW, HIGH, cell))
    shirt_all = outward(*level_set(lambda p: form_distance(p) - shirt_gap(p), LOW, HIGH, cell))
    inside = (region(shirt_all.vertices) < 0)[shirt_all.faces].all(axis=1)
    shirt = submesh(shirt_all, inside)[0]
    shirt = largest(shirt) if region is shirt_region else shirt

    def seen(p):
        body = form_distance(p)
        board = np.max(np.abs(p - [0, -0.005, 0]) - [0.4, 0.005, 0.18], axis=1)
        return np.minimum(np.minimum(body, np.maximum(body - shirt_gap(p), region(p))), board)

    scan = outward(*level_set(seen, LOW, HIGH, cell))
    v = scan.vertices
    d = form_distance(v)
    is_shirt = (region(v) < 0.5 * cell) & (d > 0.5 * shirt_gap(v))
    on_ledge = (d > 0.0015) & (d < shirt_gap(v) - 0.0015) & (np.abs(region(v)) < 0.003)
    board = v[:, 1] < 0.001
    rgb = np.where(is_shirt[:, None], [60, 90, 160], [205, 190, 170]).astype(float)
    rgb[is_shirt & (np.sin(v[:, 1] * 400) > 0.3)] = [200, 60, 60]
    rgb[board] = 255 * (np.floor(v[board, :1] / 0.04) + np.floor(v[board, 2:] / 0.04)) % 2
    rgb = np.clip(rgb + rng.normal(0, 6, rgb.shape), 0, 255)
    middle = v[scan.faces].mean(axis=1)
    keep = middle[:, 1] > -0.004
    spots = np.flatnonzero(is_shirt & (v[:, 1] < 0.7) & (np.abs(v[:, 0]) < 0.2))
    for spot in v[rng.choice(spots, holes, replace=False)] if holes else []:
        keep &= np.linalg.norm(middle - spot, axis=1) > rng.uniform(0.01, 0.02)
    v = v + vertex_normals(scan) * rng.normal(0, noise, (len(v), 1))
    motion = np.eye(4) if motion is None else motion
    surface = TriangleMesh((v - motion[:3, 3]) @ motion[:3, :3], scan.faces, rgb.astype(np.uint8) if color else None)
    surface, source = submesh(surface, keep)
    return Scene(form, shirt, surface, is_shirt[source], on_ledge[source], motion)


SHORT_FORM_ENDS, SKIRT_TOP, SKIRT_HEM = 0.30, 0.52, 0.06  # heights [m]


def short_form_distance(p):
    """The form without its stand, cut off at the hips."""
    return np.maximum(form_distance(p), SHORT_FORM_ENDS - p[:, 1])


def skirt_distance(p):
    """A cone round the form from the waist to near the floor, taken as a solid."""
    x, y, z = p.T
    wider = 0.22 * (SKIRT_TOP - y)
    cone = (np.hypot(x / (0.178 + wider), z / (0.125 + wider)) - 1.0) * 0.15
    return np.maximum(cone, np.maximum(y - SKIRT_TOP, SKIRT_HEM - y))


def make_skirt_scene(cell=0.008, noise=0.0003, floor=True, seed=0):
    """A long skirt on a short form, as a scanner sees it: no underside, and the floor only if asked for."""
    rng = np.random.default_rng(seed)
    low, high = (-0.56, -0.03, -0.36), (0.56, 0.94, 0.36)
    form = outward(*level_set(short_form_distance, low, high, cell))

    def seen(p):
        dressed = np.minimum(short_form_distance(p), skirt_distance(p))
        board = np.max(np.abs(p - [0, -0.01, 0]) - [0.5, 0.01, 0.33], axis=1)
        return np.minimum(dressed, board) if floor else dressed

    scan = outward(*level_set(seen, low, high, cell))
    v = scan.vertices
    is_skirt = (
        (np.abs(skirt_distance(v)) < 0.5 * cell) & (short_form_distance(v) > 0.5 * cell) & (v[:, 1] > 0.5 * SKIRT_HEM)
    )
    middle = v[scan.faces].mean(axis=1)
    under = np.abs(middle[:, 1] - SKIRT_HEM) < 0.75 * cell  # the cut through the solid, with its bevel
    keep = ~under & (middle[:, 1] > -0.004)
    rgb = np.where(is_skirt[:, None], [60, 90, 160], [205, 190, 170]).astype(float)
    rgb = np.clip(rgb + rng.normal(0, 6, rgb.shape), 0, 255).astype(np.uint8)
    v = v + vertex_normals(scan) * rng.normal(0, noise, (len(v), 1))
    surface, source = submesh(TriangleMesh(v, scan.faces, rgb), keep)
    on_ledge = np.abs(v[:, 1] - SKIRT_TOP) < cell
    return Scene(form, form, surface, is_skirt[source], on_ledge[source], np.eye(4))


def outward(v, f):
    mesh = TriangleMesh(v, f)
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    volume = np.einsum("ij,ij->", a, np.cross(b, c))
    return mesh if volume > 0 else TriangleMesh(v, np.ascontiguousarray(mesh.faces[:, ::-1]))


def largest(mesh):
    _, piece = face_components(mesh)
    return submesh(mesh, piece == np.argmax(np.bincount(piece)))[0]


def rigid(rotvec_deg, translation):
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_rotvec(np.deg2rad(rotvec_deg)).as_matrix()
    motion[:3, 3] = translation
    return motion
