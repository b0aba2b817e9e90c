"""Labels over a body that was only estimated, against the truth that the scan was made from."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.subtraction.color_model import color_overlap
from vto_pipeline.garment.subtraction.estimated import label_over_estimate
from vto_pipeline.garment.subtraction.subtract import SubtractConfig
from vto_pipeline.geometry.rigid import transform_mesh
from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh


@pytest.fixture(scope="module")
def placed(scene):
    return transform_mesh(scene.scan, scene.mannequin_from_surface)


@pytest.fixture(scope="module")
def estimate(scene):
    """The form, wrong by waves of 10 mm rms: far more than the shirt stands off at the shoulders."""
    form = scene.form
    x, y, z = form.vertices.T
    waves = 0.010 * np.sqrt(2.0) * np.sin(2 * np.pi * (x + 0.7 * y + 0.5 * z) / 0.3)
    return TriangleMesh(form.vertices + waves[:, None] * vertex_normals(form), form.faces)


@pytest.fixture(scope="module")
def ends(scene):
    """The neck's stump and what is beyond the cuffs; the stand is no part of a body."""
    x, y, _ = scene.form.vertices.T
    return ((y > 0.83) | (np.abs(x) > 0.38)).astype(float)


def iou(found, true):
    return (found & true).sum() / (found | true).sum()


def dyed(scene, placed, cloth, form, noise=1.5):
    """The scan in two plain colours, each under light that halves from top to bottom."""
    colors = (
        np.where(scene.is_shirt[:, None], cloth, form)
        * np.linspace(0.5, 1.0, 64)[np.clip((64 * placed.vertices[:, 1]).astype(int), 0, 63), None]
    )
    colors = colors + np.random.default_rng(1).normal(0.0, noise, colors.shape)
    return TriangleMesh(placed.vertices, placed.faces, np.clip(colors, 0, 255).astype(np.uint8))


def test_colour_finds_what_distance_cannot(scene, placed, estimate, ends):
    job = Job()
    labels = label_over_estimate(placed, estimate, ends, SubtractConfig(), job)
    assert 0.95 < iou(labels.garment, scene.is_shirt) < 1.0
    assert any("not scanned bare" in text for text in job.warnings)


def test_what_stands_beside_is_no_cloth_and_teaches_no_colours(scene, placed, estimate, ends):
    """A block of the form's grey, larger than what shows of the form's ends: all of it passed for cloth."""
    colored = dyed(scene, placed, (140, 40, 40), (150, 150, 150))
    block = trimesh.creation.box((0.06, 0.4, 0.12), trimesh.transformations.translation_matrix((0.9, 0.5, 0.0)))
    block = block.subdivide_to_size(0.02)
    grey = np.random.default_rng(2).normal(130, 12, (len(block.vertices), 1)).repeat(3, axis=1)
    both = TriangleMesh(
        np.vstack([colored.vertices, block.vertices]),
        np.vstack([colored.faces, block.faces + len(colored.vertices)]),
        np.vstack([colored.colors, grey.clip(0, 255)]).astype(np.uint8),
    )
    labels = label_over_estimate(both, estimate, ends, SubtractConfig(), job := Job())
    alone = label_over_estimate(colored, estimate, ends, SubtractConfig(), Job())
    assert not labels.garment[len(colored.vertices) :].any()
    assert iou(labels.garment[: len(colored.vertices)], alone.garment) > 0.999
    assert job.metrics["colors_alike"] < 0.35


def test_cloth_of_nearly_the_same_lightness(scene, placed, estimate, ends):
    """A grey shirt on skin: the two differ by 11 in CIELAB, and in hue only."""
    surface = dyed(scene, placed, [170, 170, 170], [190, 166, 150])
    labels = label_over_estimate(surface, estimate, ends, SubtractConfig(), Job())
    assert 0.95 < iou(labels.garment, scene.is_shirt) < 1.0
    clear = label_over_estimate(placed, estimate, ends, SubtractConfig(), Job())
    unsure = [(one.confidence[scene.is_shirt] < 0.99).mean() for one in (clear, labels)]
    assert unsure[0] < unsure[1]  # what the colours hardly tell is less certain


def test_the_board_is_no_garment(placed, estimate, ends):
    labels = label_over_estimate(placed, estimate, ends, SubtractConfig(), Job())
    assert not labels.garment[placed.vertices[:, 1] < -0.001].any()


def test_cloth_in_the_colour_of_its_form_is_refused(scene, placed, estimate, ends):
    with pytest.raises(GarmentError, match="nearly the same colours"):
        label_over_estimate(
            dyed(scene, placed, [190, 166, 150], [190, 166, 150]), estimate, ends, SubtractConfig(), Job()
        )


def test_a_scan_that_shows_no_ends_is_refused(placed, estimate, ends):
    with pytest.raises(GarmentError, match=r"only 0\.0% of the scan"):
        label_over_estimate(placed, estimate, np.zeros_like(ends), SubtractConfig(), Job())


def test_a_scan_without_colours_is_refused(placed, estimate, ends):
    with pytest.raises(GarmentError, match="needs colours"):
        label_over_estimate(TriangleMesh(placed.vertices, placed.faces), estimate, ends, SubtractConfig(), Job())


def test_overlap_of_colours_that_are_known():
    """Two plain colours share nothing, a colour all with itself; half of one set in the other's colour is √½ of it."""
    colors = np.repeat(np.array([[200, 60, 60], [60, 90, 200]], np.uint8), 100, axis=0)
    red, blue = np.arange(200) < 100, np.arange(200) >= 100
    assert color_overlap(colors, red, blue, 48, 5.0) < 1e-3
    assert color_overlap(colors, red, red, 48, 5.0) == pytest.approx(1.0, abs=1e-9)
    assert color_overlap(colors, red, red | blue, 48, 5.0) == pytest.approx(np.sqrt(0.5), abs=1e-3)
    assert color_overlap(colors, red, np.zeros(200, bool), 48, 5.0) == 1.0
