"""Breaking ties of collapsed starts."""

import numpy as np
import pytest
from cloth_scenes import fabric, sheet
from numpy.testing import assert_array_equal

from vto_pipeline.cloth.collision.contacts import empty_contacts
from vto_pipeline.cloth.dynamics.methods import METHODS
from vto_pipeline.cloth.model.build import at_rest, build_cloth
from vto_pipeline.cloth.model.materials import Materials
from vto_pipeline.cloth.placement.collapsed_start import expand_collapsed_triangles
from vto_pipeline.model.garment import RestShape


def areas(x, faces):
    a, b, c = (x[faces[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


MESH = sheet(6, 6, 0.5, 0.5)


def test_a_cloth_that_is_not_collapsed_stays_as_it_is_to_the_bit():
    for start in (MESH.vertices, 1e-7 * MESH.vertices, MESH.vertices * [1.0, 1e-6, 1.0]):
        assert_array_equal(expand_collapsed_triangles(start, MESH.vertices, MESH.faces), start)


@pytest.mark.parametrize("scale", [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)], ids=["point", "line"])
def test_every_triangle_gets_an_area_and_a_side_out_of_the_plane(scale):
    start = MESH.vertices * scale
    found = expand_collapsed_triangles(start, MESH.vertices, MESH.faces)
    assert areas(found, MESH.faces).min() > 0.0
    assert np.ptp(found[:, 2]) > 0.0
    assert 1e-6 < np.abs(found - start).max() < 1e-4  # a ten-thousandth of half the diagonal is 3.5e-5 m
    assert_array_equal(found, expand_collapsed_triangles(start, MESH.vertices, MESH.faces))


def test_only_collapsed_corners_move_and_none_that_is_held():
    start = MESH.vertices.copy()
    face = MESH.faces[7]
    start[face] = start[face].mean(axis=0)
    found = expand_collapsed_triangles(start, MESH.vertices, MESH.faces, pinned=[int(face[0])])
    touched = MESH.faces[np.isin(MESH.faces, face).sum(axis=1) >= 2]  # two corners in one place leave no area either
    assert set(np.flatnonzero((found != start).any(axis=1))) == set(touched.ravel().tolist()) - {int(face[0])}


def test_a_triangle_without_area_at_rest_is_not_opened():
    rest = MESH.vertices.copy()
    rest[MESH.faces[7, 1]] = rest[MESH.faces[7, 0]]
    assert_array_equal(expand_collapsed_triangles(rest, rest, MESH.faces), rest)


@pytest.mark.parametrize("membrane", ["green", "springs"])
def test_a_sheet_grows_from_a_point_and_would_not_by_itself(membrane):
    materials = Materials.model_validate({"membrane": membrane})
    model = build_cloth(MESH, RestShape(MESH.vertices), fabric(bending=0.05), gravity=(0, 0, 0), materials=materials)
    point, whole = np.zeros_like(MESH.vertices), areas(MESH.vertices, MESH.faces).sum()

    def grown(start):
        state = METHODS["xpbd"](model, damping=2.0).advance(at_rest(start), empty_contacts(len(start)), 1 / 1200, 600)
        return areas(state.positions, MESH.faces).sum() / whole

    assert grown(point) == 0.0
    assert 0.8 < grown(expand_collapsed_triangles(point, MESH.vertices, MESH.faces)) < 1.2  # still swinging
