"""How colours vary from place to place tells a print from a form and its shadows."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.garment.photographed.parted import warn_of_lost
from vto_pipeline.garment.photographed.sightings import SPACING, SURE, Sightings, _evidence
from vto_pipeline.garment.subtraction.color_model import cielab, color_evidence
from vto_pipeline.garment.subtraction.variety import picture_variety, surface_variety, variety_evidence
from vto_pipeline.model.garment import Opening
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

FLOWERS = np.array([[150, 145, 132], [205, 190, 170], [160, 175, 190], [190, 150, 140]], float)
SKIN = np.array([225.0, 208.0, 186.0])
SIDE, HALF = 240, 120


def dressed(cloth, spot=6):
    """A picture: cloth in spots of so many pixels on the left; a form on the right, its lower third in shade."""
    rng = np.random.default_rng(0)
    row, column = np.mgrid[:SIDE, :SIDE]
    number = rng.integers(0, len(cloth), (SIDE // spot + 1,) * 2)[row // spot, column // spot]
    shade = np.where(row > 160, 0.7, 1.0)[..., None]
    picture = np.where((column < HALF)[..., None], cloth[number], SKIN * shade) + rng.normal(0, 2, (SIDE, SIDE, 3))
    on_cloth = column < HALF
    return np.clip(picture, 0, 255).astype(np.uint8), on_cloth, ~on_cloth, row > 163


def test_a_shadow_on_the_form_is_not_cloth_of_its_grey():
    picture, cloth, form, shade = dressed(FLOWERS)
    evidence = _evidence(picture, cloth, form)
    assert np.mean(evidence[form & shade] < -SURE) > 0.95
    assert np.mean(evidence[form & ~shade] < -SURE) > 0.95
    assert np.isnan(evidence[cloth]).all()


@pytest.mark.parametrize(("cloth", "tells"), [([[40, 60, 150]], True), ([SKIN], False)])
def test_plain_cloth_is_told_by_its_colour_or_not_at_all(cloth, tells):
    picture, on_cloth, form, _ = dressed(np.array(cloth, float))
    evidence = _evidence(picture, on_cloth, form)
    assert (evidence is not None) == tells
    assert not tells or np.mean(evidence[form] < -SURE) > 0.95


@pytest.mark.parametrize("times", [0.6, 1.0, 1.45])
def test_cloth_in_other_light_than_any_that_is_known_keeps_its_hue(times):
    """A shoulder under lamps, or the inside of a fold: cloth and skin, as light or dark as none that was learnt."""
    rng = np.random.default_rng(0)

    def lit(color, by):
        return np.array(color) * by * rng.uniform(0.9, 1.1, (400, 1)) + rng.normal(0, 3, (400, 3))

    colors = np.concatenate([lit([110, 135, 170], 1.0), lit([170, 140, 120], 1.0), lit([110, 135, 170], times)])
    colors = np.clip(np.concatenate([colors, lit([170, 140, 120], times)]), 0, 255).astype(np.uint8)
    of = np.repeat(np.arange(4), 400)
    evidence = color_evidence(colors, of == 0, of == 1)
    assert np.mean(evidence[of == 2] > SURE) > 0.95
    assert np.mean(evidence[of == 3] < -SURE) > 0.95


def test_one_hue_is_still_told_by_how_light_it_is():
    """White cloth on a grey form."""
    grey = np.random.default_rng(0).normal(np.repeat([235.0, 120.0], 400)[:, None], 4.0, (800, 3))
    cloth = np.arange(800) < 400
    evidence = color_evidence(np.clip(grey, 0, 255).astype(np.uint8), cloth, ~cloth)
    assert np.mean(evidence[cloth] > SURE) > 0.95
    assert np.mean(evidence[~cloth] < -SURE) > 0.95


def test_variety_of_a_picture_is_that_of_each_square_by_itself():
    picture, cloth, _, _ = dressed(FLOWERS)
    found = picture_variety(picture, cloth, 15)
    for row, column in ((30, 30), (100, 60), (200, 118)):  # the last beside the form, which does not count
        square = np.s_[row - 7 : row + 8, column - 7 : column + 8]
        chroma = cielab(picture[square][cloth[square]])[:, 1:]
        assert_allclose(found[row, column], np.sqrt(chroma.var(axis=0).sum()), rtol=1e-3)


@pytest.mark.parametrize("step", [0.002, 0.004])
def test_variety_of_a_surface_is_that_of_its_print_and_of_each_material_by_itself(step):
    """In spots far smaller than its reach a print of two colours varies by half their distance, wherever."""
    count = round(0.2 / step) + 1
    row, column = np.mgrid[:count, :count]
    number = (row * count + column)[:-1, :-1].ravel()
    quads = np.column_stack([number, number + 1, number + count, number + count + 1])
    faces = np.vstack([quads[:, [0, 1, 2]], quads[:, [1, 3, 2]]])
    place = step * np.column_stack([column.ravel(), row.ravel()])
    cloth = place[:, 0] < 0.1
    two = np.array([[150, 60, 60], [60, 60, 150]], np.uint8)
    colors = np.where(cloth[:, None], two[np.random.default_rng(0).integers(0, 2, len(place))], [128, 128, 128])
    surface = TriangleMesh(np.column_stack([place, np.zeros(len(place))]), faces, colors.astype(np.uint8))
    found = surface_variety(surface, cloth)
    half = 0.5 * np.linalg.norm(np.diff(cielab(two)[:, 1:], axis=0))
    assert_allclose(np.median(found[cloth]), half, rtol=0.05)
    assert found[~cloth].max() < 0.05  # up to the border, over which nothing passes
    evidence = variety_evidence(found, cloth, ~cloth)
    assert evidence[cloth].min() > SURE
    assert evidence[~cloth].max() < -SURE


@pytest.mark.parametrize(("wide", "warned"), [(0.10, True), (0.03, False)])
def test_cloth_that_photos_show_below_a_neck_is_warned_of_though_it_parts_nothing(wide, warned):
    """A bay of so many metres in the rim of a sheet; around it the mannequin is bare."""
    grid = SPACING * np.mgrid[-40:41, -40:41].reshape(2, -1).T
    points = np.column_stack([grid, np.zeros(len(grid))])
    bay = (np.abs(grid[:, 0]) < wide / 2) & (np.abs(grid[:, 1]) < wide / 2)
    garment = points[(grid[:, 1] < -wide / 2) | ((np.abs(grid[:, 0]) > wide / 2) & (grid[:, 1] < wide / 2))]
    bare = ~bay & (grid[:, 1] > wide / 2)
    sightings = Sightings(points[bay | bare], bay[bay | bare], SPACING**2)
    mesh, job = TriangleMesh(garment, [[0, 1, 2]]), Job()
    rim = Opening(np.arange(20), 1.5, np.zeros(3), np.array([0.0, 1.0, 0.0]))
    warn_of_lost(sightings, mesh, [rim], job)
    assert len(job.warnings) == warned
    area = bay.sum() * SPACING**2 * 1e4
    assert all(f"1500 mm at (0.00, 0.00, 0.00) m is uncertain: photos show {area:.0f} cm²" in w for w in job.warnings)
