"""Distances to solids against the definition of a nearest point, and against sampled surfaces."""

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose
from scipy.spatial import cKDTree

from vto_pipeline.numerics.solids import ELLIPSOID, HALF_SPACE, ROUNDED_BOX, first_touch, signed_distance

SOLIDS = {
    "half-space": (HALF_SPACE, (0.0, 0.0, 0.0, 0.0)),
    "ball": (ROUNDED_BOX, (0.0, 0.0, 0.0, 0.2)),
    "rod": (ROUNDED_BOX, (0.0, 0.3, 0.0, 0.1)),
    "box": (ROUNDED_BOX, (0.3, 0.2, 0.1, 0.0)),
    "thin box": (ROUNDED_BOX, (0.3, 0.2, 1e-4, 0.0)),
    "ellipsoid": (ELLIPSOID, (0.3, 0.2, 0.1, 0.0)),
    "disc": (ELLIPSOID, (0.3, 0.3, 0.02, 0.0)),
    "cigar": (ELLIPSOID, (0.05, 0.3, 0.05, 0.0)),
    "round ellipsoid": (ELLIPSOID, (0.2, 0.2, 0.2, 0.0)),
}


def ask(kind, size, points):
    found = [signed_distance(kind, size, tuple(p)) for p in points]
    return np.array([f[0] for f in found]), np.array([f[1] for f in found]), np.array([f[2] for f in found])


def points(seed=0, count=400):
    rng = np.random.default_rng(seed)
    some = rng.uniform(-0.45, 0.45, (count, 3))
    some[: count // 4] *= rng.integers(0, 2, (count // 4, 3))  # on planes and axes of symmetry, and in the middle
    some[count // 4 : count // 3] *= 1e-9
    return some


def surface(name):
    """Points on the surface, and how far apart they are at most [m]."""
    kind, size = SOLIDS[name]
    if kind == ELLIPSOID:
        ball = trimesh.creation.icosphere(6).vertices
        return ball * size[:3], 0.035 * max(size[:3])
    if name == "ball":
        return 0.2 * trimesh.creation.icosphere(6).vertices, 0.035 * 0.2
    if name == "rod":
        rod = trimesh.creation.capsule(0.6, 0.1, count=(128, 128)).subdivide_to_size(0.006).vertices
        return rod[:, [0, 2, 1]], 0.006
    return trimesh.creation.box(2 * np.array(size[:3])).subdivide_to_size(0.006).vertices, 0.006


@pytest.mark.parametrize("name", [name for name in SOLIDS if name != "half-space"])
def test_the_nearest_point_is_the_nearest_of_many(name):
    p = points()
    distance, on, _ = ask(*SOLIDS[name], p)
    samples, spacing = surface(name)
    nearest = cKDTree(samples).query(p)[0]
    assert (np.abs(distance) <= nearest + 1e-4).all()  # samples of the rod lie on chords of its ends
    assert (nearest <= np.abs(distance) + spacing).all()  # one of them is so near to the nearest point
    assert_allclose(cKDTree(samples).query(on)[0], 0.0, rtol=0, atol=spacing)


@pytest.mark.parametrize("name", SOLIDS)
def test_point_normal_and_sign_belong_together(name):
    p = points(1)
    distance, on, normal = ask(*SOLIDS[name], p)
    assert_allclose(np.linalg.norm(normal, axis=1), 1.0, rtol=1e-12)
    assert_allclose(p, on + distance[:, None] * normal, rtol=0, atol=1e-12)  # the way there is along the normal
    assert 20 < (distance < 0).sum() < 390 or name == "thin box"
    assert_allclose(ask(*SOLIDS[name], on)[0], 0.0, rtol=0, atol=1e-12)
    assert (ask(*SOLIDS[name], on + 1e-6 * normal)[0] > 0.99e-6).all()
    assert (ask(*SOLIDS[name], on - 1e-6 * normal)[0] < 0.0).all()


@pytest.mark.parametrize("name", SOLIDS)
def test_the_distance_is_convex(name):
    kind, size = SOLIDS[name]
    a, b = points(2), points(3)[::-1]
    middle = ask(kind, size, 0.5 * (a + b))[0]
    assert (middle <= 0.5 * (ask(kind, size, a)[0] + ask(kind, size, b)[0]) + 1e-12).all()


@pytest.mark.parametrize("name", SOLIDS)
def test_a_plane_between_what_comes_and_what_it_comes_to(name):
    kind, size = SOLIDS[name]
    a, b = points(4), points(5)[::-1]
    outside = ask(kind, size, a)[0] > 0.0
    a, b = a[outside], b[outside]
    found = [first_touch(kind, size, tuple(p), tuple(q - p)) for p, q in zip(a, b, strict=True)]
    gap, on, normal = (np.array([f[k] for f in found]) for k in range(3))
    assert_allclose(gap, np.einsum("ij,ij->i", a - on, normal), rtol=0, atol=1e-12)
    assert (gap > -1e-12).all()  # it begins before the plane
    assert_allclose(ask(kind, size, on)[0], 0.0, rtol=0, atol=1e-12)
    body = ask(kind, size, points(6))[1]  # points of the surface: all behind it, for the solid is convex
    assert (np.einsum("ijk,ik->ij", body[None] - on[:, None], normal) < 1e-9).all()
    way = a[:, None] + np.linspace(0, 1, 401)[None, :, None] * (b - a)[:, None]
    least = np.array([ask(kind, size, w)[0].min() for w in way[::8]])
    misses = least > 1e-3
    end = np.einsum("ij,ij->i", b - on, normal)[::8]
    assert (end[misses] >= least[misses] - 1e-3).all()  # what passes by is not hindered
    if name != "half-space":
        assert misses.sum() > 5
    assert (least < 0).sum() > 3
