"""The dress form: a body cut at neck, forearms and thighs, standing on a plinth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vto_pipeline.bench.samples.solids.body import BodyShape, body_distance
from vto_pipeline.bench.samples.solids.primitives import smooth_cut, smooth_union
from vto_pipeline.bench.samples.solids.surface_nets import zero_surface
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

SHAPE = BodyShape(
    stature=1.70,
    widths=(0.170, 0.176, 0.160, 0.137, 0.138, 0.146, 0.146, 0.132),
    fronts=(0.088, 0.096, 0.096, 0.092, 0.096, 0.100, 0.088, 0.070),
    backs=(0.095, 0.100, 0.088, 0.082, 0.092, 0.102, 0.104, 0.094),
    bust=0.018,
    limb=1.0,
    shoulder=0.168,
    arm_angle=np.deg2rad(48.0),
    bumps=(
        (0.050, 0.600, 0.050, 0.006, 0.055),
        (-0.070, 0.540, 0.030, 0.005, 0.050),
        (-0.045, 0.740, -0.060, 0.006, 0.060),
        (0.060, 0.510, -0.040, -0.005, 0.045),
        (0.020, 0.690, 0.065, -0.004, 0.040),
        (-0.105, 0.790, 0.000, 0.004, 0.035),
    ),
)
THIGH_CUT = 0.605  # height of the thigh cut on the standing body [m]
NECK_CUT = 1.465
ARM_LENGTH = 0.44  # from the shoulder joint to the middle of the forearm
PLINTH = 0.030  # [m]
LIFT = PLINTH - THIGH_CUT  # from the standing body's frame to the form's
CELL = 0.0088
EDGE = 0.008  # rounding of the cut edges [m]


@dataclass(frozen=True)
class Form:
    """The dress form, y = 0 where it stands, +Z its front.

    Args:
        shape: The body it was cut from.
        mesh: Its closed surface [m].
    """

    shape: BodyShape
    mesh: TriangleMesh


def body_frame(points: FloatArray) -> FloatArray:
    """From the form's frame to the frame of the body it was cut from, shape (N, 3) [m]."""
    return points - np.array([0.0, LIFT, 0.0])


def form_distance(points: FloatArray) -> FloatArray:
    """Signed distance to the form, its frame; shape (N,) [m]."""
    on_body = body_frame(points)
    form = body_distance(SHAPE, on_body, arm_length=ARM_LENGTH)
    for cut in (THIGH_CUT - on_body[:, 1], on_body[:, 1] - NECK_CUT):
        form = smooth_cut(form, cut, EDGE)
    return smooth_union(form, _plinth(points), 0.015)


def make_form() -> Form:
    """The dress form of the sample data: one closed surface."""
    return Form(SHAPE, zero_surface(form_distance, np.array([-0.6, -0.05, -0.24]), np.array([0.6, 0.9, 0.24]), CELL))


def _plinth(points: FloatArray) -> FloatArray:
    """An elliptic disc under the thighs."""
    radius = np.linalg.norm(points[:, [0, 2]] / [0.19, 0.115], axis=1)
    side = (radius - 1.0) * 0.13
    return smooth_cut(smooth_cut(side, points[:, 1] - PLINTH - 0.004, EDGE), -points[:, 1], EDGE)
