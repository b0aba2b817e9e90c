"""When a lens that bends is believed: numbers set by hand, and a model of COLMAP's."""

from __future__ import annotations

from types import SimpleNamespace

import pycolmap
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.model.job import Job
from vto_pipeline.scan.photos.matching import mapping
from vto_pipeline.scan.photos.matching.mapping import bend, lens_of, map_photos


def model(placed=24, sightings=5700, error=0.35, k1=0.0):
    camera = pycolmap.Camera(model="SIMPLE_RADIAL", width=800, height=600, params=[500.0, 400.0, 300.0, k1])
    return SimpleNamespace(
        cameras={1: camera},
        num_reg_images=lambda: placed,
        compute_num_observations=lambda: sightings,
        compute_mean_reprojection_error=lambda: error,
    )


def test_a_corner_moves_by_k1_times_its_radius_squared():
    assert_allclose(bend(model(k1=-0.3)), 0.3 * (400**2 + 300**2) / 500**2, rtol=1e-12, atol=0)  # one product
    found = lens_of(model(k1=-0.3).cameras[1])
    assert (found.fx, found.cx, found.cy, found.k1) == (500.0, 399.5, 299.5, -0.3)


@pytest.mark.parametrize(
    ("k1", "straight", "taken"),
    [
        (-0.02, model(), -0.02),  # a corner moves by 2 %: nothing is tried
        (-0.5, model(), 0.0),  # without the bend it is as good
        (-0.5, model(error=0.40), -0.5),  # the error grows
        (-0.5, model(sightings=5000), -0.5),  # sightings are lost
        (-0.5, model(placed=23), -0.5),  # a photo is lost
        (-0.5, model(placed=25, sightings=4000, error=0.5), 0.0),  # a photo more outweighs all else
        (-0.5, None, -0.5),  # nothing comes of it
    ],
)
def test_a_lens_that_bends_much_must_be_needed(monkeypatch, tmp_path, k1, straight, taken):
    tried = []

    def found(database, folder, count, job, bent):
        tried.append(bent)
        return model(k1=k1) if bent else straight

    monkeypatch.setattr(mapping, "_best", found)
    chosen = map_photos(tmp_path / "x.db", tmp_path, 24, Job())
    assert chosen.cameras[1].params[3] == taken
    assert tried == ([True] if k1 == -0.02 else [True, False])
