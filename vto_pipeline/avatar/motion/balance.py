"""Balance: masses of the parts, the zero moment point, and the support of the feet.

Vukobratović & Borovac 2004, "Zero-moment point: thirty five years of its life". Parts count as points of mass: what a
part turns about its own middle is left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError, cKDTree

from vto_pipeline.avatar.motion.soles import sole_points
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.units import GRAVITY

_SAMPLES = 20_000
_CUT_OFF_HZ = 6.0
"""Winter 2009: frequencies of walking lie below; second differences of what is above are noise."""

_CONTACT_M = 0.02
_UNSURE_M = 0.01


@dataclass(frozen=True)
class Balance:
    """How a motion stands.

    Args:
        zero_moment: On the floor [m], x and z, shape (T, 2).
        to_support: From it to the nearest point of the feet's support [m], 0 inside; NaN in the air, shape (T, 2).
    """

    zero_moment: FloatArray
    to_support: FloatArray

    @property
    def outside(self) -> FloatArray:
        """How far it lies outside of the support [m], 0 inside; NaN in the air, shape (T,)."""
        return np.asarray(np.linalg.norm(self.to_support, axis=1))

    @property
    def inside_share(self) -> float | None:
        """Share of the frames on the floor in which it lies within a centimetre of the support; None in the air."""
        stands = np.isfinite(self.outside)
        return float((self.outside[stands] <= _UNSURE_M).mean()) if stands.any() else None


class PartMasses(NamedTuple):
    """Masses of the parts of a body.

    Args:
        share: Each joint's share of the volume, shape (J,).
        middle: In the bind pose [m], shape (J, 3).
    """

    share: FloatArray
    middle: FloatArray


def part_masses(avatar: Avatar) -> PartMasses:
    """Return the masses of an avatar's parts.

    Points inside of the body, drawn at random with one seed, belong to the joint that holds the nearest vertex.
    """
    low, high = avatar.bind_vertices.min(axis=0), avatar.bind_vertices.max(axis=0)
    points = np.random.default_rng(0).uniform(low, high, (_SAMPLES, 3))
    points = points[SurfaceDistance(TriangleMesh(avatar.bind_vertices, avatar.faces)).inside(points)]
    _, nearest = cKDTree(avatar.bind_vertices).query(points)
    owner = np.argmax(avatar.weights[nearest], axis=1)
    count = np.bincount(owner, minlength=len(avatar.joints)).astype(float)
    total = np.stack([np.bincount(owner, points[:, k], minlength=len(avatar.joints)) for k in range(3)], axis=1)
    middle = np.where(count[:, None] > 0, total / np.maximum(count, 1)[:, None], avatar.joints)
    return PartMasses(count / len(points), middle)


def part_middles(turn: FloatArray, place: FloatArray, avatar: Avatar, masses: PartMasses) -> FloatArray:
    """Return where the middles of the parts are [m], shape (T, J, 3); arguments as of `balance`."""
    return np.asarray(place + np.einsum("tjab,jb->tja", turn, masses.middle - avatar.joints))


def balance(
    turn: FloatArray, place: FloatArray, avatar: Avatar, frame_time: float, masses: PartMasses | None = None
) -> Balance:
    """Return the zero moment point of a motion.

    Args:
        turn: World rotations of the joints relative to the bind pose, shape (T, J, 3, 3).
        place: World places of the joints [m], shape (T, J, 3).
        avatar: Whose.
        frame_time: [s].
        masses: Of `part_masses`, where they are known.
    """
    masses = masses or part_masses(avatar)
    point = zero_moment_point(part_middles(turn, place, avatar, masses), masses.share, frame_time)
    feet = []
    for side in ("left", "right"):
        ankle = avatar.joint_names.index(f"{side}_ankle")
        feet.append(place[:, ankle, None] + np.einsum("tab,nb->tna", turn[:, ankle], sole_points(avatar, side)))
    soles = np.concatenate(feet, axis=1)
    return Balance(point, np.array([_to_support(one, sole) for one, sole in zip(point, soles, strict=True)]))


def zero_moment_point(parts: FloatArray, masses: FloatArray, frame_time: float) -> FloatArray:
    """Return where on the floor the forces of weight and inertia have no level moment [m], x and z, shape (T, 2).

    Places are filtered below 6 Hz first (Butterworth, fourth order, both ways), where there are frames enough.

    Args:
        parts: Middles of the parts [m], shape (T, N, 3).
        masses: In any unit, shape (N,).
        frame_time: [s].
    """
    if len(parts) > 30 and 1.0 / frame_time > 2.2 * _CUT_OFF_HZ:
        from scipy.signal import butter, sosfiltfilt

        parts = sosfiltfilt(butter(4, _CUT_OFF_HZ, fs=1.0 / frame_time, output="sos"), parts, axis=0)
    speed = np.gradient(parts, frame_time, axis=0) if len(parts) > 2 else np.zeros_like(parts)
    pull = np.gradient(speed, frame_time, axis=0) if len(parts) > 2 else np.zeros_like(parts)
    weight = masses * (pull[..., 1] + GRAVITY)
    total = weight.sum(axis=1)
    total = np.where(abs(total) < 0.05 * masses.sum() * GRAVITY, np.nan, total)  # free fall has no such point
    level = [(weight * parts[..., k] - masses * pull[..., k] * parts[..., 1]).sum(axis=1) / total for k in (0, 2)]
    return np.stack(level, axis=1)


def _to_support(point: FloatArray, sole: FloatArray) -> FloatArray:
    """The way from a point on the floor to what touches it [m], shape (2,); NaN where nothing does."""
    touching = sole[sole[:, 1] < _CONTACT_M][:, [0, 2]]
    if len(touching) < 3 or not np.isfinite(point).all():
        return np.full(2, np.nan)
    try:
        hull = ConvexHull(touching)
    except QhullError:
        return np.full(2, np.nan)
    if (hull.equations[:, :2] @ point + hull.equations[:, 2] <= 0).all():
        return np.zeros(2)
    start, end = touching[hull.simplices[:, 0]], touching[hull.simplices[:, 1]]
    side = end - start
    along = np.clip(((point - start) * side).sum(axis=1) / np.maximum((side**2).sum(axis=1), 1e-18), 0.0, 1.0)
    ways = start + along[:, None] * side - point
    return np.asarray(ways[np.linalg.norm(ways, axis=1).argmin()])
