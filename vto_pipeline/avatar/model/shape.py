"""Shape parameters: smooth fields that stretch segments, scale sections and push out bust, belly and seat.

A body is template + sum of parameter x field. Every field is a closed formula of a vertex's place on the template
(level along the trunk, the leg or the arm, and how much it belongs to arm and leg): the same formula moves the joints.
Heights change by functions of height alone, breadths by functions of height times breadth: they do not disturb each
other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline

from vto_pipeline.avatar.model.pose import pose_avatar
from vto_pipeline.avatar.template.body_plan import BodyPlan, interpolated_plan
from vto_pipeline.avatar.template.implicit import arm_axis, smooth_min, smoothstep
from vto_pipeline.avatar.template.template import ARM, JOINT_KINDS, LEG, membership, template
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar

SEX_SHARE = {"female": 0.0, "neutral": 0.5, "male": 1.0}
"""What people call a body -> its place between the two templates."""

_SEGMENTS = ("foot", "shank", "thigh", "seat", "belly", "midriff", "ribs", "chest", "shoulder", "neck", "head")
_STRETCH, _SLIDE_M = 0.06, 0.008
"""Spread of a segment's height among people, where long and where short."""
_KINK_M = 0.02
_TRUNK_KNOTS = ("hip", "high_hip", "navel", "waist", "underbust", "chest", "shoulder")
_LEG_KNOTS = ("ankle", "calf", "knee", "midthigh", "thigh")
_TRUNK_CHANGES = ("breadth", "depth", "shift", "fullness")
_RIBS_M, _BREAST_ROOT_M = 0.010, 0.02
"""How far before the trunk's own front its ribs may lie, and how softly what is further is taken for breast."""
_ALIKE_M = 0.25
"""How far along the body its thickness varies together."""
_ARM_KNOTS = ("armpit", "upper_arm", "elbow", "forearm", "wrist", "hand")


@dataclass(frozen=True)
class ShapeSpace:
    """All fields of one sex's template.

    Args:
        base: The template.
        names: P parameter names.
        sigmas: Spread of each parameter among people, rough; shape (P,).
        whitener: Takes parameters to independent unit normals; neighbours vary together; shape (P, P).
        fields: Displacement per unit of each parameter [m], shape (P, V, 3).
        joint_fields: The same for the joints, shape (P, J, 3).
    """

    base: Avatar
    names: tuple[str, ...]
    sigmas: FloatArray
    whitener: FloatArray
    fields: FloatArray
    joint_fields: FloatArray

    def vertices(self, parameters: FloatArray) -> FloatArray:
        """Return the body in the bind pose, shape (V, 3)."""
        return self.base.bind_vertices + np.tensordot(parameters, self.fields, 1)

    def joints(self, parameters: FloatArray) -> FloatArray:
        """Return the joints in the bind pose, shape (J, 3)."""
        return self.base.joints + np.tensordot(parameters, self.joint_fields, 1)

    def avatar(self, parameters: FloatArray) -> Avatar:
        """Return the body in the bind pose, standing on the floor."""
        vertices, joints = self.vertices(parameters), self.joints(parameters)
        floor = np.array([0.0, vertices[:, 1].min(), 0.0])
        body = replace(
            self.base,
            bind_vertices=vertices - floor,
            joints=joints - floor,
            parameters=dict(zip(self.names, parameters.tolist(), strict=True)),
        )
        return pose_avatar(body, np.zeros_like(joints), np.zeros(3))


@lru_cache(maxsize=4)
def shape_space(sex: float) -> ShapeSpace:
    """Return the shape space about the mean body of a sex (0 female ... 1 male)."""
    base = template(sex)
    arm, leg = membership("arm"), membership("leg")
    on_arm, on_leg = (np.isin(JOINT_KINDS, kinds).astype(float) for kinds in (ARM, LEG))
    plan = interpolated_plan(sex)
    skin = _fields(plan, base.bind_vertices, arm, leg)
    bone = _fields(plan, base.joints, on_arm, on_leg)
    names = tuple(skin)
    sigmas = np.array([skin[name][0] for name in names])
    return ShapeSpace(
        base,
        names,
        sigmas,
        np.linalg.inv(np.linalg.cholesky(_covariance(plan, names, sigmas))),
        np.stack([skin[name][1] for name in names]),
        np.stack([bone[name][1] for name in names]),
    )


