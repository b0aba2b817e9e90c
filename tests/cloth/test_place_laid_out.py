"""Sewn patterns go where their file has them, at the wearer's stature, and no garment goes where arms pierce it."""

import numpy as np
import pytest
from cloth_scenes import moved, tube
from figures import SHOULDER, arm_end, figure
from numpy.testing import assert_allclose

from vto_pipeline.cloth.drape_config import DrapeConfig
from vto_pipeline.cloth.placement.place import PlaceConfig, find_placement, place_garment
from vto_pipeline.cloth.placement.thinning import Thinning
from vto_pipeline.model.garment import Garment, RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

BELOW, RADIUS = 1.0, 0.19  # of the arms [rad]; of a skirt that the trunk and the hips fill [m]
CUBE = 0.015


def skirt(top):
    return tube(RADIUS, 0.4, 48, 21, base=top - 0.4)


def height_of_arms():
    """Where the middle of an arm meets the skirt's cylinder, in closed form."""
    shoulder, hand = SHOULDER, arm_end(1.0, BELOW)
    return float(np.interp(RADIUS, [shoulder[0], hand[0]], [shoulder[1], hand[1]]))


def top_and_bottom(placement, garment):
    y = placement.start_positions(garment.vertices)[:, 1]
    return y.max(), y.min()


@pytest.mark.parametrize("origin", [0.0, 1.15])
@pytest.mark.parametrize("stature", [1.4, 1.7])
def test_a_skirt_goes_to_the_height_of_its_file(origin, stature):
    """Its top is at 1.0 m on a body of 1.72 m, counted from the floor or from the origin of SMPL's template."""
    body = figure(BELOW)
    tall = np.ptp(body.vertices[:, 1])
    body = moved(TriangleMesh(body.vertices * stature / tall, body.faces), 0.4, 0.7, -0.3)
    drawn = skirt(1.0 - origin)
    drawn = TriangleMesh(drawn.vertices * [stature / tall, 1.0, stature / tall], drawn.faces)
    job = Job()
    placement = find_placement(drawn, body, PlaceConfig(), job, laid_out=True)
    top, _ = top_and_bottom(placement, drawn)
    meant = body.vertices[:, 1].min() + stature * 1.0 / 1.72
    assert meant - 0.12 - CUBE <= top <= meant + 0.03 + CUBE
    assert_allclose(placement.shift[[0, 2]], [0.4, -0.3], rtol=0, atol=0.03)
    assert (placement.scale, placement.stretch) == (1.0, 1.0)
    assert "where its file has it" in job.notes[-1]


def test_where_a_file_has_arms_go_through_cloth_another_height_is_taken():
    arms = height_of_arms()
    drawn, job = skirt(arms + 0.25), Job()
    top, bottom = top_and_bottom(find_placement(drawn, figure(BELOW), PlaceConfig(), job, laid_out=True), drawn)
    assert not bottom < arms < top
    assert any("fewer limbs" in note for note in job.notes)


def test_a_mesh_whose_best_place_has_arms_through_it_goes_to_another_height():
    """A trunk fills a loose skirt better than the hips do. Without arms it stays there."""
    loose, job, body = skirt(1.3), Job(), figure(BELOW)
    arms = height_of_arms()
    top, bottom = top_and_bottom(find_placement(loose, body, PlaceConfig(), job), loose)
    assert not bottom < arms < top
    assert any("fewer limbs" in note for note in job.notes)
    assert find_placement(loose, figure(1.5), PlaceConfig(), Job()).shift[1] == 0.0


def cone(radius, slope, top, length=0.5, shoulder=0.13):
    """Cloth from an oval opening outward and down: of one slope [rad] at first, then steep; as long all around."""
    mesh = tube(1.0, length, 48, 31)
    along = length - mesh.vertices[:, 1:2]
    first, later = np.minimum(along, shoulder), np.maximum(along - shoulder, 0.0)
    wide = radius + first * np.cos(slope) + later * np.cos(1.35)
    height = top - first * np.sin(slope) - later * np.sin(1.35)
    return TriangleMesh(np.hstack([wide * mesh.vertices[:, :1], height, 0.7 * wide * mesh.vertices[:, 2:]]), mesh.faces)


