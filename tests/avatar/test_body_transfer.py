"""A foreign body mesh carried along by an avatar."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.avatar.from_scan import fit_scan
from vto_pipeline.avatar.model.pose import morph, named_pose
from vto_pipeline.avatar.scan.body_transfer import transfer_motion
from vto_pipeline.avatar.template.template import template
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.model.mesh import TriangleMesh

DATA = Path(__file__).parents[3] / "shared" / "data"


@pytest.fixture(scope="module")
def motion():
    body = template()
    return morph(body, named_pose(body, "arms_down"), 5)


def test_an_avatar_carries_itself(motion):
    carried = transfer_motion(motion.final, motion)
    assert_allclose(carried.keyframes, motion.keyframes, rtol=0, atol=1e-9)


def test_what_stands_off_the_avatar_keeps_its_distance_and_ends_as_it_is(motion):
    end = motion.final
    coat = TriangleMesh(end.vertices + 1e-3 * vertex_normals(end), end.faces)
    carried = transfer_motion(coat, motion)
    assert_array_equal(carried.keyframes[-1], coat.vertices)
    body = template()
    hand = body.weights[:, body.joint_names.index("left_wrist")] > 1 - 1e-12  # it turns as one piece
    assert hand.sum() > 50
    for k in (0, 2):
        posed = TriangleMesh(motion.keyframes[k], motion.faces)
        off = np.linalg.norm(carried.keyframes[k] - posed.vertices - 1e-3 * vertex_normals(posed), axis=1)
        assert_allclose(np.median(off[hand]), 0.0, rtol=0, atol=1e-9)
        assert np.quantile(off, 0.99) < 1e-3  # at the shoulders the skin is stretched, too


@pytest.mark.slow
@pytest.mark.real_data
@pytest.mark.skipif(not DATA.exists(), reason="the data folder is absent")
def test_a_real_body_turns_into_another():
    source, target = (
        read_mesh(DATA / "bodies" / f"mh_{name}.ply") for name in ("female_averageweight", "male_averageweight")
    )
    carried = transfer_motion(target, morph(fit_scan(source), fit_scan(target), 3))
    assert_array_equal(carried.keyframes[-1], target.vertices)
    start = carried.keyframes[0]
    trunk = (np.abs(start[:, 0]) < 0.35) & (start[:, 1] > 0.5) & (start[:, 1] < 1.4)
    off = SurfaceDistance(source).nearest(start[trunk]).distance
    assert off.mean() < 1.5e-3  # the registration's own error, twice
    assert np.quantile(off, 0.99) < 8e-3