def _covariance(plan: BodyPlan, names: tuple[str, ...], sigmas: FloatArray) -> FloatArray:
    """Neighbours along trunk and limbs vary together: a Matern 3/2 process (Rasmussen & Williams 2006, eq. 4.17)."""
    chains = [(_trunk_heights(plan), [f"{knot}_{what}" for knot in _TRUNK_KNOTS]) for what in _TRUNK_CHANGES]
    chains += [(_leg_heights(plan), [f"{knot}_girth" for knot in _LEG_KNOTS])]
    chains += [(_arm_stations(plan), [f"{knot}_scale" for knot in _ARM_KNOTS])]
    correlation = np.eye(len(names))
    for place, chain in chains:
        at = np.array([names.index(name) for name in chain])
        apart = np.sqrt(3) * np.abs(np.subtract.outer(place, place)) / _ALIKE_M
        correlation[np.ix_(at, at)] = (1 + apart) * np.exp(-apart)
    return correlation * np.outer(sigmas, sigmas)


def _trunk_heights(plan: BodyPlan) -> FloatArray:
    return np.array([*(plan.levels[name] for name in _TRUNK_KNOTS[:-1]), plan.shoulder[1]])


def _leg_heights(plan: BodyPlan) -> FloatArray:
    ankle, calf, knee, thigh = (plan.levels[name] for name in ("ankle", "calf", "knee", "thigh"))
    return np.array([ankle, calf, knee, (knee + thigh) / 2, thigh])


def _arm_stations(plan: BodyPlan) -> FloatArray:
    elbow, wrist = plan.elbow, plan.wrist
    return np.array([0.05, 0.16, elbow, elbow + 0.06, wrist, (wrist + plan.fingertip) / 2])


def _fields(
    plan: BodyPlan, points: FloatArray, arm: FloatArray, leg: FloatArray
) -> dict[str, tuple[float, FloatArray]]:
    """Return name -> (spread, field at the points)."""
    level, shoulder, neck_base, crown = plan.levels, plan.shoulder, plan.side_neck[1], plan.head[-1, 0]
    side = np.sign(points[:, 0])
    x, y, z = np.abs(points[:, 0]), points[:, 1], points[:, 2]
    trunk = 1 - arm
    out: dict[str, tuple[float, FloatArray]] = {}

    def add(
        name: str,
        sigma: float,
        dx: FloatArray | float = 0.0,
        dy: FloatArray | float = 0.0,
        dz: FloatArray | float = 0.0,
    ) -> None:
        out[name] = (sigma, np.stack([side * dx, np.broadcast_to(dy, y.shape), np.broadcast_to(dz, y.shape)], axis=1))

    def with_arms(of_place: FloatArray, at_shoulder: float) -> FloatArray:
        """Return a field of the trunk; the arms move as the shoulder joint does."""
        return trunk * of_place + arm * at_shoulder

    # below the floor, so that the sole is stretched as the foot is
    stops = [-_KINK_M, level["ankle"], level["knee"], level["crotch"], level["hip"], level["navel"], level["waist"]]
    stops += [level["chest"], shoulder[1], neck_base, level["neck"] + 0.02, crown]
    for name, low, high in zip(_SEGMENTS, stops, stops[1:], strict=False):
        sigma = max(_STRETCH, _SLIDE_M / (high - low))
        at_shoulder = float(_stretched(shoulder[1:2], low, high)[0])
        add(f"{name}_height", sigma, dy=with_arms(_stretched(y, low, high), at_shoulder))

    front = np.interp(y, plan.trunk[:, 0], plan.trunk[:, 3])
    _add_trunk(add, with_arms, plan, front, x, y, z)
    _add_legs(add, plan, leg, x, y, z)
    _add_arms(add, plan, arm, np.stack([x, y, z], axis=1) - shoulder)
    tall = level["neck"] + 0.01
    head = _ramp(y, tall, tall + 0.06) * trunk
    add("head_breadth", 0.05, dx=x * head)
    add("head_depth", 0.05, dz=z * head)
    ahead = _ramp(y, level["chest"], crown) ** 1.5
    add("head_forward", 0.02, dz=with_arms(ahead, float(_ramp(np.array(shoulder[1]), level["chest"], crown) ** 1.5)))
    return out


