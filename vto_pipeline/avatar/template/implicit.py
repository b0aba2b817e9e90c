"""The template's surface as the zero set of one function: sections along axes, joined by smooth unions."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator

from vto_pipeline.avatar.template.body_plan import ARM_ANGLE_RAD, BodyPlan
from vto_pipeline.model.arrays import FloatArray

_CROTCH_BLEND_M, _HIP_BLEND_M = 0.012, 0.045
_HIP_M = 0.09
"""How far from the median plane a leg joins the trunk softly, as hip and groin do; no web may hang between thighs."""
_SHOULDER_BLEND_M = 0.04
_NECK_BLEND_M = 0.03
_ANKLE_BLEND_M = 0.03
_SOLE_ROUNDING_M = 0.012
_FOLD_M = 0.005
_LUMP_FOLD_M = 0.015


def arm_axis() -> FloatArray:
    """Return the unit vector from the left shoulder to the left hand in the bind pose, shape (3,)."""
    return np.array([np.cos(ARM_ANGLE_RAD), -np.sin(ARM_ANGLE_RAD), 0.0])


def signed_field(plan: BodyPlan, points: FloatArray) -> FloatArray:
    """Return roughly the signed distance of points from the body [m], negative inside, shape (N,).

    Args:
        plan: The body.
        points: Positions [m], shape (N, 3).
    """
    _, y, z = points.T
    # the mirror image is folded over softly, so that no ridge stands in the median plane
    x, soft = np.hypot(points[:, 0], _FOLD_M), np.hypot(points[:, 0], _LUMP_FOLD_M)
    trunk = _tube(plan.trunk, y, points[:, 0], z)
    for lump in plan.lumps:
        trunk = smooth_min(trunk, _ellipsoid(lump, soft, y, z), lump[6])
    body = smooth_min(trunk, _tube(plan.head, y, points[:, 0], z), _NECK_BLEND_M)
    foot = np.column_stack([plan.foot[:, :3], plan.foot[:, 3], -plan.foot[:, 3] * 0.5, np.full(len(plan.foot), 2.2)])
    leg = smooth_min(_tube(plan.leg[::-1], y, x, z), _tube(foot, z, x, y), _ANKLE_BLEND_M)
    leg = smooth_max(leg, -y, _SOLE_ROUNDING_M)
    outside = np.minimum(x / _HIP_M, 1.0)
    body = smooth_min(body, leg, _CROTCH_BLEND_M + (_HIP_BLEND_M - _CROTCH_BLEND_M) * outside**2 * (3 - 2 * outside))
    along = (x - plan.shoulder[0]) * arm_axis()[0] + (y - plan.shoulder[1]) * arm_axis()[1]
    across = -(x - plan.shoulder[0]) * arm_axis()[1] + (y - plan.shoulder[1]) * arm_axis()[0]
    ones = np.ones(len(plan.arm))
    arm = np.column_stack([plan.arm[:, 0], 0 * ones, plan.arm[:, 1:], 2.1 * ones])
    return smooth_min(body, _tube(arm, along, across, z - plan.shoulder[2]), _SHOULDER_BLEND_M)


def gradient(plan: BodyPlan, points: FloatArray, step: float = 1e-4) -> FloatArray:
    """Return the field's gradient by central differences, shape (N, 3)."""
    offsets = step * np.eye(3)
    ends = [signed_field(plan, points + o) - signed_field(plan, points - o) for o in offsets]
    return np.stack(ends, axis=1) / (2 * step)


def smoothstep(t: FloatArray) -> FloatArray:
    """Return 3 t² - 2 t³: from 0 at 0 to 1 at 1, level at both ends."""
    return t * t * (3 - 2 * t)


def unsmoothed(s: FloatArray) -> FloatArray:
    """Return what `smoothstep` makes s of, 0 to 1: the root of a cubic, by the sine of a third of an angle (Viete)."""
    return 0.5 - np.sin(np.arcsin(1 - 2 * s) / 3)


def smooth_min(a: FloatArray, b: FloatArray, width: FloatArray | float) -> FloatArray:
    """Union of two fields, rounded where they differ by less than `width` [m] (Quilez, polynomial smooth minimum)."""
    overlap = np.maximum(width - np.abs(a - b), 0.0)
    return np.minimum(a, b) - overlap**2 / (4 * width)


def smooth_max(a: FloatArray, b: FloatArray, width: float) -> FloatArray:
    """Intersection of two fields, rounded likewise."""
    return -smooth_min(-a, -b, width)


def _tube(sections: FloatArray, along: FloatArray, side: FloatArray, front: FloatArray) -> FloatArray:
    """Field of a tube of superellipses; sections (axial, centre side, half breadth, front, back, exponent), rising."""
    inside = np.clip(along, sections[0, 0], sections[-1, 0])
    spline = PchipInterpolator(sections[:, 0], sections[:, 1:])
    center, breadth, fore, aft, exponent = spline(inside).T
    depth, middle = (fore - aft) / 2, (fore + aft) / 2
    u, v = side - center, front - middle
    # slightly off the axis: there the direction, and so the radius, is not defined
    radial = np.hypot(u, v) + 1e-9
    ratio = ((np.abs(u) / breadth) ** exponent + (np.abs(v) / depth) ** exponent) ** (1 / exponent) + 1e-9
    slope = spline(inside, 1)
    steepness = np.hypot(1.0, np.maximum(np.abs(slope[:, 1]), np.abs(slope[:, 2] - slope[:, 3]) / 2))
    field = (radial - radial / ratio) / steepness
    beyond = along - inside
    return np.where(beyond == 0, field, np.hypot(np.maximum(field, 0.0), beyond) + np.minimum(field, 0.0))


def _ellipsoid(lump: FloatArray, x: FloatArray, y: FloatArray, z: FloatArray) -> FloatArray:
    offset = np.stack([x - lump[0], y - lump[1], z - lump[2]], axis=1)
    level = np.linalg.norm(offset / lump[3:6], axis=1) + 1e-9
    slope = np.linalg.norm(offset / lump[3:6] ** 2, axis=1) + 1e-9
    return level * (level - 1) / slope
