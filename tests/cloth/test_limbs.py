"""Limbs of a body, the openings that are there for them, and sleeves put on them."""

import numpy as np
import pytest
from cloth_scenes import moved, tube
from figures import ARM, SHOULDER, arm_end, figure, tunic
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.cloth.placement.body_growth import _least_faulty, plan_body_growth
from vto_pipeline.cloth.placement.limbs.limbs import Limbs
from vto_pipeline.cloth.placement.limbs.openings import pieces_with_limbs
from vto_pipeline.cloth.placement.thinning import Thinning
from vto_pipeline.errors import IntersectingError
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_loops, submesh
from vto_pipeline.model.body import Measurements
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh


def distance_to_bone(points, a, b):
    t = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    return np.linalg.norm(points - a - t[:, None] * (b - a), axis=1)


def goes_round(loop, a, b):
    """How often a closed loop of points goes around the straight line through a and b."""
    way = (b - a) / np.linalg.norm(b - a)
    one = np.cross(way, [0.0, 0.0, 1.0])
    flat = (loop - a) @ np.column_stack([one, np.cross(way, one)])
    angle = np.arctan2(flat[:, 1], flat[:, 0])
    return np.angle(np.exp(1j * np.diff(np.append(angle, angle[0])))).sum() / (2.0 * np.pi)


def cuff(garment, side):
    """The loop of the sleeve of the wearer's left (1) or right (-1), which lies farthest out."""
    loops = [garment.vertices[loop] for loop in boundary_loops(garment)]
    return max(loops, key=lambda loop: side * loop[:, 0].mean())


@pytest.mark.parametrize("below", [0.0, 0.7, 1.2])
def test_the_limbs_of_a_figure_and_their_axes(below):
    limbs = {limb.name: limb for limb in Limbs(figure(below)).limbs}
    assert sorted(limbs) == ["head", "left arm", "left leg", "right arm", "right leg"]
    for side, name in ((1.0, "left arm"), (-1.0, "right arm")):
        limb = limbs[name]
        along = limb.axis[(limb.along > 0.05) & (limb.along < limb.joins - 0.05)]
        assert len(along) > 8
        off = distance_to_bone(along, SHOULDER * [side, 1, 1], arm_end(side, below))
        assert off.max() < 0.02  # half of its radius
        assert 0.5 * ARM < limb.joins < 1.3 * ARM


def test_each_limb_has_its_opening_and_an_arm_in_a_panel_is_seen():
    body = figure(0.7)
    limbs = Limbs(body)
    worn, astray = tunic(0.7), tunic(0.0)
    for garment, expected in ((worn, set()), (astray, {"left arm", "right arm"})):
        (piece,) = pieces_with_limbs(garment, limbs, body)
        names = [limb.name for limb in limbs.limbs]
        meant = dict(zip(names, piece.meant, strict=True))
        middle = {name: garment.vertices[piece.vertices[piece.openings[k]]].mean(axis=0) for name, k in meant.items()}
        assert middle["head"][1] > 1.3
        assert middle["left leg"][1] < 0.8
        assert meant["left leg"] == meant["right leg"]
        assert middle["left arm"][0] > 0.3
        assert middle["right arm"][0] < -0.3
        assert {names[k] for k in piece.astray()} == expected


def vest():
    """The tunic without its sleeves, open in front."""
    whole = tunic(0.7)
    middle = whole.vertices[whole.faces].mean(axis=1)
    in_front = (np.abs(middle[:, 0]) < 0.02) & (middle[:, 2] > 0.0)
    return submesh(whole, (np.abs(middle[:, 0]) < 0.24) & ~in_front)[0]


def test_the_head_goes_through_an_open_front_though_armholes_are_nearer_than_its_middle():
    thinning = Thinning(figure(0.7))
    (piece,) = pieces_with_limbs(vest(), thinning.limbs, thinning.after(0))
    meant = dict(zip([limb.name for limb in thinning.limbs.limbs], piece.meant, strict=True))
    assert meant["head"] == meant["left leg"] == meant["right leg"]
    assert len({meant["left arm"], meant["right arm"], meant["head"]}) == 3


@pytest.mark.parametrize(("lower", "misplaced"), [(0.0, 0), (0.1, 0), (0.3, 1), (0.5, 1)])
def test_a_vest_is_not_worn_at_the_hips(lower, misplaced):
    assert Thinning(figure(0.7)).limbs_out_of_place(moved(vest(), 0.0, -lower, 0.0)) == misplaced


