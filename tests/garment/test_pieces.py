"""Garments of several pieces, scraps beside them, and garments that were torn."""

from __future__ import annotations

import dressed_form
import numpy as np
import pytest
from numpy.testing import assert_allclose
from test_openings import RADIUS, arm, punched, sleeve

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.bare_parts import BareParts
from vto_pipeline.garment.openings import OpeningsConfig, close_scan_holes
from vto_pipeline.garment.subtraction.subtract import SubtractConfig, extract_garment, label_garment
from vto_pipeline.geometry.remeshing.holes import fill_holes
from vto_pipeline.geometry.remeshing.repair import is_manifold
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_walks, concatenate, face_components, half_edges, submesh
from vto_pipeline.model.garment import SurfaceLabels
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

AROUND = 2 * np.pi * RADIUS  # of the tubes [m]
NECK, TOP_HEM, WAIST, HEM = 0.80, 0.52, 0.44, 0.22  # heights of the dressed form's pieces [m]


def tube(low, high):
    """Round the arm, from one height to another."""
    return moved(sleeve(height=high - low, along=round((high - low) / 0.005) + 1), [0, low, 0])


def moved(mesh, by):
    return TriangleMesh(mesh.vertices + np.array(by), mesh.faces)


def sheet(low, high, turn):
    """A part of such a tube that goes round a share of a turn only."""
    whole = tube(low, high)
    x, _, z = whole.vertices[whole.faces].mean(axis=1).T
    return submesh(whole, np.mod(np.arctan2(x, z), 2 * np.pi) < 2 * np.pi * turn)[0]


def closed(parts, job, form=None, bare=None, **settings):
    return close_scan_holes(concatenate(parts), form or arm(), OpeningsConfig(**settings), job, bare)


def test_two_pieces_keep_their_openings_and_their_cloth():
    job = Job()
    garment, openings, observed = closed([tube(0.0, 0.2), tube(0.25, 0.37)], job, expected=4)
    assert face_components(garment)[0] == 2
    assert_allclose([one.center[1] for one in openings], [0.37, 0.25, 0.2, 0.0], atol=1e-3)
    assert_allclose([one.perimeter for one in openings], AROUND, rtol=0.01)
    assert observed.all()
    assert_allclose(job.metrics["unobserved_share"], 0.0, atol=1e-9)
    assert not job.warnings


def test_without_a_mannequin_too():
    job = Job()
    shell = concatenate([tube(0.0, 0.2), tube(0.3, 0.42)])
    garment, openings, _ = close_scan_holes(shell, None, OpeningsConfig(), job)
    assert face_components(garment)[0] == 2
    assert_allclose([one.center[1] for one in openings], [0.42, 0.3, 0.2, 0.0], atol=1e-3)


@pytest.mark.parametrize(("keep", "heights"), [(4, [0.37, 0.25, 0.2, 0.0]), (5, [0.37, 0.25, 0.2, 0.1, 0.0])])
def test_openings_that_are_kept_are_counted_over_all_pieces(keep, heights):
    torn = punched(tube(0.0, 0.2), [[RADIUS, 0.1, 0.0]], 0.03)
    _, openings, _ = closed([torn, tube(0.25, 0.37)], Job(), keep=keep, least_perimeter_mm=0)
    assert_allclose([one.center[1] for one in openings], heights, atol=0.01)


@pytest.mark.parametrize(("height", "warned"), [(0.04, False), (0.1, True)])
def test_a_scrap_is_left_out_and_counts_as_not_seen(height, warned):
    """Half of a way round: 6.25 and 13.5 % of the cloth there is; the second is no crumb."""
    job = Job()
    garment, openings, _ = closed([tube(0.0, 0.3), sheet(0.34, 0.34 + height, 0.5)], job)
    assert face_components(garment)[0] == 1
    assert len(openings) == 2
    lost = 0.5 * height / (0.3 + 0.5 * height)
    assert_allclose(job.metrics["unobserved_share"], lost, rtol=0.05)  # the rims of the tube are smoothed
    assert_allclose(job.metrics["filled_share"], 0.0, atol=1e-9)  # nothing of what is there was filled
    assert_allclose(job.metrics["lost_cm2"], 1e4 * 0.5 * height * AROUND, rtol=0.03)  # of its facets
    told = job.warnings if warned else job.notes
    assert any(f"{lost:.0%} of the garment, hang on nothing that was seen" in text for text in told)
    assert bool(job.warnings) is warned


