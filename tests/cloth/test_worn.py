"""Strain and pressure at each vertex: a tight band about a cylinder (Laplace's law)."""

import numpy as np
from cloth_scenes import fabric, tube
from numpy.testing import assert_allclose

from vto_pipeline.cloth.judge.worn import vertex_maps
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.units import GRAVITY

RADIUS, TIGHT = 0.10, 0.05


def band(gap=1e-3):
    """A band that is 5 % narrower at rest, `gap` off a cylinder."""
    worn = tube(RADIUS + gap, 0.1, 96, 16, base=0.0)
    rest = worn.vertices / np.array([1.0 + TIGHT, 1.0, 1.0 + TIGHT])
    return worn, RestShape(rest), tube(RADIUS, 0.4, 384, 3, base=-0.15)


def inner(mesh):
    return (mesh.vertices[:, 1] > 0.02) & (mesh.vertices[:, 1] < 0.08)


def test_a_tight_band_presses_by_its_tension_over_the_radius():
    worn, rest, body = band()
    cloth = fabric(poisson=0.0)
    maps = vertex_maps(worn, rest, body, cloth)
    among = inner(worn)
    assert_allclose(maps["strain_weft"][among], TIGHT, rtol=1e-6)
    for none in ("strain_warp", "shear_rad"):
        assert_allclose(maps[none], 0.0, atol=1e-5)  # facets of a 96-gon lean a little
    tension = cloth.stretch_weft * TIGHT
    # over areas at rest, which are smaller than worn by the strain
    wanted = tension * 2.0 * np.pi / (2.0 * np.pi * (RADIUS + 1e-3) / (1.0 + TIGHT))
    assert_allclose(maps["pressure_pa"][among], wanted, rtol=2e-3)  # 96-gon


def test_cloth_that_does_not_touch_does_not_press():
    worn, rest, body = band(gap=0.01)
    assert_allclose(vertex_maps(worn, rest, body, fabric())["pressure_pa"], 0.0)


def test_the_whole_weight_of_a_flat_sheet_is_borne():
    from vto_pipeline.bench.cloth.scenes import grid

    across, along, faces = grid(11)
    sheet = TriangleMesh(0.2 * np.column_stack([across, np.full(121, 1e-2), -along]), faces)
    table = TriangleMesh(5.0 * np.column_stack([across - 0.5, np.zeros(121), -along + 0.5]), faces)
    cloth = fabric()
    maps = vertex_maps(sheet, RestShape(sheet.vertices), table, cloth)
    assert_allclose(maps["pressure_pa"], cloth.areal_density * GRAVITY, rtol=1e-6)