def _add_trunk(  # type: ignore[no-untyped-def]
    add,
    with_arms,
    plan: BodyPlan,
    front: FloatArray,
    x: FloatArray,
    y: FloatArray,
    z: FloatArray,
) -> None:
    level, heights, shoulder, neck_base = plan.levels, _trunk_heights(plan), plan.shoulder, plan.side_neck[1]
    middle = np.interp(y, [*heights, neck_base], [-0.02, 0.0, 0.006, 0.008, 0.004, 0.0, -0.025, -0.02])
    knots = np.array([level["thigh"] - 0.04, *heights, level["neck"]])
    up = _ramp(y, level["chest"], shoulder[1])
    outward = _ramp(x, 0.05, shoulder[0])
    # breasts are carried by the ribs, not scaled with them: they would become cones
    bare = _ramp(y, level["waist"], level["underbust"]) * (1 - _ramp(y, shoulder[1], neck_base))
    ribs = z + bare * (smooth_min(z, front + _RIBS_M, _BREAST_ROOT_M) - z)
    rings, at_shoulder = _cardinal(knots, y), _cardinal(knots, shoulder[1:2])[0]
    for k, name in enumerate(_TRUNK_KNOTS, start=1):
        ring, there = rings[:, k], float(at_shoulder[k])
        # broad chests have broad shoulders: the arms make room
        along = 0.6 * shoulder[0] if name == "chest" else 0.0
        add(f"{name}_breadth", 0.10, dx=with_arms(x * ring + along * outward * up, shoulder[0] * there + along))
        add(f"{name}_depth", 0.12, dz=with_arms((ribs - middle) * ring, 0.0))
        add(f"{name}_shift", 0.010, dz=with_arms(ring, there))
        corner = ring * (2 * x * (z - middle) / (x**2 + (z - middle) ** 2 + 1e-6)) ** 2
        add(f"{name}_fullness", 0.04, dx=with_arms(x * corner, 0.0), dz=with_arms((z - middle) * corner, 0.0))
    neck = _cardinal(np.array([shoulder[1] - 0.01, neck_base, level["neck"], level["neck"] + 0.08]), y)
    neck *= 1 - outward[:, None]
    for name, ring in (("neck_base", neck[:, 1]), ("neck", neck[:, 2])):
        add(f"{name}_girth", 0.08, dx=with_arms(x * ring, 0.0), dz=with_arms((z + 0.01) * ring, 0.0))
    ahead, back = _ramp(z, -0.02, 0.06), _ramp(-z, -0.02, 0.06)
    # the fuller, the wider and lower
    bust = _bell(x, 0.082, 0.070) * _bell(y, level["chest"] - 0.015, 0.075) * ahead
    add("bust", 0.012, dx=with_arms(0.15 * bust, 0.0), dz=with_arms(bust, 0.0))
    add("belly", 0.020, dz=with_arms(_bell(x, 0.0, 0.11) * _bell(y, level["navel"] - 0.03, 0.09) * ahead, 0.0))
    add("seat", 0.012, dz=with_arms(-_bell(x, 0.085, 0.075) * _bell(y, level["hip"], 0.07) * back, 0.0))
    add("shoulder_width", 0.012, dx=with_arms(outward * up, 1.0))
    # a straight line from the neck to beyond the shoulder's end tilts as a whole
    tilt = _ramp(x, 0.03, shoulder[0] + 0.04)
    add("shoulder_slope", 0.012, dy=with_arms(-tilt * up, -1.0))