def test_too_much_lost_cloth_is_refused_unless_someone_answers_for_it():
    parts = [tube(0.0, 0.2), sheet(0.22, 0.37, 0.5)]  # 27 % of it
    with pytest.raises(GarmentError, match=r"only 72\.\d % of the garment was seen") as refused:
        closed(parts, Job())
    assert refused.value.exit_code == 4
    assert "openings.least_seen" in refused.value.hint
    job = Job()
    _, openings, _ = closed(parts, job, keep=2)
    assert len(openings) == 2
    assert any("of the garment was seen" in text for text in job.warnings)


def test_what_stands_far_off_is_neither_worn_nor_lost():
    job = Job()
    chair = moved(sheet(0.0, 0.3, 0.5), [0.4, 0.0, 0.0])
    garment, _, _ = closed([tube(0.0, 0.3), chair], job)
    assert face_components(garment)[0] == 1
    assert job.metrics["lost_cm2"] == 0.0
    assert_allclose(job.metrics["unobserved_share"], 0.0, atol=1e-9)


def test_a_larger_thing_in_the_room_is_not_the_garment():
    job = Job()
    shell = concatenate([tube(0.0, 0.3), moved(tube(-0.2, 0.5), [0.5, 0.0, 0.0])])
    _, openings, _ = closed([shell], job)
    assert_allclose([one.center for one in openings], [[0, 0.3, 0], [0, 0, 0]], atol=1e-3)
    assert job.metrics["lost_cm2"] == 0.0


def test_cloth_in_a_hole_that_was_filled_counts_once():
    """A patch in the middle of a hole of 6 cm, held by nothing: the filling stands for it."""
    whole = tube(0.0, 0.3)
    middle = np.linalg.norm(whole.vertices[whole.faces].mean(axis=1) - [RADIUS, 0.15, 0.0], axis=1)
    patch = submesh(whole, middle < 0.025)[0]
    job = Job()
    closed([submesh(whole, middle > 0.03)[0], patch], job)
    assert_allclose(job.metrics["lost_cm2"], 0.0, atol=1e-9)
    share = np.pi * 0.03**2 / (0.3 * AROUND)  # a flat disc's
    assert_allclose([job.metrics["unobserved_share"], job.metrics["filled_share"]], share, rtol=0.1)


def test_a_sock_is_worn_though_it_has_one_opening():
    """The arm ends in it, as a foot does."""
    end = fill_holes(tube(0.45, 0.65), [max(boundary_walks(tube(0.45, 0.65)), key=lambda walk: _height(walk))])
    garment, openings, _ = closed([tube(0.0, 0.3), end], Job(), form=arm(high=0.64))
    assert face_components(garment)[0] == 2
    assert_allclose([one.center[1] for one in openings], [0.45, 0.3, 0.0], atol=1e-3)


def _height(walk):
    pipe = tube(0.45, 0.65)
    return pipe.vertices[half_edges(pipe)[walk, 0], 1].mean()


@pytest.mark.parametrize("seen_bare", [False, True])
def test_a_garment_torn_in_two_is_told_from_two_garments(seen_bare):
    """Where nothing was seen between its pieces, it is warned of; two garments leave the mannequin bare there."""
    form, job = arm(), Job()
    height = form.vertices[form.faces][:, :, 1]
    shown = ((height > 0.205) & (height < 0.245)).all(axis=1) if seen_bare else (height > 0.45).all(axis=1)
    naked = submesh(form, shown)[0]
    labels = SurfaceLabels(np.zeros(len(naked.vertices), bool), np.ones(len(naked.vertices)))
    garment, openings, _ = closed(
        [tube(0.0, 0.2), tube(0.25, 0.37)], job, form=form, bare=BareParts(naked, labels, form)
    )
    assert face_components(garment)[0] == 2
    assert len(openings) == 4
    told = [text for text in job.warnings if "two pieces end 50 mm apart" in text]
    assert len(told) == (0 if seen_bare else 1)


