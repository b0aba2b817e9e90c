"""Ease at each vertex, on a tube about a cone."""

from __future__ import annotations

import numpy as np
from assess_shapes import shifted, tube
from numpy.testing import assert_allclose

from vto_pipeline.assess.ease_map import ease_map
from vto_pipeline.geometry.topology import concatenate
from vto_pipeline.model.mesh import TriangleMesh


def cone() -> TriangleMesh:
    """A body whose radius falls from 0.20 m at the floor by 0.05 m a metre."""
    mesh = tube(1.0, 1.0, 0.0, 1.8, rings=37)
    radius = 0.20 - 0.05 * mesh.vertices[:, 1:2]
    return TriangleMesh(mesh.vertices * np.hstack([radius, np.ones_like(radius), radius]), mesh.faces)


def test_ease_grows_as_the_body_narrows() -> None:
    garment, body = tube(0.22, 0.22, 0.4, 1.4, rings=41), cone()
    every = np.ones(len(garment.faces), dtype=bool), np.ones(len(body.faces), dtype=bool)
    found = ease_map(garment, garment.vertices, body, *every)
    y = garment.vertices[:, 1]
    wanted = 2.0 * np.pi * (0.22 - (0.20 - 0.05 * y))
    inner = (y > 0.42) & (y < 1.38)  # beyond the outermost levels it is theirs
    assert_allclose(found[inner], wanted[inner], rtol=0, atol=4e-4)  # 256-gons
    assert_allclose(found, wanted, rtol=0, atol=2e-2 * 2.0 * np.pi * 0.05)  # at most a level away


def test_what_is_no_trunk_has_no_ease() -> None:
    garment = concatenate([tube(0.22, 0.22, 0.4, 1.4), shifted(tube(0.06, 0.06, 1.0, 1.3), (0.5, 0.0, 0.0))])
    on_trunk = np.abs(garment.vertices[garment.faces].mean(axis=1)[:, 0]) < 0.3
    body = cone()
    found = ease_map(garment, garment.vertices, body, on_trunk, np.ones(len(body.faces), dtype=bool))
    sleeve = garment.vertices[:, 0] > 0.4
    assert np.isnan(found[sleeve]).all()
    assert np.isfinite(found[~sleeve]).all()


def test_a_garment_without_trunk_has_none() -> None:
    garment, body = tube(0.22, 0.22, 0.4, 1.4), cone()
    none = np.zeros(len(garment.faces), dtype=bool)
    assert np.isnan(ease_map(garment, garment.vertices, body, none, np.ones(len(body.faces), dtype=bool))).all()
