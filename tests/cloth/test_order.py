"""Which vertices lie outside an outer garment: tubes about a rod, where that is known."""

import numpy as np
from cloth_scenes import tube
from numpy.testing import assert_array_equal

from vto_pipeline.cloth.judge.order import outside_outer_garment
from vto_pipeline.model.mesh import TriangleMesh

ROD = tube(0.1, 1.0, 48, 25)


def low(mesh, height):
    return np.flatnonzero(mesh.vertices[:, 1] < height)


def both(one, other):
    return TriangleMesh(
        np.vstack([one.vertices, other.vertices]), np.vstack([one.faces, other.faces + len(one.vertices)])
    )


def test_what_is_beneath_is_not_outside():
    assert len(outside_outer_garment(tube(0.12, 0.6, 40, 13, base=0.2), tube(0.13, 0.6, 36, 14, base=0.2), ROD)) == 0


def test_what_is_over_it_is_outside_as_far_as_it_is_covered():
    wide, narrow = tube(0.13, 0.6, 40, 13, base=0.2), tube(0.12, 0.33, 36, 9, base=0.1)
    assert_array_equal(outside_outer_garment(wide, narrow, ROD), low(wide, 0.43))


def test_a_way_through_two_folds_leads_back_under():
    wide = tube(0.13, 0.6, 40, 13, base=0.2)
    folded = both(tube(0.11, 0.7, 36, 14, base=0.15), tube(0.12, 0.7, 36, 14, base=0.15))
    assert len(outside_outer_garment(wide, folded, ROD)) == 0
    third = both(folded, tube(0.125, 0.27, 36, 14, base=0.15))
    assert_array_equal(outside_outer_garment(wide, third, ROD), low(wide, 0.42))


def test_what_touches_the_body_is_never_outside():
    assert len(outside_outer_garment(ROD, tube(0.12, 0.6, 36, 14, base=0.2), ROD)) == 0