def test_a_part_that_hangs_on_a_strip_is_kept_as_a_piece():
    """A strip of 10 mm, less than flaps are: it goes, and the sleeve beyond it stays."""
    whole = tube(0.0, 0.4)
    x, y, z = whole.vertices[whole.faces].mean(axis=1).T
    gap = (y > 0.2) & (y < 0.26) & ~((np.abs(x) < 0.005) & (z > 0))
    job = Job()
    garment, openings, _ = closed([submesh(whole, ~gap)[0]], job)
    assert face_components(garment)[0] == 2
    assert len(openings) == 4
    assert garment.vertices[:, 1].max() > 0.39


def test_a_hem_that_came_off_beyond_the_mannequin_is_not_lost_silently():
    """Nothing wears it alone, and it is a third of a skirt."""
    short = arm(low=0.15)
    parts = [tube(0.1, 0.4), moved(tube(0.0, 0.15), [0.0, -0.1, 0.0])]
    with pytest.raises(GarmentError, match="of the garment was seen"):
        closed(parts, Job(), form=short)


@pytest.fixture(scope="module")
def two_pieces():
    """A top and a skirt on the dressed form, its middle bare, a patch of noise on the hip below the skirt."""

    def region(p):
        x, y, z = p.T
        belly = np.where(np.abs(x) < 0.25, np.minimum(TOP_HEM - y, y - WAIST), -1.0)
        patch = np.max([np.abs(x) - 0.05, np.abs(y - 0.14) - 0.03, -z], axis=0)
        return np.minimum(np.maximum(dressed_form.shirt_region(p), belly), patch)

    return dressed_form.make_scene(cell=0.008, holes=0, region=region)


def test_top_and_skirt_end_to_end(two_pieces):
    scene, job = two_pieces, Job()
    labels = label_garment(scene.scan, scene.form, SubtractConfig(), job)
    shell = extract_garment(scene.scan, labels, SubtractConfig(), job)
    assert face_components(shell)[0] == 3
    bare = BareParts(scene.scan, labels, scene.form)
    garment, openings, _ = close_scan_holes(shell, scene.form, OpeningsConfig(), job, bare)
    assert face_components(garment)[0] == 2
    assert is_manifold(garment)
    assert len(openings) == 6
    cuffs = [one.center[0] for one in openings if abs(one.center[0]) > 0.2]
    assert_allclose(sorted(cuffs), [-0.36, 0.36], atol=0.04)
    heights = [one.center[1] for one in openings if abs(one.center[0]) < 0.2]
    assert_allclose(heights, [NECK, TOP_HEM, WAIST, HEM], atol=0.012)  # a cell and a half
    truth = submesh(scene.shirt, (scene.shirt.vertices[scene.shirt.faces][:, :, 1] > HEM - 0.01).all(axis=1))[0]
    for one, other in ((truth, garment), (garment, truth)):
        points, _, _ = sample_surface(one, 4000, 0)
        error = SurfaceDistance(other).nearest(points).distance
        assert 1e-5 < np.median(error) < 1e-3
        assert np.percentile(error, 95) < 8e-3  # a cell
    assert any("hang on nothing that was seen" in text for text in job.notes)  # the patch
    assert 20 < job.metrics["lost_cm2"] < 120
    assert not any("two pieces end" in text for text in job.warnings)


def test_a_piece_of_floor_beside_the_feet_is_no_cloth():
    """Level, with the noise of a depth camera, labelled garment as it stands off from the mannequin."""
    grid = np.random.default_rng(0)
    x, z = np.meshgrid(np.arange(0.12, 0.3, 0.005), np.arange(-0.1, 0.1, 0.005), indexing="ij")
    at = np.arange(x.size).reshape(x.shape)
    a, b, c, d = at[:-1, :-1].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel(), at[:-1, 1:].ravel()
    points = np.column_stack([x.ravel(), grid.normal(0, 0.001, x.size), z.ravel()])
    floor = TriangleMesh(points, np.vstack([np.column_stack([a, c, b]), np.column_stack([a, d, c])]))
    both = concatenate([tube(0.0, 0.3), floor])
    everything = SurfaceLabels(np.ones(len(both.vertices), bool), np.ones(len(both.vertices)))
    job = Job()
    shell = extract_garment(both, everything, SubtractConfig(), job)
    assert face_components(shell)[0] == 1
    assert any("a level piece" in note for note in job.notes)
