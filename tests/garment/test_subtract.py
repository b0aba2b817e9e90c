"""Labels and shells against the truth the scan was made from."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.subtract import SubtractConfig, extract_garment, label_garment
from vto_pipeline.geometry.repair import is_manifold
from vto_pipeline.geometry.rigid import moved
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import face_components
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh


@pytest.fixture(scope="module")
def placed(scene):
    return moved(scene.scan, scene.mannequin_from_surface)


@pytest.mark.parametrize(("colored", "least"), [(True, 0.985), (False, 0.97)])
def test_nearly_every_vertex_gets_its_true_label(scene, placed, colored, least):
    surface = placed if colored else TriangleMesh(placed.vertices, placed.faces)
    job = Job()
    labels = label_garment(surface, scene.form, SubtractConfig(), job)
    right = (labels.garment == scene.is_shirt)[~scene.on_ledge].mean()
    assert least < right < 1.0
    assert_allclose(job.metrics["noise_mm"], 0.3, rtol=0.15)  # the noise put in, from the bare parts alone
    assert [what for what, _ in job.left_out] == ([] if colored else ["colour evidence"])


def test_confidence_is_less_where_cloth_lies_close(scene, placed):
    plain = TriangleMesh(placed.vertices, placed.faces)
    labels = label_garment(plain, scene.form, SubtractConfig(), Job())
    away = SurfaceDistance(scene.form).signed(placed.vertices).distance
    close, far = (away > 0.0008) & (away < 0.0016), away > 0.005
    assert close.sum() > 20
    assert labels.confidence[close].mean() < 0.95
    assert labels.confidence[far].mean() > 0.99


def test_colour_saves_cloth_that_lies_on_the_form(scene, placed):
    """Cloth pressed to within the noise of the form cannot be told by distance."""
    pressed = scene.is_shirt & (placed.vertices[:, 1] > 0.55) & (placed.vertices[:, 2] > 0.0)
    vertices = placed.vertices.copy()
    noise = np.random.default_rng(0).normal(0.0, 3e-4, vertices[pressed].shape)
    vertices[pressed] = SurfaceDistance(scene.form).nearest(vertices[pressed]).point + noise
    with_color = TriangleMesh(vertices, placed.faces, placed.colors)
    seen = label_garment(with_color, scene.form, SubtractConfig(), Job()).garment[pressed].mean()
    blind = (
        label_garment(TriangleMesh(vertices, placed.faces), scene.form, SubtractConfig(), Job()).garment[pressed].mean()
    )
    assert seen > 0.7
    assert blind < 0.4


def test_the_board_is_no_garment(scene, placed):
    labels = label_garment(placed, scene.form, SubtractConfig(), Job())
    assert not labels.garment[placed.vertices[:, 1] < -0.001].any()


def test_the_shell_is_one_manifold_piece_on_the_true_shirt(scene, placed):
    labels = label_garment(placed, scene.form, SubtractConfig(), Job())
    job = Job()
    shell = extract_garment(placed, labels, SubtractConfig(), job)
    assert is_manifold(shell)
    assert face_components(shell)[0] == 1
    back = SurfaceDistance(shell).nearest(scene.shirt.vertices).distance
    assert np.median(back) < 6e-4  # noise 0.3 mm, cells of 8 mm
    assert np.percentile(back, 90) < 3e-3  # apart from the four scan holes


def test_a_bare_form_is_refused(scene):
    with pytest.raises(GarmentError, match="stands off"):
        label_garment(scene.form, scene.form, SubtractConfig(thickness_mm=1.0), Job())
