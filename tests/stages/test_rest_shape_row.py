"""The row of the rest shape: the body and the fabric are inputs only where it is found from them."""

import pytest

from vto_pipeline.cloth.rest_shape.from_hanging import RestShapeConfig
from vto_pipeline.stages import CATALOGUE

ROW = next(stage for stage in CATALOGUE.stages if stage.name == "rest_shape")


def test_as_scanned_another_fabric_re_uses_it():
    assert ROW.extras(RestShapeConfig(mode="as_scanned")) == ()


@pytest.mark.parametrize("mode", ["auto", "panels"])
def test_panels_come_from_the_file_whatever_the_fabric(mode):
    assert ROW.extras(RestShapeConfig(mode=mode)) == ("garment_mesh",)


@pytest.mark.parametrize("mode", ["gravity_removed", "inverse"])
def test_found_by_simulation_it_needs_body_and_fabric(mode):
    assert ROW.extras(RestShapeConfig(mode=mode)) == ("mannequin_surface", "fabric")
