"""What named views and turns frame, and how shadows and pictures on meshes look, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.model.mesh import Skin, TriangleMesh
from vto_pipeline.render.frames import Frame, bounds, frame_box, frame_turn, frame_view
from vto_pipeline.render.pictures import render_picture
from vto_pipeline.render.shading import KEY_LIGHT
from vto_pipeline.render.shadows import lit_share, shadow_map
from vto_pipeline.render.tint import tint


def quad(corners: list[tuple[float, float, float]]) -> TriangleMesh:
    return TriangleMesh(np.array(corners), [[0, 1, 2], [0, 2, 3]])


def card(half: float, z: float) -> TriangleMesh:
    """A square that faces the front."""
    return quad([(-half, -half, z), (half, -half, z), (half, half, z), (-half, half, z)])


def test_a_turn_keeps_its_scale_and_all_in_view() -> None:
    post = tint(card(0.5, 0.0), (0, 0, 0))
    widths = []
    for frame in frame_turn([post], 8):
        picture = render_picture([post], frame, size=(120, 160))
        dark = (picture[..., 0] < 250).any(axis=0)
        assert not dark[0]
        assert not dark[-1]
        widths.append(np.count_nonzero(dark))
    assert_allclose(widths, widths[0] * np.abs(np.cos(np.radians(45.0 * np.arange(8)))), atol=2.0)


def test_a_close_up_shows_the_upper_part_of_the_first_mesh() -> None:
    low, high = np.array([-1.0, 0.0, -1.0]), np.array([1.0, 2.0, 1.0])
    garment = TriangleMesh(np.array([low, high, (1.0, 0.0, 0.0)]), [[0, 1, 2]])
    frame = frame_view("closeup", [garment, card(50.0, -9.0)])
    assert_allclose(frame.middle, (0.0, 1.4, 0.0))
    assert frame.half == (0.5, 0.5)


@pytest.mark.parametrize(("name", "towards"), [("front", (0, 0, 1)), ("side", (1, 0, 0)), ("back", (0, 0, -1))])
def test_views_stand_where_their_names_say(name: str, towards: tuple[int, int, int]) -> None:
    seen_from = frame_view(name, [card(1.0, 0.0)]).axes[2]
    assert float(seen_from @ np.array(towards)) == pytest.approx(np.cos(np.radians(5.0)))


def test_the_shadow_of_a_square_has_its_area_and_place() -> None:
    """On a plane across the light, the shadow is the square itself; at an edge half of a broad light is seen."""
    right = np.cross([0.0, 1.0, 0.0], KEY_LIGHT)
    right /= np.linalg.norm(right)
    up = np.cross(KEY_LIGHT, right)
    corners = np.array([[-right - up, right - up, right + up], [-right - up, right + up, -right + up]])
    along = np.linspace(-1.5, 1.5, 301)
    places = along[:, None] * right - 0.5 * KEY_LIGHT
    shadow = shadow_map(corners, KEY_LIGHT)
    lit = np.array([lit_share(shadow, *place, *KEY_LIGHT) for place in places])
    dark_width = (1.0 - lit).sum() * (along[1] - along[0])
    assert dark_width == pytest.approx(2.0, abs=0.01)
    assert (lit[np.abs(along) < 0.97] == 0.0).all()
    assert (lit[np.abs(along) > 1.03] == 1.0).all()


@pytest.mark.parametrize("tilt_deg", [0.0, 45.0, 80.0])
def test_a_sheet_does_not_shade_itself(tilt_deg: float) -> None:
    right = np.cross([0.0, 1.0, 0.0], KEY_LIGHT)
    right /= np.linalg.norm(right)
    t = np.radians(tilt_deg)
    across = np.cos(t) * np.cross(KEY_LIGHT, right) + np.sin(t) * KEY_LIGHT
    normal = np.cross(right, across)
    corners = np.array(
        [[-right - across, right - across, right + across], [-right - across, right + across, -right + across]]
    )
    s = np.random.default_rng(0).uniform(-0.95, 0.95, (500, 2))
    places = s[:, :1] * right + s[:, 1:] * across
    shadow = shadow_map(corners, KEY_LIGHT)
    assert all(lit_share(shadow, *place, *normal) == 1.0 for place in places)


def test_what_stands_throws_a_shadow_on_the_ground_only() -> None:
    block = tint(quad([(-0.2, 0.0, 0.0), (0.2, 0.0, 0.0), (0.2, 1.0, 0.0), (-0.2, 1.0, 0.0)]), (40, 40, 40))
    frame = Frame(np.array([0.0, 0.5, 0.0]), (1.5, 1.0), 0.0, 30.0)
    plain = render_picture([block], frame, size=(450, 300)).astype(int)
    shaded = render_picture([block], frame, size=(450, 300), shadows=True).astype(int)
    away = (plain == 255).all(axis=2) & (shaded < 250).any(axis=2)
    rows, columns = np.nonzero(away)
    light = frame.axes.T @ KEY_LIGHT
    tip = np.array([0.2, 1.0, 0.0]) - light / light[1]  # where the upper right corner's shadow meets the ground
    x, y = frame.axes[:2] @ (tip - frame.middle) * 0.9 * 150.0  # px: a tenth is margin, and 300 px show 2 m
    assert columns.max() == pytest.approx(225.0 + x, abs=4.0)
    assert rows[columns > columns.max() - 4].mean() == pytest.approx(150.0 - y, abs=6.0)
    assert shaded[away].min() >= 160  # 0.65 of paper
    assert (shaded[:60] == 255).all()


def test_a_card_throws_a_shadow_on_the_wall_behind_it() -> None:
    """A hand's breadth before a wall, light from the viewer's upper left: a shadow of its size, to the lower right."""
    wall, hung = tint(card(1.0, 0.0), (200, 200, 200)), tint(card(0.2, 0.1), (200, 0, 0))
    frame = Frame(np.zeros(3), (0.9, 0.9), 0.0, 0.0)
    plain, shaded = (render_picture([wall, hung], frame, size=(180, 180), shadows=on).astype(int) for on in (0, 1))
    rows, columns = np.nonzero((plain - shaded).max(axis=2) > 30)
    slide = -0.1 * KEY_LIGHT[:2] / KEY_LIGHT[2] * 90.0  # px: nine tenths of 100 a metre
    assert columns.max() == pytest.approx(90 + 18 + slide[0], abs=2.0)
    assert rows.max() == pytest.approx(90 + 18 - slide[1], abs=2.0)
    hidden = (18 * 2 - slide[0]) * (18 * 2 + slide[1])
    assert len(rows) == pytest.approx((18 * 2) ** 2 - hidden, rel=0.15)


def test_a_picture_on_a_mesh_is_seen_where_its_places_say() -> None:
    red, green, blue, grey = (255, 0, 0), (0, 255, 0), (0, 0, 255), (128, 128, 128)
    picture = np.repeat(np.repeat(np.array([[red, green], [blue, grey]], dtype=np.uint8), 32, 0), 32, 1)
    square = card(1.0, 0.0)
    corner = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    painted = TriangleMesh(square.vertices, square.faces, skin=Skin(corner[square.faces], picture))
    shown = render_picture([painted], frame_box(*bounds([painted]), 0.0, 0.0), size=(80, 80), margin=0.0).astype(float)
    strongest = [shown[row, column].argmax() for row, column in ((20, 20), (20, 60), (60, 20))]
    assert strongest == [0, 1, 2]  # upper left, upper right, lower left, as in the picture
    assert np.ptp(shown[60, 60]) < 1.0
    repeated = TriangleMesh(square.vertices, square.faces, skin=Skin(corner[square.faces] + (2.0, -3.0), picture))
    again = render_picture([repeated], frame_box(*bounds([repeated]), 0.0, 0.0), size=(80, 80), margin=0.0)
    assert np.abs(again - shown)[5:-5, 5:-5].max() <= 1.0
