"""A human body as an implicit solid: the truth behind the dress form and the customer.

It is made apart from the avatar template on purpose. A body outside the avatar's shape space keeps the tests of the
avatar honest, and the sample data do not change when the avatar does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from vto_pipeline.bench.samples.solids.primitives import bump, cone, ellipsoid, smooth_cut, smooth_union
from vto_pipeline.model.arrays import FloatArray

# Torso sections: height, half width, half depth in front and behind, centre z; the first in shares of stature.
LEVELS = ("crotch", "hip", "belly", "waist", "ribs", "bust", "chest", "yoke")
HEIGHTS = np.array([0.465, 0.505, 0.565, 0.622, 0.672, 0.720, 0.760, 0.788])


@dataclass(frozen=True)
class BodyShape:
    """What makes one body differ from another.

    Args:
        stature: Height [m].
        widths, fronts, backs: Half widths and half depths of the torso at LEVELS [m].
        bust: How far the bust stands out of the rib cage [m].
        limb: Scale of limb and neck thickness.
        shoulder: Half distance of the shoulder joints [m].
        arm_angle: Of the arms below the horizontal [rad].
        bumps: Rows of center x, y, z (shares of stature), height [m], spread [m].
    """

    stature: float
    widths: tuple[float, ...]
    fronts: tuple[float, ...]
    backs: tuple[float, ...]
    bust: float
    limb: float
    shoulder: float
    arm_angle: float
    bumps: tuple[tuple[float, float, float, float, float], ...] = ()


@dataclass(frozen=True)
class Arm:
    """The skeleton of the left arm (+X) [m]; the right one is its mirror image."""

    shoulder: FloatArray
    elbow: FloatArray
    wrist: FloatArray

    @property
    def axis(self) -> FloatArray:
        """Unit vector down the upper arm."""
        direction = self.elbow - self.shoulder
        unit: FloatArray = direction / np.linalg.norm(direction)
        return unit


def arm(shape: BodyShape) -> Arm:
    """Where the left arm is."""
    h = shape.stature
    shoulder = np.array([shape.shoulder, 0.798 * h, -0.018])
    down = np.array([np.cos(shape.arm_angle), -np.sin(shape.arm_angle), 0.0])
    elbow = shoulder + 0.178 * h * down + np.array([0.0, 0.0, -0.006])
    wrist = elbow + 0.148 * h * down + np.array([-0.006, 0.0, 0.03])
    return Arm(shoulder, elbow, wrist)


def _mirrored(points: FloatArray) -> FloatArray:
    """The same points on the left side (+X); x is a smooth |x|, so that nothing has a crease in the median plane."""
    return np.stack([np.hypot(points[:, 0], 0.014), points[:, 1], points[:, 2]], axis=1)


def torso_distance(shape: BodyShape, points: FloatArray) -> FloatArray:
    """Trunk with bust and seat, without limbs and neck; shape (N,) [m]."""
    h = shape.stature
    mirrored = _mirrored(points)
    heights = HEIGHTS * h
    y = np.clip(points[:, 1], heights[0], heights[-1])
    half_width = CubicSpline(heights, shape.widths, bc_type="clamped")(y)
    front = CubicSpline(heights, shape.fronts, bc_type="clamped")(y)
    back = CubicSpline(heights, shape.backs, bc_type="clamped")(y)
    depth = np.where(points[:, 2] > 0.0, front, back)
    beyond = points[:, 1] - y
    dome = np.where(beyond > 0.0, 0.080, 0.10)
    level = (np.abs(points[:, 0]) / half_width) ** 2.3 + (np.abs(points[:, 2]) / depth) ** 2.3
    radius = (level + (np.abs(beyond) / dome) ** 2.3 + 1e-12) ** (1.0 / 2.3)
    length = np.linalg.norm(np.stack([points[:, 0], beyond, points[:, 2]]), axis=0)
    trunk = (radius - 1.0) * np.where(radius > 0.3, length / radius, 0.1)

    breast = np.array([0.078, 0.712 * h, shape.fronts[5] - 0.034])
    spread = np.array([0.072, 0.080, 0.040 + shape.bust])
    seat = np.array([0.072, 0.505 * h, -shape.backs[1] + 0.045])
    body = smooth_union(trunk, ellipsoid(mirrored, breast, spread), 0.06)
    return smooth_union(body, ellipsoid(mirrored, seat, np.array([0.085, 0.095, 0.072])), 0.06)


def arm_distance(shape: BodyShape, points: FloatArray) -> FloatArray:
    """Arms and hands; shape (N,) [m]."""
    mirrored = _mirrored(points)
    bones, s = arm(shape), shape.limb
    upper = cone(mirrored, bones.shoulder, bones.elbow, (0.050 * s, 0.038 * s))
    lower = cone(mirrored, bones.elbow, bones.wrist, (0.038 * s, 0.025 * s))
    hand_axis = (bones.wrist - bones.elbow) / np.linalg.norm(bones.wrist - bones.elbow)
    palm = bones.wrist + 0.075 * hand_axis
    fingers = bones.wrist + 0.165 * hand_axis + np.array([-0.006, 0.0, 0.012])
    flat = mirrored * [1.0, 1.0, 0.62] + np.array([0.0, 0.0, 0.38 * palm[2]])
    hand = cone(flat, bones.wrist + 0.03 * hand_axis, palm, (0.026 * s, 0.036 * s))
    hand = smooth_union(hand, cone(flat, palm, fingers, (0.033 * s, 0.012 * s)), 0.02)
    thumb_tip = palm + np.array([0.0, -0.01, 0.055]) + 0.02 * hand_axis
    hand = smooth_union(hand, cone(mirrored, bones.wrist + 0.03 * hand_axis, thumb_tip, (0.015 * s, 0.010 * s)), 0.02)
    return smooth_union(np.minimum(upper, lower), hand, 0.02)


def leg_distance(shape: BodyShape, points: FloatArray) -> FloatArray:
    """Legs and feet; shape (N,) [m]."""
    mirrored = _mirrored(points)
    h, s = shape.stature, shape.limb
    hip = np.array([0.50 * shape.widths[1], 0.480 * h, -0.012])
    knee = np.array([0.056 * h, 0.275 * h, 0.0])
    ankle = np.array([0.057 * h, 0.045 * h, -0.03])
    calf = np.array([0.059 * h, 0.205 * h, -0.03])
    toe = np.array([0.070 * h, 0.022, 0.125])
    thigh = cone(mirrored, hip, knee, (0.46 * shape.widths[1], 0.053 * s))
    leg = np.minimum(thigh, cone(mirrored, knee, ankle, (0.053 * s, 0.036 * s)))
    leg = smooth_union(leg, ellipsoid(mirrored, calf, np.array([0.050, 0.11, 0.050]) * s), 0.04)
    foot = cone(mirrored, ankle - [0.0, 0.030, 0.01], toe, (0.042, 0.024))
    return smooth_union(leg, foot, 0.03)


def head_distance(shape: BodyShape, points: FloatArray) -> FloatArray:
    """Neck, slope of the shoulders and head; shape (N,) [m]."""
    mirrored = _mirrored(points)
    h, s = shape.stature, shape.limb
    pit, skull = np.array([0.0, 0.815 * h, -0.022]), np.array([0.0, 0.895 * h, 0.012])
    neck = cone(points, pit, skull, (0.066 * s, 0.053 * s))
    joint = arm(shape).shoulder
    slope = cone(mirrored, np.array([0.0, 0.822 * h, -0.026]), joint, (0.052 * s, 0.050 * s))
    neck = smooth_union(neck, slope, 0.05)
    head = ellipsoid(points, np.array([0.0, 0.940 * h, 0.022]), np.array([0.074, 0.060 * h, 0.093]))
    jaw = ellipsoid(points, np.array([0.0, 0.900 * h, 0.052]), np.array([0.052, 0.052, 0.062]))
    return smooth_union(neck, smooth_union(head, jaw, 0.03), 0.025)


def body_distance(shape: BodyShape, points: FloatArray, *, arm_length: float = np.inf) -> FloatArray:
    """The whole body in A-pose, feet on y = 0, facing +Z.

    Args:
        points: Shape (N, 3) [m].
        arm_length: Where the arms are cut off, from the shoulder joint along the upper arm [m].

    Returns:
        Signed distance, first order near the skin, shape (N,) [m].
    """
    body = smooth_union(torso_distance(shape, points), leg_distance(shape, points), 0.09)
    body = smooth_union(body, head_distance(shape, points), 0.10)
    bones = arm(shape)
    along = (_mirrored(points) - bones.shoulder) @ bones.axis
    arms = smooth_cut(arm_distance(shape, points), along - arm_length, 0.008)
    body = smooth_union(body, arms, 0.05)
    for x, y, z, height, spread in shape.bumps:
        body = body - bump(points, np.array([x, y, z]) * shape.stature, height, spread)
    return body
