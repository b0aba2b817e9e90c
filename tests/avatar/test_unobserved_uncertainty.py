"""What a scan does not show, or shows bent, is less surely measured; nonsense is refused."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.avatar.measure import measure
from vto_pipeline.avatar.model.shape import ShapeSpace, shape_space
from vto_pipeline.avatar.scan.correspondence import Target
from vto_pipeline.avatar.scan.report import refuse_implausible_build
from vto_pipeline.avatar.scan.uncertainty.unobserved import unseen_sigmas
from vto_pipeline.avatar.template.template import beyond_armscye
from vto_pipeline.errors import AvatarError
from vto_pipeline.geometry.topology import submesh
from vto_pipeline.model.body import Avatar, Measurements


def sigmas(space: ShapeSpace, spread: float, misfit: float, arms: tuple[int, ...], stands: bool = True):
    """Of the template, of which the scan shows only some arms; parameters and surface err by so much."""
    body: Avatar = space.base
    hidden = beyond_armscye() & ~np.isin(np.sign(body.bind_vertices[:, 0]), arms)
    scan = Target(submesh(body.mesh, ~hidden[body.faces].any(axis=1))[0], 500, 0)
    posed = body.vertices + np.array([0.0, 0.0, misfit])
    return unseen_sigmas(space, spread**2 * np.eye(len(space.names)), scan, posed, body, stands)


def test_what_is_seen_is_known() -> None:
    assert max(sigmas(shape_space(0.0), 0.1, 0.005, (-1, 1)).values()) == 0.0


def test_an_arm_that_is_missing_is_a_guess() -> None:
    space = shape_space(1.0)
    found = sigmas(space, 0.1, 0.0, (-1,))
    assert found["stature"] == found["hip_girth"] == found["calf_girth"] == 0.0
    # closed form: the shape's fields scale an arm as a whole; of the mean of both sides, half is unseen
    fields = [k for k, name in enumerate(space.names) if name.endswith("_scale")]
    by_fields = sigmas(
        replace(space, fields=np.where(np.isin(np.arange(len(space.names)), fields)[:, None, None], space.fields, 0.0)),
        0.1,
        0.0,
        (-1,),
    )
    wrist = measure(space.base).values["wrist_girth"]
    assert_allclose(by_fields["wrist_girth"], 0.5 * 0.1 * wrist, rtol=0.15)  # neighbouring fields count a little
    assert found["outer_arm_length"] > 0.005


def test_what_the_model_missed_elsewhere_it_misses_there() -> None:
    """Closed form: a ring that lies off by d all round is 2 pi d longer."""
    found = sigmas(shape_space(0.0), 0.0, 0.004, (-1,))
    assert_allclose(found["forearm_girth"], 0.5 * 2 * np.pi * 0.004, rtol=0.05)
    assert found["waist_girth"] == 0.0


def test_what_was_bent_is_less_sure() -> None:
    space = shape_space(0.5)
    found, read = sigmas(space, 0.1, 0.0, (-1, 1), stands=False), measure(space.base).values
    assert_allclose([found[name] / read[name] for name in read], 0.02, rtol=1e-9)


@pytest.mark.parametrize("size", [0.6, 1.0, 1.2])
def test_people_are_made_out_and_monsters_are_not(size: float) -> None:
    read = measure(shape_space(0.5).base)
    scaled = {name: size * value for name, value in read.values.items()}
    refuse_implausible_build(Measurements(scaled, sex="neutral"), 0.8)
    with pytest.raises(AvatarError, match="leans 46 degrees and cannot be reconstructed: its back_shoulder_width"):
        refuse_implausible_build(
            Measurements(scaled | {"back_shoulder_width": 0.4 * scaled["back_shoulder_width"]}), 0.8
        )