@pytest.mark.parametrize("radius", [0.1, 0.14, 0.17])
def test_what_lies_on_shoulders_stays_there_though_it_is_wide_enough_for_the_waist(radius):
    """A poncho: arms that hang go through its cloth there, too. The figure's trunk has a radius of 0.14 m."""
    poncho = cone(radius, 0.5, 1.45)
    found = find_placement(poncho, figure(BELOW), PlaceConfig(), Job())
    assert top_and_bottom(found, poncho)[0] > SHOULDER[1]


@pytest.mark.parametrize("radius", [0.06, 0.09, 0.15])
def test_what_hangs_goes_below_the_arms_though_it_is_too_narrow_for_the_waist(radius):
    """The head fills the narrow ones best, and the chest the wide one."""
    skirt, job = cone(radius, 1.35, 1.6), Job()
    found = find_placement(skirt, figure(BELOW), PlaceConfig(), job)
    top, bottom = top_and_bottom(found, skirt)
    assert 0.9 < top < SHOULDER[1]
    assert bottom > 0.3
    assert radius > 0.12 or job.metrics["needs_larger_share"] > 0.1
    assert found.stretch == 1.0


def test_a_bib_may_end_above_the_arms_that_pass_beside_it():
    """A tube is in the way of both arms. Not so one that rises as high in front and behind, and ends below them."""
    below, above = height_of_arms() - 0.1, SHOULDER[1]
    level = tube(0.16, 0.6, 48, 31, base=below - 0.6)
    rises = (level.vertices[:, 2:] / 0.16) ** 4 * (level.vertices[:, 1:2] - below + 0.6) / 0.6
    bib = TriangleMesh(level.vertices + (above - below) * rises * [0.0, 1.0, 0.0], level.faces)
    thinning = Thinning(figure(BELOW))
    assert thinning.limbs_out_of_place(moved(level, 0.0, above - below, 0.0)) == 2
    assert thinning.limbs_out_of_place(bib) == 0


@pytest.mark.parametrize("top", [2.35, 3.0])
def test_what_lies_beside_the_body_wherever_the_file_has_it_is_looked_for(top):
    body = figure(BELOW)
    high, job = skirt(top), Job()
    found = find_placement(high, body, PlaceConfig(), job, laid_out=True)
    assert top_and_bottom(found, high)[0] < 1.7
    assert not any("where its file has it" in note for note in job.notes)


def test_a_place_that_was_chosen_by_hand_is_kept():
    drawn = skirt(1.0 - 1.15)
    rest = RestShape(drawn.vertices)
    kept = place_garment(Garment(drawn, rest, True), figure(BELOW), DrapeConfig(place="as_it_stands"), Job())
    assert_allclose(kept.mesh.vertices, drawn.vertices, rtol=0, atol=0)
    placed = place_garment(Garment(drawn, rest, True), figure(BELOW), DrapeConfig(), Job())
    assert placed.mesh.vertices[:, 1].max() == pytest.approx(1.0, abs=0.15)


def test_a_pattern_found_on_a_body_stays_where_it_was_worn():
    """A loose skirt is filled as well some way off, and its file was drawn for no other stature."""
    drawn, job = skirt(1.0), Job()
    body = figure(BELOW)
    body = TriangleMesh(body.vertices * 0.9, body.faces)
    kept = place_garment(Garment(drawn, RestShape(drawn.vertices), True, True), body, DrapeConfig(), job)
    assert_allclose(kept.mesh.vertices, drawn.vertices, rtol=0, atol=0)
    assert "were worn" in job.notes[-1]
    moved_off = place_garment(Garment(drawn, RestShape(drawn.vertices), True), body, DrapeConfig(), Job())
    assert abs(moved_off.mesh.vertices - drawn.vertices).max() > CUBE


@pytest.mark.parametrize("shift", [(0.0, 1.5, 0.0), (1.0, 0.0, 0.0)])
def test_a_pattern_found_on_another_body_is_moved_to_this_one(shift):
    """Above the head, or beside: the body is not in it there."""
    drawn = moved(skirt(1.0), *shift)
    found = find_placement(drawn, figure(BELOW), PlaceConfig(), Job(), laid_out=True, worn=True)
    top, _ = top_and_bottom(found, drawn)
    assert 0.5 < top < SHOULDER[1]
    assert_allclose(found.start_positions(drawn.vertices)[:, 0].mean(), 0.0, rtol=0, atol=0.1)
