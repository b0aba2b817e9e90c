"""A short-sleeved shirt, and a dress: cloth that hangs from the shoulders, with a neck, a hem and two cuffs."""

from __future__ import annotations

import numpy as np

from vto_pipeline.bench.samples.garments.tailoring import mesh_garment_field
from vto_pipeline.bench.samples.garments.wearer import Wearer
from vto_pipeline.bench.samples.solids.primitives import cone, ellipsoid, smooth_cut, smooth_union
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.garment import Garment, RestShape

_TIGHT = 0.007  # gap on the shoulders [m]
_SLEEVE = 0.20  # from the shoulder joint to the cuff [m]
_ROOM = 0.016  # of the sleeve about the arm [m]


def make_shirt(wearer: Wearer, edge_mm: float = 12.0, *, clearance: float = 0.025) -> Garment:
    """Return a shirt that ends at the hip; edges [mm], least gap to the trunk [m]."""
    return _top(wearer, edge_mm, wearer.hip - 0.03, clearance, flare=0.0)


def make_dress(wearer: Wearer, edge_mm: float = 12.0, *, clearance: float = 0.02, flare: float = 0.10) -> Garment:
    """Return a dress that ends at the knee; edges [mm], least gap to the trunk [m], widening a metre."""
    return _top(wearer, edge_mm, wearer.knee + 0.02, clearance, flare)


def _top(wearer: Wearer, edge_mm: float, hem: float, clearance: float, flare: float) -> Garment:
    arm = wearer.elbow - wearer.shoulder
    arm = arm / np.linalg.norm(arm)
    armpit = float(wearer.shoulder[1]) - 0.13
    girth = float(np.linalg.norm(wearer.neck_radii))

    def left(points: FloatArray) -> FloatArray:
        return np.column_stack([np.abs(points[:, 0]), points[:, 1:]])

    def field(points: FloatArray) -> FloatArray:
        around = wearer.tube(points, armpit, hem - 0.05, clearance, flare)
        trunk = smooth_cut(around, points[:, 1] - armpit - 0.03, 0.05)
        end = wearer.shoulder + 1.3 * _SLEEVE * arm
        sleeve = cone(left(points), wearer.shoulder, end, (0.052 + _ROOM, 0.052 + 1.5 * _ROOM))
        return smooth_union(wearer.distance(points) - _TIGHT, smooth_union(trunk, sleeve, 0.03), 0.02)

    def outside_neck(points: FloatArray) -> FloatArray:
        radii = np.array([wearer.neck_radii[0] + 0.02, 0.6 * girth + 0.03, wearer.neck_radii[1] + 0.03])
        return ellipsoid(points, wearer.neck + np.array([0.0, 0.25 * girth, 0.01]), radii)

    def before_cuff(points: FloatArray) -> FloatArray:
        along = (left(points) - wearer.shoulder) @ arm
        beside = np.maximum(wearer.shoulder[0] + 0.02 - np.abs(points[:, 0]), wearer.elbow[1] - 0.03 - points[:, 1])
        return np.maximum(_SLEEVE - along, beside)

    reach = float(wearer.shoulder[0]) + _SLEEVE
    low, high = np.array([-reach, hem, -0.35]), np.array([reach, float(wearer.neck[1]) + 0.1, 0.35])
    mesh = mesh_garment_field(field, low, high, [outside_neck, before_cuff, lambda points: points[:, 1] - hem], edge_mm)
    return Garment(mesh, RestShape(mesh.vertices))
