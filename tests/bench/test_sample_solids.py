"""Surface extraction and cutting, against closed forms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.bench.samples.solids.clip import clip_snapped
from vto_pipeline.bench.samples.solids.primitives import cone, ellipsoid, smooth_cut, smooth_union
from vto_pipeline.bench.samples.solids.surface_nets import zero_surface

BOX = np.array([-0.15, -0.15, -0.15]), np.array([0.15, 0.15, 0.15])


def edge_uses(faces):
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return np.bincount(np.unique(edges, axis=0, return_counts=True)[1])


def area_and_volume(mesh):
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum(), np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0


def test_a_sphere_comes_out_closed_outward_and_as_large_as_it_is():
    mesh = zero_surface(lambda p: np.linalg.norm(p, axis=1) - 0.1, *BOX, 0.005)
    assert edge_uses(mesh.faces).tolist() == [0, 0, len(mesh.faces) * 3 // 2]
    assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 0.1, rtol=0, atol=1e-6)  # Newton's step is exact here
    area, volume = area_and_volume(mesh)
    assert_allclose(volume, 4 / 3 * np.pi * 1e-3, rtol=2e-3, atol=0)  # facets inscribed: h²/r² = 0.25 %
    assert_allclose(area, 4 * np.pi * 1e-2, rtol=2e-3, atol=0)


def test_a_slanted_rod_tangent_to_the_grid_stays_manifold():
    # Its back line grazes grid points diagonally: the case in which four triangles would share an edge.
    end = np.array([0.1, -0.1, 0.0])
    mesh = zero_surface(lambda p: cone(p, -end, end, (0.0400000001, 0.0400000001)), *BOX, 0.005)
    assert edge_uses(mesh.faces).tolist() == [0, 0, len(mesh.faces) * 3 // 2]


def test_an_ellipsoid_is_zero_on_its_surface_with_unit_slope():
    rng = np.random.default_rng(1)
    direction = rng.normal(size=(200, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    radii = np.array([0.05, 0.08, 0.11])
    normal = direction / radii
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    on = direction * radii
    assert_allclose(ellipsoid(on, np.zeros(3), radii), 0.0, rtol=0, atol=1e-15)
    assert_allclose(ellipsoid(on + 1e-6 * normal, np.zeros(3), radii), 1e-6, rtol=1e-3, atol=0)  # first order


def test_joins_are_exact_away_from_the_fillet_and_on_the_safe_side_in_it():
    a, b = np.random.default_rng(2).uniform(-0.1, 0.1, (2, 1000))
    joined, cut = smooth_union(a, b, 0.02), smooth_cut(a, b, 0.02)
    apart = np.abs(a - b) > 0.02
    assert_allclose(joined[apart], np.minimum(a, b)[apart], rtol=0, atol=0)
    assert (joined <= np.minimum(a, b)).all()
    assert (cut >= np.maximum(a, b)).all()
    assert_allclose((np.minimum(a, b) - joined).max(), 0.005, rtol=0.05, atol=0)  # a quarter of the radius


@pytest.mark.parametrize("height", [0.0, 0.03, -0.0301])
def test_a_cut_sphere_is_a_cap_with_one_round_border(height):
    mesh = zero_surface(lambda p: np.linalg.norm(p, axis=1) - 0.1, *BOX, 0.004)
    cap = clip_snapped(mesh, mesh.vertices[:, 1] - height)
    uses = edge_uses(cap.faces)
    assert len(uses) == 3
    assert cap.vertices[:, 1].min() == pytest.approx(height, abs=1e-6)
    assert_allclose(area_and_volume(cap)[0], 2 * np.pi * 0.1 * (0.1 - height), rtol=3e-3, atol=0)  # Archimedes
    edges = np.sort(cap.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    border = cap.vertices[unique[count == 1]]
    length = np.linalg.norm(border[:, 0] - border[:, 1], axis=1)
    assert_allclose(length.sum(), 2 * np.pi * np.sqrt(0.01 - height**2), rtol=5e-3, atol=0)  # chords, snapped vertices
    assert length.min() > 0.0003  # no slivers left at the border


@pytest.mark.parametrize("seed", range(5))
def test_noise_has_a_surface_too(seed):
    """Half of all faces of such a grid are checkerboards or next to one: filling them has to come to an end."""
    rng = np.random.default_rng(seed)
    phases, waves = rng.uniform(0.0, 6.3, (12, 3)), rng.uniform(-400.0, 400.0, (12, 3))

    def noise(points):
        waving = sum(np.sin(points @ wave + phase.sum()) for wave, phase in zip(waves, phases, strict=True))
        return np.maximum(0.003 * waving, np.abs(points).max(axis=1) - 0.1)

    mesh = zero_surface(noise, np.full(3, -0.12), np.full(3, 0.12), 0.01, relaxations=0)
    assert edge_uses(mesh.faces).tolist() == [0, 0, len(mesh.faces) * 3 // 2]
