"""A hem that stands off a pole: a scan slopes from it down to the pole, and the slope is cut away. A cuff is not."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.special import ndtr
from test_openings import arm, sleeve

from vto_pipeline.garment.bare_parts import BareParts
from vto_pipeline.garment.falls import trim_falls
from vto_pipeline.geometry.topology import boundary_loops, submesh
from vto_pipeline.model.garment import SurfaceLabels
from vto_pipeline.model.mesh import TriangleMesh

POLE, OFF, NOISE = 0.08, 0.01, 0.0003
"""Its radius, how far cloth stands off, and the scan's noise [m]."""
TOP, HEM, BLUR = 0.4, 0.203, 0.003
"""Heights of the scan's top and of the hem, and how far a scan blurs an edge [m]."""
BLUE, SKIN, BEIGE = (25, 45, 85), (145, 118, 100), (160, 130, 105)


def scanned(fall, cloth, mixed):
    """A pole in cloth: the scan, and which of it was labelled cloth.

    Args:
        fall: Share of `OFF` at heights over the hem (N,).
        cloth: Its colour.
        mixed: Share of the cloth's colour at these heights.
    """
    rng = np.random.default_rng(0)
    pipe = sleeve(POLE, TOP, 125, 101)
    over = pipe.vertices[:, 1] - HEM
    out = pipe.vertices * [1, 0, 1] / POLE
    vertices = pipe.vertices + out * (OFF * fall(over) + rng.normal(0, NOISE, len(out)))[:, None]
    share = mixed(over)[:, None]
    colors = np.clip(share * cloth + (1 - share) * SKIN + rng.normal(0, 8, vertices.shape), 0, 255)
    return TriangleMesh(vertices, pipe.faces, colors.astype(np.uint8)), OFF * fall(over) > 0.0015


def trimmed(fall, cloth, mixed):
    """The shell before and after, and the heights of its lower rim over the hem [m]."""
    form = arm(POLE)
    scan, on_cloth = scanned(fall, np.array(cloth), mixed)
    shell, _ = submesh(scan, on_cloth[scan.faces].all(axis=1))
    bare = BareParts(scan, SurfaceLabels(on_cloth, np.ones(len(on_cloth))), form)
    after = trim_falls(shell, form, bare)
    lower = min((after.vertices[loop, 1] for loop in boundary_loops(after)), key=np.mean)
    return shell, after, lower - HEM


def blurred(over):
    return ndtr(over / BLUR)


def by_and_by(over):
    return np.clip(0.1 + over / 0.05, 0.0, 1.0)


def test_the_slope_under_a_hem_is_cut_away():
    before, after, rim = trimmed(blurred, BLUE, blurred)
    lowest = before.vertices[:, 1].min() - HEM
    assert lowest < -0.0025
    assert_allclose(rim, 0.0, rtol=0, atol=0.0025)
    assert_allclose(after.vertices[:, 1].max(), TOP)


@pytest.mark.parametrize(
    ("fall", "cloth", "mixed"),
    [
        (blurred, BLUE, lambda over: np.where(blurred(over) > 0.1, 1.0, 0.0)),
        (blurred, BEIGE, blurred),
        (by_and_by, BLUE, lambda over: ndtr((over + 0.005) / BLUR)),
    ],
    ids=["a cuff drawn in within a centimetre", "of the form's colour", "cloth that comes close by and by"],
)
def test_cloth_that_comes_close_stays(fall, cloth, mixed):
    before, after, _ = trimmed(fall, cloth, mixed)
    assert after is before


def test_without_colours_nothing_is_cut():
    form = arm(POLE)
    scan, on_cloth = scanned(blurred, np.array(BLUE), blurred)
    plain = TriangleMesh(scan.vertices, scan.faces)
    shell, _ = submesh(plain, on_cloth[plain.faces].all(axis=1))
    bare = BareParts(plain, SurfaceLabels(on_cloth, np.ones(len(on_cloth))), form)
    assert trim_falls(shell, form, bare) is shell
