"""Materials of a render mesh as vertex colours."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
from report_parts import tube

from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import GlbPart
from vto_pipeline.report.render_colors import join_parts

SQUARE = TriangleMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
UV = np.array([[0.0, 0.0], [0.99, 0.0], [0.99, 0.99], [0.0, 0.99]])
PICTURE = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [90, 90, 90]]], dtype=np.uint8)


def test_parts_without_colour_have_none() -> None:
    assert join_parts([GlbPart("a", SQUARE), GlbPart("b", tube(0.1, 0, 1))]).colors is None


def test_texture_is_read_from_its_upper_left() -> None:
    found = join_parts([GlbPart("a", SQUARE, uv=UV, texture=PICTURE)]).colors
    assert_array_equal(found, [[255, 0, 0], [0, 255, 0], [90, 90, 90], [0, 0, 255]])


def test_colours_multiply_in_linear_light() -> None:
    grey = TriangleMesh(SQUARE.vertices, SQUARE.faces, np.full((4, 3), 188, dtype=np.uint8))  # linear 0.5
    found = join_parts([GlbPart("a", grey, base_color=(0.5, 1.0, 0.0, 1.0))]).colors
    expected = np.tile([137, 188, 0], (4, 1))  # linear 0.25, 0.5, 0
    assert_allclose(found, expected, rtol=0, atol=1, err_msg="bytes")


def test_parts_are_joined_one_after_the_other() -> None:
    found = join_parts([GlbPart("a", SQUARE), GlbPart("b", SQUARE, base_color=(0.0, 0.0, 0.0, 1.0))])
    assert_array_equal(found.faces[2:], SQUARE.faces + 4)
    assert_array_equal(found.colors[:, 0], [255] * 4 + [0] * 4)