@pytest.mark.parametrize(("made_for", "worn_by"), [(0.0, 1.1), (0.9, 0.0)])
def test_sleeves_are_put_on_arms_held_another_way(made_for, worn_by):
    body, garment, job = figure(worn_by), tunic(made_for), Job()
    arms = [(SHOULDER * [s, 1, 1], arm_end(s, worn_by)) for s in (1.0, -1.0)]
    assert all(abs(goes_round(cuff(garment, s), *arm)) < 0.5 for s, arm in zip((1.0, -1.0), arms, strict=True))
    growth = plan_body_growth(body, garment, job)
    growth.refuse_pierced()
    assert growth.fault == (0, 0)
    for side, arm in zip((1.0, -1.0), arms, strict=True):
        assert_allclose(abs(goes_round(cuff(growth.garment, side), *arm)), 1.0, rtol=0, atol=1e-6)
        middle = cuff(growth.garment, side).mean(axis=0)
        assert distance_to_bone(middle[None], *arm)[0] < 0.075  # the sleeve's radius
        assert_allclose(np.linalg.norm(middle - arm[0]), 0.4, rtol=0, atol=0.1)  # as far down as it was cut
    was, now = (
        np.linalg.norm(x[garment.faces] - np.roll(x[garment.faces], 1, axis=1), axis=2)
        for x in (garment.vertices, growth.garment.vertices)
    )
    assert_allclose(np.median(now / was), 1.0, rtol=0.02)


def test_sleeves_that_are_sewn_shut_are_refused_with_the_arm_and_the_place():
    body, garment = figure(0.0), tunic(0.0, sleeve=0.2, sewn_shut=True)
    with pytest.raises(IntersectingError) as refused:
        plan_body_growth(body, garment, Job()).refuse_pierced()
    assert refused.value.exit_code == 4
    assert "left arm goes through the cloth at (0.4" in refused.value.problem
    assert refused.value.partial["draped"].vertices.shape == garment.vertices.shape


def test_a_thin_body_stays_within_the_full_one():
    body = figure(0.7)
    shirt = tunic(0.7)
    growth = plan_body_growth(body, moved(shirt, 0.0, 0.0, 0.035), Job())
    assert len(growth.body.keyframes) > 1
    outside = SurfaceDistance(body).signed(growth.body.keyframes.reshape(-1, 3)).distance
    assert outside.max() < 1e-9


@pytest.mark.slow
def test_what_is_too_small_for_arms_to_find_its_sleeves_starts_larger():
    """Three quarters of its size: arms go through the cloth wherever it is led, and do not once it is 20 % larger."""
    body, made = figure(0.9), tunic(0.3)
    middle = made.vertices.mean(axis=0)
    small = TriangleMesh(middle + 0.75 * (made.vertices - middle), made.faces)
    assert _least_faulty(Thinning(body), small).pierced > 0
    job = Job()
    growth = plan_body_growth(body, small, job)
    assert growth.fault == (0, 0)
    assert any("20% larger" in warning for warning in job.warnings)


@pytest.mark.parametrize("slope", [0.3, 0.8, 1.4])
def test_how_steep_cloth_is_about_an_opening(slope):
    """A cone of one slope [rad] above, and of another below: each opening sees its own."""
    cone = tube(1.0, 1.0, 48, 41)
    along = 1.0 - cone.vertices[:, 1:2]
    steps = np.where(along < 0.5, along, 0.5), np.maximum(along - 0.5, 0.0)
    radius = 0.1 + steps[0] * np.cos(slope) + steps[1] * np.cos(0.5)
    height = 1.0 - steps[0] * np.sin(slope) - steps[1] * np.sin(0.5)
    cone = TriangleMesh(
        np.hstack([radius, np.ones_like(radius), radius])
        * np.hstack([cone.vertices[:, :1], height, cone.vertices[:, 2:]]),
        cone.faces,
    )
    (piece,) = pieces_with_limbs(cone, Limbs(figure(0.9)), figure(0.9))
    low, high = np.argsort([cone.vertices[loop, 1].mean() for loop in piece.openings])
    assert_allclose(piece.steepness(high, 0.15), np.sin(slope), rtol=0.01)  # 48 corners for a circle
    assert_allclose(piece.steepness(low, 0.15), np.sin(0.5), rtol=0.01)
    assert piece.steepness(high, 0.0) == 0.0


@pytest.mark.parametrize("degrees", [0.0, 40.0, 180.0, -90.0])
def test_feet_tell_where_a_body_faces(degrees):
    """The avatar faces +Z; so it is known after any turn. The figure has no feet."""
    avatar = fit_measurements(Measurements({"stature": 1.7, "chest_girth": 0.9, "hip_girth": 0.95}, sex="male")).mesh
    turn = Rotation.from_euler("y", degrees, degrees=True).as_matrix()
    ahead = Limbs(TriangleMesh(avatar.vertices @ turn.T, avatar.faces)).ahead
    assert_allclose(ahead, turn[:, 2], rtol=0, atol=0.05)
    assert_allclose(Limbs(figure(0.3)).ahead, [0.0, 0.0, 1.0], rtol=0, atol=0)
