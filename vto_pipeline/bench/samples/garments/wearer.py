"""Bodies that the sample garments are cut for, as distance fields, with the radius of hanging cloth."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import ConvexHull

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.avatar.measuring.avatar_measurements import fit_levels
from vto_pipeline.avatar.template.regions import leg_vertices, trunk_vertices
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar, Measurements

SIZES = {
    "slim": Measurements({"stature": 1.70, "chest_girth": 0.82, "waist_girth": 0.64, "hip_girth": 0.89}, sex="female"),
    "average": Measurements(
        {"stature": 1.68, "chest_girth": 0.96, "waist_girth": 0.82, "hip_girth": 1.04}, sex="female"
    ),
    "large": Measurements({"stature": 1.72, "chest_girth": 1.16, "waist_girth": 1.04, "hip_girth": 1.22}, sex="female"),
}
"""Bodies that garments are tried on [m]."""

_TURNS = np.linspace(-np.pi, np.pi, 121)
_STEP = 0.01  # between levels [m]
_FALL = 0.16  # by which a hanging trunk may narrow, a metre of height
_SMOOTH = 2.0  # levels and turns that folds are wider than


class Wearer:
    """A body that garments are cut for, in A-pose, feet on y = 0, facing +Z.

    Args:
        avatar: The body.

    Attributes:
        waist, hip, crotch, knee, ankle: Heights [m].
        shoulder, elbow: Joints of the left arm [m], shape (3,).
        neck: Centre of the neck's base [m], shape (3,).
        neck_radii: Half its width and depth [m].
        axis_z: Where the upright axis of the trunk is [m].
    """

    def __init__(self, avatar: Avatar) -> None:
        self.avatar = avatar
        joints = dict(zip(avatar.joint_names, avatar.joints, strict=True))
        levels = fit_levels(avatar)
        self.waist, self.hip = levels["waist"], levels["hip"]
        self.crotch = float(avatar.vertices[avatar.landmarks["crotch_point"], 1])
        self.knee, self.ankle = float(joints["left_knee"][1]), float(joints["left_ankle"][1])
        self.shoulder, self.elbow = joints["left_shoulder"], joints["left_elbow"]
        base = avatar.vertices[avatar.loops["neck_base"]]
        self.neck = 0.5 * (base.min(axis=0) + base.max(axis=0))
        self.neck_radii = 0.5 * np.ptp(base[:, [0, 2]], axis=0)
        self.axis_z = float(avatar.vertices[avatar.loops["waist"], 2].mean())
        self._surface = SurfaceDistance(avatar.mesh)
        self._armless = avatar.vertices[trunk_vertices(avatar) | leg_vertices(avatar)]

    def distance(self, points: FloatArray) -> FloatArray:
        """Return the signed distance to the whole body [m], shape (N,)."""
        return self._surface.signed(points).distance

    def tube(self, points: FloatArray, top: float, low: float, clearance: float, flare: float) -> FloatArray:
        """Return about how far points are outside the cloth that hangs about trunk and legs [m], shape (N,).

        Args:
            points: Shape (N, 3) [m].
            top, low: Heights between which it hangs [m].
            clearance: Least gap to the body [m].
            flare: How much wider it becomes, a metre of height.
        """
        radius = self._hanging(top, low, clearance, flare)
        x, z = points[:, 0], points[:, 2] - self.axis_z
        height = np.clip(points[:, 1], low, top)
        around = np.stack([np.arctan2(x, z), height], axis=1)
        out: FloatArray = np.hypot(x, z) - radius(around)
        return out

    @cache  # noqa: B019  # lives as long as the bench that asks many times
    def _hanging(self, top: float, low: float, clearance: float, flare: float) -> RegularGridInterpolator:
        """Return the radius over angle and height: a taut tape about each level, which narrows slowly downwards."""
        heights = np.linspace(low, top, max(2, int((top - low) / _STEP) + 1))
        step = heights[1] - heights[0]
        skin = np.stack([self._taut(height) for height in heights], axis=1)
        hanging = skin + clearance
        for row in range(len(heights) - 2, -1, -1):
            hanging[:, row] = np.maximum(hanging[:, row], hanging[:, row + 1] - _FALL * step)
        smooth = gaussian_filter1d(hanging, _SMOOTH, axis=0, mode="wrap")
        smooth = np.maximum(gaussian_filter1d(smooth, _SMOOTH, axis=1), skin + 0.7 * clearance)
        return RegularGridInterpolator((_TURNS, heights), smooth + flare * (top - heights))

    def _taut(self, height: float) -> FloatArray:
        """Return the radius of a taut tape about trunk and legs at a height [m], shape (turns,)."""
        near = self._armless[np.abs(self._armless[:, 1] - height) < 2.0 * _STEP][:, [0, 2]] - [0.0, self.axis_z]
        sides = ConvexHull(near).equations  # n · p + d <= 0 inside
        rays = np.stack([np.sin(_TURNS), np.cos(_TURNS)])
        toward = sides[:, :2] @ rays
        reach = np.where(toward > 1e-9, -sides[:, 2:] / np.maximum(toward, 1e-9), np.inf)
        radius: FloatArray = reach.min(axis=0)
        return radius


@cache
def wearer(size: str) -> Wearer:
    """Return one of SIZES."""
    return Wearer(fit_measurements(SIZES[size]))