def _add_legs(  # type: ignore[no-untyped-def]
    add, plan: BodyPlan, leg: FloatArray, x: FloatArray, y: FloatArray, z: FloatArray
) -> None:
    level, axis = plan.levels, plan.leg[::-1]
    center, radius = np.interp(y, axis[:, 0], axis[:, 1]), np.interp(y, axis[:, 0], axis[:, 2])
    depth = np.interp(y, axis[:, 0], (axis[:, 3] + axis[:, 4]) / 2)
    apart = _ramp(x, 0.0, 0.05)
    knots = np.array([0.3 * level["ankle"], *_leg_heights(plan), level["hip"] + 0.02])
    rings = _cardinal(knots, y) * leg[:, None]
    for k, name in enumerate(_LEG_KNOTS, start=1):
        ring = rings[:, k]
        # the gap between the thighs stays: they grow outwards
        outwards = radius * ring if name in ("midthigh", "thigh") else 0.0
        add(f"{name}_girth", 0.09, dx=((x - center) * ring + outwards) * apart, dz=(z - depth) * ring)
    # what lies below makes room down to the knee: within a hand's breadth the thighs would fold over
    low = level["crotch"] - 0.02
    close = _ramp(y, level["knee"], low) * (1 - _ramp(y, low, low + 0.12))
    add("crotch", 0.020, dy=_bell(x, 0.0, 0.05) * close)
    add("stance", 0.02, dx=(1 - _ramp(y, level["ankle"], level["hip"])) * leg)
    foot = _ramp(-y, -level["ankle"], -0.4 * level["ankle"])
    add("foot_length", 0.05, dz=(z + 0.03) * foot)
    add("foot_breadth", 0.05, dx=(x - center) * foot)


def _add_arms(add, plan: BodyPlan, arm: FloatArray, from_shoulder: FloatArray) -> None:  # type: ignore[no-untyped-def]
    elbow, wrist, tip = plan.elbow, plan.wrist, plan.fingertip
    axis = arm_axis()
    along = from_shoulder @ axis
    radial = from_shoulder - along[:, None] * axis
    for name, low, high in (("upper_arm", 0.09, elbow), ("forearm", elbow, wrist), ("hand", wrist, tip)):
        stretch = (np.clip(along, low, high) - low) * arm
        add(f"{name}_length", 0.06, dx=stretch * axis[0], dy=stretch * axis[1])
    rings = _cardinal(np.array([-0.05, *_arm_stations(plan), tip + 0.10]), along) * arm[:, None]
    for k, name in enumerate(_ARM_KNOTS, start=1):
        dx, dy, dz = (radial * rings[:, k, None]).T
        add(f"{name}_scale", 0.10, dx=dx, dy=dy, dz=dz)


def _ramp(value: FloatArray, low: float, high: float) -> FloatArray:
    """0 below, 1 above, smooth between."""
    return smoothstep(np.clip((value - low) / (high - low), 0.0, 1.0))


def _stretched(value: FloatArray, low: float, high: float) -> FloatArray:
    """Integral of 1 between low and high, 0 elsewhere, rounded over `_KINK_M` at both ends."""

    def rising(t: FloatArray) -> FloatArray:
        return np.where(np.abs(t) < _KINK_M, (t + _KINK_M) ** 2 / (4 * _KINK_M), np.maximum(t, 0.0))

    return rising(value - low) - rising(value - high)


def _cardinal(knots: FloatArray, value: FloatArray) -> FloatArray:
    """Cubic splines, each 1 at its own knot and 0 at the others, flat at both ends, shape (N, K)."""
    return CubicSpline(knots, np.eye(len(knots)), bc_type="clamped")(np.clip(value, knots[0], knots[-1]))


def _bell(value: FloatArray, center: float, width: float) -> FloatArray:
    return np.exp(-(((value - center) / width) ** 2))
