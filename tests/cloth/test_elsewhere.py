"""A garment that ends far from where it was put on is told of, with the girths of both."""

import numpy as np
import pytest
from cloth_scenes import moved, tube
from numpy.testing import assert_allclose

from vto_pipeline.cloth.judge.elsewhere import girth_at, warn_if_elsewhere
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

CORNERS = 48


def round_a_circle(radius):
    """The perimeter of the polygon that stands for a circle [m]."""
    return 2 * CORNERS * radius * np.sin(np.pi / CORNERS)


def bottle():
    """A trunk of radius 0.2 m up to 1.2 m, a neck of 0.05 m up to 1.7 m, and an arm beside it."""
    trunk, neck = tube(0.2, 1.2, CORNERS, 5), tube(0.05, 0.5, CORNERS, 5, base=1.2)
    arm = moved(tube(0.04, 1.0, CORNERS, 5, base=0.3), 0.4, 0.0, 0.0)
    parts, faces, first = [trunk, neck, arm], [], 0
    for part in parts:
        faces.append(part.faces + first)
        first += len(part.vertices)
    return TriangleMesh(np.vstack([part.vertices for part in parts]), np.vstack(faces).astype(np.int32))


@pytest.mark.parametrize(
    ("place", "radius"), [((0.0, 0.7, 0.0), 0.2), ((0.02, 1.45, 0.0), 0.05), ((0.37, 0.7, 0.1), 0.04)]
)
def test_the_girth_is_that_of_the_part_which_is_nearest(place, radius):
    assert_allclose(girth_at(bottle(), np.array(place)), round_a_circle(radius), rtol=1e-9)


def test_above_the_body_there_is_no_girth():
    assert girth_at(bottle(), np.array([0.0, 2.0, 0.0])) == 0.0


@pytest.mark.parametrize(("risen", "told"), [(0.7, "70 cm above"), (-0.3, "30 cm below"), (0.1, ""), (-0.1, "")])
def test_what_ends_elsewhere_is_told_with_girths(risen, told):
    garment, job = tube(0.1, 0.3, CORNERS, 7, base=0.5), Job()  # its opening at 0.8 m
    found = warn_if_elsewhere(garment, moved(garment, 0.0, risen, 0.0), RestShape(garment.vertices), bottle(), job)
    assert_allclose(found["risen_mm"], 1e3 * risen, rtol=0, atol=1e-6)
    assert bool(told) == bool(job.warnings)
    if told:
        there = 0.05 if risen > 0.5 else 0.2
        own, ended, began = (f"{100 * round_a_circle(radius):.0f} cm" for radius in (0.1, there, 0.2))
        assert told in job.warnings[0]
        assert f"Its upper opening is {own} around, and the body {ended} there, {began} where" in job.warnings[0]


def test_what_only_an_arm_took_along_is_not_elsewhere():
    """The upper third went down, laid on an arm; the rest stays."""
    garment, job = tube(0.1, 0.3, CORNERS, 7, base=0.5), Job()
    led = garment.vertices - np.where(garment.vertices[:, 1:2] > 0.7, [0.0, 0.4, 0.0], 0.0)
    found = warn_if_elsewhere(garment, TriangleMesh(led, garment.faces), RestShape(garment.vertices), bottle(), job)
    assert_allclose(found["risen_mm"], -400.0, rtol=0, atol=1e-6)
    assert job.warnings == []


def test_the_girth_of_a_garment_with_panels_is_theirs():
    """Sewn, it lay half as large as it is cut."""
    garment, job = tube(0.1, 0.3, CORNERS, 7, base=0.5), Job()
    a, b, c = garment.vertices[garment.faces].transpose(1, 0, 2)
    far, near = np.linalg.norm(b - a, axis=1), c - a
    along = np.einsum("fi,fi->f", near, b - a) / far
    aside = np.sqrt((near**2).sum(axis=1) - along**2)
    none = np.zeros_like(far)
    panels = 2.0 * np.stack([np.stack([none, none], 1), np.stack([far, none], 1), np.stack([along, aside], 1)], 1)
    rest = RestShape(garment.vertices, mode="panels", panels=panels)
    warn_if_elsewhere(garment, moved(garment, 0.0, 0.7, 0.0), rest, bottle(), job)
    assert f"Its upper opening is {200 * round_a_circle(0.1):.0f} cm around" in job.warnings[0]


def test_where_nothing_is_open_nothing_is_told():
    sheet = TriangleMesh(np.array([[0.0, 0, 0], [0.01, 0, 0], [0, 0.01, 0]]), np.array([[0, 1, 2]], np.int32))
    assert warn_if_elsewhere(sheet, moved(sheet, 0, 1.0, 0), RestShape(sheet.vertices), bottle(), Job()) == {}
