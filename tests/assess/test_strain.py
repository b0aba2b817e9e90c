"""Stretches against deformations whose singular values are known."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose

from vto_pipeline.assess.strain import principal_stretches, summarise_stretch
from vto_pipeline.assess.surface import face_areas, to_vertices


def sheet(n: int = 12) -> tuple[np.ndarray, np.ndarray]:
    """A flat irregular square of side 1 in the plane z = 0."""
    x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n), indexing="ij")
    points = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    points[:, :2] += np.random.default_rng(0).uniform(-0.02, 0.02, (n * n, 2))
    i, j = np.meshgrid(np.arange(n - 1), np.arange(n - 1), indexing="ij")
    a = (i * n + j).ravel()
    return points, np.vstack([np.stack([a, a + n, a + 1], 1), np.stack([a + 1, a + n, a + n + 1], 1)])


def test_uniform_stretch_is_exact() -> None:
    rest, faces = sheet()
    assert_allclose(principal_stretches(1.07 * rest, rest, faces), 1.07, rtol=1e-12, err_msg="rounding only")


def test_any_linear_map_in_space() -> None:
    rest, faces = sheet()
    rng = np.random.default_rng(1)
    matrix = rng.normal(size=(3, 2))
    moved = rest[:, :2] @ matrix.T + [1.0, 2.0, 3.0]
    expected = np.linalg.svd(matrix, compute_uv=False)
    found = principal_stretches(moved, rest, faces)
    assert_allclose(found, np.broadcast_to(expected, found.shape), rtol=1e-7, err_msg="square root of a difference")


def test_bending_does_not_stretch() -> None:
    rest, faces = sheet()
    rolled = rest[faces].copy()  # each face turned by itself
    rng = np.random.default_rng(2)
    turn, _ = np.linalg.qr(rng.normal(size=(len(faces), 3, 3)))
    rolled = np.einsum("fij,fkj->fki", turn, rolled).reshape(-1, 3)
    found = principal_stretches(rolled, rest[faces].reshape(-1, 3), np.arange(len(rolled)).reshape(-1, 3))
    assert_allclose(found, 1.0, rtol=1e-7, err_msg="rigid motions; square root of a difference")


def test_a_face_without_area_counts_as_unstretched() -> None:
    rest = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    found = principal_stretches(3 * rest, rest, np.array([[0, 1, 2]]))
    assert_allclose(found, 1.0, rtol=0, atol=0, err_msg="by definition")


def test_summary_weighs_by_area() -> None:
    # 90 % of the area at +1 %, 10 % at +8 %, in one face each
    found = summarise_stretch(np.array([1.01, 1.08]), np.array([0.9, 0.1]), 0.05)
    assert_allclose([found["median"], found["p95"], found["max"]], [0.01, 0.08, 0.08], rtol=1e-9, err_msg="rounding")
    assert_allclose(found["share_over_limit"], 0.1, rtol=1e-12, err_msg="rounding")


def test_constant_survives_the_way_to_vertices() -> None:
    rest, faces = sheet()
    areas = face_areas(rest, faces)
    found = to_vertices(np.full(len(faces), 1.3), areas, faces, len(rest) + 1)
    assert_allclose(found[:-1], 1.3, rtol=1e-12, err_msg="a mean of equal values")
    assert found[-1] == 0.0  # a vertex without a face
