"""Photos of a drape test: areas that are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from PIL import Image

from vto_pipeline.errors import InputError
from vto_pipeline.io.fabric_formats.drape_photo import read_shadow_area

SIZE = 700


def picture(path, radius=180.0, waves=0.15, dark=True, tilt=1.0, slope=0.0, at=(350.0, 340.0), noise=4.0, hole=False):
    """A thing whose rim is radius (1 + waves cos 5φ), seen askew: its area is π radius² (1 + waves²/2) tilt."""
    y, x = np.mgrid[0:SIZE, 0:SIZE].astype(float)
    dx, dy = x - at[0], (y - at[1]) / tilt
    inside = np.hypot(dx, dy) < radius * (1.0 + waves * np.cos(5.0 * np.arctan2(dy, dx)))
    if hole:  # a glint
        inside &= np.hypot(dx - 40.0, dy) > 25.0
    tone = np.where(inside == dark, 60.0, 200.0) + slope * (x / SIZE - 0.5)
    tone += np.random.default_rng(0).normal(0.0, noise, tone.shape)
    Image.fromarray(np.clip(tone, 0, 255).astype(np.uint8)).convert("RGB").save(path)
    return np.pi * radius**2 * (1.0 + waves**2 / 2.0) * tilt


@pytest.mark.parametrize(
    "made", [{}, {"dark": False}, {"slope": 60.0}, {"noise": 20.0}, {"hole": True}, {"tilt": 0.9}], ids=str
)
def test_the_area_is_that_of_the_closed_form(made, tmp_path):
    area = picture(tmp_path / "a.png", **made)
    assert_allclose(read_shadow_area(tmp_path / "a.png"), area, rtol=4e-3)  # a rim of 1300 px, half a pixel wrong


def test_a_bare_disc_tells_the_scale_seen_askew_too(tmp_path):
    """The coefficient of a view from the side is that from above, where the disc is seen from there as well."""
    shadow = picture(tmp_path / "shadow.png", tilt=0.85)
    disc = picture(tmp_path / "disc.png", radius=120.0, waves=0.0, tilt=0.85)
    ratio = read_shadow_area(tmp_path / "shadow.png") / read_shadow_area(tmp_path / "disc.png")
    assert_allclose(ratio, shadow / disc, rtol=5e-3)


@pytest.mark.parametrize(
    ("made", "problem"),
    [
        ({"at": (120.0, 340.0)}, "touches the picture's edge"),
        ({"radius": 60.0}, "no shadow of"),
        ({"radius": 0.0, "slope": 100.0}, "does not stand out"),
    ],
)
def test_what_is_refused(made, problem, tmp_path):
    picture(tmp_path / "a.png", **made)
    with pytest.raises(InputError, match=problem):
        read_shadow_area(tmp_path / "a.png")


def test_two_things_are_refused(tmp_path):
    picture(tmp_path / "a.png", radius=120.0, at=(200.0, 340.0))
    one = np.array(Image.open(tmp_path / "a.png"))
    picture(tmp_path / "b.png", radius=60.0, at=(550.0, 340.0))
    Image.fromarray(np.minimum(one, np.array(Image.open(tmp_path / "b.png")))).save(tmp_path / "c.png")
    with pytest.raises(InputError, match="more than one thing"):
        read_shadow_area(tmp_path / "c.png")
