"""Trousers that are longer than the legs: gathered above the feet, which are wider than what they would be in."""

import numpy as np
import pytest
from figures import EASE, bones, capsules, surface
from numpy.testing import assert_array_equal

from vto_pipeline.cloth.drape import drape
from vto_pipeline.cloth.placement.clear_body import edge_stretches
from vto_pipeline.cloth.placement.limbs.lead import lead_onto_limbs
from vto_pipeline.cloth.placement.limbs.openings import pieces_with_limbs
from vto_pipeline.cloth.placement.thinning import LINES, Thinning
from vto_pipeline.geometry.intersections import self_intersections
from vto_pipeline.geometry.remeshing.remesh import RemeshConfig, remesh
from vto_pipeline.geometry.topology import boundary_loops, submesh
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.model.job import Job

SOLE, HEIGHT = 0.28, 1.69 - 0.28  # m: where the short legs end, and how tall the figure is then
FOOT = 0.24  # m


def short_legs():
    """The figure on legs 22 cm shorter, with feet."""
    parts = [part for part in bones(0.9) if part[1][1] > 0.5]
    for s in (1.0, -1.0):
        ankle, down = np.array([s * 0.11, SOLE + 0.05, 0.0]), np.array([0.0, -0.02, 0.0])
        parts.append((np.array([s * 0.09, 0.85, 0.0]), ankle, 0.05))
        parts.append((ankle + down, ankle + down + np.array([0.0, 0.0, FOOT - 0.06]), 0.03))
    return surface(lambda points: capsules(points, parts), 0.015)


def trousers(hem):
    """A pair with its waist at 1 m and its hems at this height [m]."""
    legs = [(np.array([s * 0.09, 0.85, 0.0]), np.array([s * 0.125, 0.0, 0.0]), 0.03) for s in (1.0, -1.0)]
    seat = [(np.array([0.0, 0.9, 0.0]), np.array([0.0, 1.25, 0.0]), 0.14)]
    whole = surface(lambda points: capsules(points, legs + seat, EASE + 7e-4), 0.02)
    height = whole.vertices[:, 1]
    cut = submesh(whole, ((height > hem) & (height < 1.0))[whole.faces].all(axis=1))[0]
    return remesh(cut, RemeshConfig(edge_mm=20.0), Job())


def led(garment, body):
    thinning = Thinning(body)
    pieces = pieces_with_limbs(garment, thinning.limbs, thinning.after(LINES))
    return lead_onto_limbs(garment, body, thinning.limbs, thinning.after(LINES), pieces), thinning


def hems(mesh):
    loops = [mesh.vertices[loop] for loop in boundary_loops(mesh)]
    return sorted(loops, key=lambda loop: loop[:, 1].mean())[:2]


def test_they_are_gathered_above_the_feet_and_their_upper_part_is_as_it_was():
    body, garment = short_legs(), trousers(0.1)
    assert all(loop[:, 1].max() < SOLE for loop in hems(garment))  # the foot is in it
    there, thinning = led(garment, body)
    ankle = SOLE + 0.06 * HEIGHT
    for loop in hems(there):
        assert abs(loop[:, 1].mean() - ankle) < 0.03
        assert loop[:, 1].min() > SOLE + 0.04  # clear of the instep
    (piece,) = pieces_with_limbs(there, thinning.limbs, thinning.after(LINES))
    for number, limb in enumerate(thinning.limbs.limbs):
        if limb.name.endswith("leg"):
            assert piece.through[number] == {piece.meant[number]}
    assert piece.astray() == []
    assert len(self_intersections(there)) == 0
    sides = edge_stretches(there.vertices, garment.vertices, garment.faces)
    above = (garment.vertices[garment.faces][:, :, 1] > 0.75).all(axis=1)
    assert np.abs(sides[above] - 1.0).max() < 0.1
    assert 0.2 < sides.min() < 0.7  # shorter along the leg, and none turned over


def test_those_that_end_above_the_ankle_are_not_gathered(monkeypatch):
    body, garment = short_legs(), trousers(0.5)
    there, _ = led(garment, body)
    monkeypatch.setattr("vto_pipeline.cloth.placement.limbs.lead._ankle", lambda leg, body: -np.inf)
    assert_array_equal(led(garment, body)[0].vertices, there.vertices)


@pytest.mark.slow
def test_they_come_to_rest_on_the_feet():
    body, garment = short_legs(), trousers(0.1)
    done = drape(garment, body, read_fabric("cotton_poplin"))
    assert done.audit["settled"]
    assert done.audit["body_intersections"] == done.audit["self_intersections"] == 0
    for loop in hems(done.mesh):
        assert loop[:, 2].max() < body.vertices[:, 2].max() - 0.03  # toes look out
        assert loop[:, 1].min() > SOLE - 0.06  # behind the heel: there is no floor
