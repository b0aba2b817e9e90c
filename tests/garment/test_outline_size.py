"""A scan in metres beside a form of another size, told by the form's outline in photos that Open3D cast."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from dressed_form import rigid
from numpy.testing import assert_allclose
from test_outline import MOTION, in_scan_frame, photographs

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.align import AlignConfig, align_to_mannequin
from vto_pipeline.garment.outline.edges import load_edges
from vto_pipeline.garment.outline.search import OutlineConfig, place_by_outline
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.model.job import Job

NEAR = rigid([0, 4, 0], [0.01, 0.0, 0.02])
"""A start is so far off."""


@pytest.fixture(scope="module")
def captured(scene, tmp_path_factory):
    """The shirt alone, as of a scan that saw nothing of the bare form, and eight photos."""
    folder = tmp_path_factory.mktemp("sized")
    return in_scan_frame(scene.shirt, photographs(folder, scene.form, scene.shirt, count=8), folder)


def placed(captured, form):
    surface, photos = captured
    edges = load_edges(photos.paths, photos.cameras, surface)
    points = sample_surface(surface, 1500, 0)[0]
    config = OutlineConfig(refined=1, least_support=0.1, worst_sigma_mm=50)
    return place_by_outline(form, points, edges, [NEAR @ MOTION], False, config, Job())


@pytest.mark.parametrize("size", [0.96, 1.0, 1.02])
def test_the_outline_tells_in_which_size_the_form_would_fit(scene, captured, size):
    found = placed(captured, replace(scene.form, vertices=size * scene.form.vertices))
    assert_allclose(found.size, size, rtol=3e-3)
    assert abs(found.size / size - 1.0) < 4.0 * found.size_error + 1e-6
    assert found.size_merit > 1.15 if abs(size - 1.0) > 0.01 else abs(found.size_merit - 1.0) < 0.05
    assert_allclose(np.linalg.det(found.mannequin_from_scan[:3, :3]), 1.0, rtol=1e-9)  # it is not applied


def test_a_form_of_another_size_that_was_placed_by_its_outline_is_refused(scene, captured, monkeypatch):
    """Bare parts are not asked afterwards, though cloth that lies close would pass for them."""
    surface, photos = captured
    larger = replace(scene.form, vertices=1.03 * scene.form.vertices)
    monkeypatch.setattr("vto_pipeline.garment.align._Scan._starts", lambda *_: [NEAR @ MOTION])
    config = AlignConfig(samples=2000, upright_bare=1.0, enough_bare=0.001, worst_sigma_mm=50, most_inside=0.2)
    with pytest.raises(GarmentError, match=r"only if it is made 3\.\d% larger") as caught:
        align_to_mannequin(surface, larger, config, Job(), photos)
    assert "printed in its full size" in caught.value.hint
