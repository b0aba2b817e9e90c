"""What slides past the hips has fallen off, though feet may catch it; what began on a leg may stay there."""

import numpy as np
import pytest
from cloth_scenes import moved, sheet, tube
from figures import bones, capsules, surface

from vto_pipeline.cloth.drape import drape
from vto_pipeline.cloth.dynamics.stepper import Stepper
from vto_pipeline.cloth.placement.limbs.limbs import Limbs
from vto_pipeline.errors import FallenError
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.model.mesh import TriangleMesh

BELOW, CROTCH = 1.0, 0.76  # of the arms [rad]; where the trunk's capsule ends between the legs [m]
FEET = [(np.array([s * 0.12, 0.06, -0.05]), np.array([s * 0.12, 0.06, 0.18]), 0.06) for s in (1.0, -1.0)]
STAY = {"place": "as_it_stands", "target_error_mm": 4.0}


@pytest.fixture(scope="module")
def body():
    """The figure, on feet that a skirt's waist does not pass."""
    return surface(lambda p: capsules(p, bones(BELOW) + FEET), 0.02)


def test_legs_part_where_the_trunk_ends(body):
    """A little under it: a leg's last ring is level with the crotch within, and lower without."""
    parting = Limbs(body).parting
    assert CROTCH - 0.1 < parting < CROTCH
    assert Limbs(moved(body, 0.3, 0.5, -0.2)).parting == pytest.approx(parting + 0.5, abs=1e-6)


def test_without_two_legs_there_is_no_parting():
    trunk = surface(lambda p: capsules(p, bones(BELOW)[:1]), 0.03)
    assert Limbs(trunk).parting == -np.inf


def test_a_wide_skirt_that_slides_past_the_hips_has_fallen_off(body, monkeypatch):
    """It is told while it falls: lying on the feet, its top would be at 0.3 m."""
    tops, run = [], Stepper.run

    def watched(stepper, state, span):
        after = run(stepper, state, span)
        tops.append(after.positions[:, 1].max())
        return after

    monkeypatch.setattr(Stepper, "run", watched)
    with pytest.raises(FallenError, match="fallen off"):
        drape(tube(0.21, 0.25, 36, 9, base=0.72), body, read_fabric("cotton_poplin"), STAY, None)
    *before, last = [top for top in tops if top > 0.1]  # others are of the cloth that kernels are compiled with
    assert 0.35 < last < CROTCH
    assert min(before) > CROTCH - 0.1


@pytest.mark.parametrize("place", [0.6, 0.4])
def test_a_piece_that_is_joined_to_nothing_and_falls_is_told(body, place):
    """Where it begins under the parting it falls past the feet; the band stays, and is none of it."""
    band = moved(tube(0.0615, 0.06, 30, 5, base=0.42), 0.105, 0.0, 0.0)
    patch = moved(sheet(4, 4, 0.06, 0.06), -0.3, place, 0.3)
    vertices = np.vstack([band.vertices, patch.vertices])
    both = TriangleMesh(vertices, np.vstack([band.faces, patch.faces + len(band.vertices)]).astype(np.int32))
    with pytest.raises(FallenError, match="a piece of 16 of the garment's 166 vertices has fallen off"):
        drape(both, body, read_fabric("cotton_poplin"), STAY, None)


def test_a_band_that_began_on_a_leg_may_stay_there(body):
    """Tighter than the leg below it: it is held, though lower than where the legs part."""
    left = np.array([0.105, 0.0, 0.0])
    band = moved(tube(0.0615, 0.06, 30, 5, base=0.42), *left)
    found = drape(band, body, read_fabric("cotton_poplin"), STAY, None)
    assert 0.2 < found.mesh.vertices[:, 1].max() < CROTCH
