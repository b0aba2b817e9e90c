"""Pixels against rays cast one by one, and against a ball whose light has a formula."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.cpu_threads import limited_threads
from vto_pipeline.render.frames import Frame, bounds, frame_box
from vto_pipeline.render.pictures import render_picture
from vto_pipeline.render.shading import KEY_LIGHT
from vto_pipeline.render.shadows import lit_share, shadow_map

WIDTH, HEIGHT = 60, 80


@pytest.fixture(scope="module")
def soup() -> TriangleMesh:
    """Sixty triangles across each other, each of one colour that no other has, whatever the light."""
    rng = np.random.default_rng(4)
    corners = rng.uniform(-0.5, 0.5, (60, 1, 3)) + rng.uniform(-0.3, 0.3, (60, 3, 3))
    hues = np.stack([40 + 2 * np.arange(60), np.full(60, 120), 200 - 2 * np.arange(60)], axis=1)
    return TriangleMesh(
        corners.reshape(-1, 3), np.arange(180).reshape(60, 3), np.repeat(hues, 3, axis=0).astype(np.uint8)
    )


def first_hits(mesh: TriangleMesh, origins: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return the triangle that each ray meets first, -1 for none, of all triangles (Möller & Trumbore 1997)."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    across = np.cross(direction, c - a)
    scale = np.einsum("fd,fd->f", b - a, across)
    since = origins[:, None] - a
    u = np.einsum("nfd,fd->nf", since, across) / scale
    turned = np.cross(since, b - a)
    v = turned @ direction / scale
    distance = np.einsum("nfd,fd->nf", turned, c - a) / scale
    met = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 1e-9)
    return np.where(met.any(axis=1), np.where(met, distance, np.inf).argmin(axis=1), -1)


def test_each_pixel_shows_what_its_rays_meet_first(soup: TriangleMesh) -> None:
    frame = frame_box(*bounds([soup]), 30.0, 20.0)
    picture = render_picture([soup], frame, size=(WIDTH, HEIGHT), margin=0.0).astype(float)
    right, up, towards = frame.axes
    per_metre = min(0.5 * WIDTH / frame.half[0], 0.5 * HEIGHT / frame.half[1])
    column, row = np.meshgrid(np.arange(2 * WIDTH), np.arange(2 * HEIGHT))
    x = (column + 0.5) / 2 - 0.5 * WIDTH
    y = 0.5 * HEIGHT - (row + 0.5) / 2
    origins = frame.middle + (x.reshape(-1, 1) * right + y.reshape(-1, 1) * up) / per_metre + 9.0 * towards
    hit = first_hits(soup, origins, -towards).reshape(HEIGHT, 2, WIDTH, 2)
    one = (hit == hit[:, :1, :, :1]).all(axis=(1, 3))  # whose four rays meet the same
    hit = hit[:, 0, :, 0]
    assert len(np.unique(hit[one])) > 30
    assert (picture[one & (hit < 0)] == 255).all()
    seen = one & (hit >= 0)
    red, blue = soup.colors[::3, 0].astype(float), soup.colors[::3, 2].astype(float)
    shown = picture[seen][:, 0] / picture[seen][:, [0, 2]].sum(axis=1)
    assert_allclose(shown, (red / (red + blue))[hit[seen]], atol=0.02)  # bytes; dark ones have few steps


def test_light_reaches_what_no_triangle_hides(soup: TriangleMesh) -> None:
    shadow = shadow_map(soup.vertices[soup.faces], KEY_LIGHT)
    places = np.random.default_rng(5).uniform(-0.7, 0.7, (2000, 3))
    beside = np.stack([np.cross(KEY_LIGHT, [0.0, 1.0, 0.0]), np.cross(KEY_LIGHT, [1.0, 0.0, 0.0])])
    around = [places + a * beside[0] + b * beside[1] for a in (0, -0.012, 0.012) for b in (0, -0.012, 0.012)]
    around += [places + 0.012 * KEY_LIGHT]  # a place just behind a triangle counts as on it
    hidden = np.stack([first_hits(soup, one, KEY_LIGHT) >= 0 for one in around])
    clear = (hidden == hidden[0]).all(axis=0)  # no edge of a shadow is near
    lit = np.array([lit_share(shadow, *place, *KEY_LIGHT) for place in places])
    assert hidden[0][clear].sum() > 100
    assert (lit[clear] == ~hidden[0][clear]).mean() > 0.998  # a tip thinner than the rays are apart slips between


def test_a_ball_is_lit_as_its_normals_say() -> None:
    """Two lights and what comes from everywhere, by the cosine of each (Lambert), on the front of a grey ball."""
    rings = 128
    polar, angle = np.linspace(0, np.pi, rings + 1)[:, None], 2 * np.pi * np.arange(2 * rings) / (2 * rings)
    grid = np.stack([np.sin(polar) * np.sin(angle), np.cos(polar) + 0 * angle, np.sin(polar) * np.cos(angle)], -1)
    i, j = np.meshgrid(np.arange(rings), np.arange(2 * rings), indexing="ij")
    a, b = i * 2 * rings + j, i * 2 * rings + (j + 1) % (2 * rings)
    faces = np.stack([a, a + 2 * rings, b + 2 * rings, a, b + 2 * rings, b], -1).reshape(-1, 3)
    gray = np.full(grid.reshape(-1, 3).shape, 200, np.uint8)
    ball = TriangleMesh(grid.reshape(-1, 3), faces, gray)
    frame = Frame(np.zeros(3), (1.0, 1.0), 0.0, 0.0)
    picture = render_picture([ball], frame, size=(160, 160), margin=0.0)[..., 1].astype(float)
    x, y = np.meshgrid((np.arange(160) - 79.5) / 80, -(np.arange(160) - 79.5) / 80)
    inner = np.hypot(x, y) < 0.75  # nearer to the outline, the surroundings are in front, and it darkens
    normal = np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0))], axis=-1)[inner]
    light = 0.40 * (0.75 + 0.25 * normal[:, 1])
    for towards, strength in (((-0.45, 0.55, 0.70), 0.64), ((0.75, 0.15, 0.65), 0.22)):
        light += strength * np.maximum(normal @ np.array(towards) / np.linalg.norm(towards), 0.0)
    assert_allclose(picture[inner], 200 * np.minimum(light, 1.0), atol=1.5)  # bytes, and flat triangles


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one thread only")
def test_the_same_picture_whatever_the_threads(soup: TriangleMesh) -> None:
    whole = render_picture([soup], size=(120, 160), shadows=True)
    with limited_threads(1):
        assert_array_equal(render_picture([soup], size=(120, 160), shadows=True), whole)
