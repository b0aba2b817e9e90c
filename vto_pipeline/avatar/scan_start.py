"""Where to begin a registration: a cleaned scan, and the facing, place, size and arm pose that explain it best."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vto_pipeline.avatar.pose import named_pose
from vto_pipeline.avatar.template import template
from vto_pipeline.errors import AvatarError
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.geometry.topology import face_components, submesh
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

_PROBES = 700
_SMALL_PIECE = 0.02
_CAP_M = 0.15
_FLAT_M = 0.12
_FULL_BODY_M = (1.30, 2.30)
_MIN_HEIGHT_M = 0.35
_PART_SCALES = (0.92, 1.0, 1.08)
_PART_BOTTOMS = np.arange(0.0, 1.25, 0.04)
"""At which height of the template a partial scan may end below [m]."""


@dataclass(frozen=True)
class Start:
    """A first guess.

    Args:
        yaw: Facing, rotation about +Y [rad].
        scale: Size relative to the template.
        translation: [m], shape (3,).
        pose_name: The nearest standard pose.
        score: Mean capped distance [m]; smaller is better.
    """

    yaw: float
    scale: float
    translation: FloatArray
    pose_name: str
    score: float


def clean(scan: TriangleMesh, job: Job) -> TriangleMesh:
    """Return the scan without crumbs and floor pieces.

    Raises:
        AvatarError: what is left is too small for a body.
    """
    count, piece = face_components(scan)
    corners = scan.vertices[scan.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    total = np.bincount(piece, area, count)
    high, low = np.full(count, -np.inf), np.full(count, np.inf)
    np.maximum.at(high, piece, corners[:, :, 1].max(axis=1))
    np.minimum.at(low, piece, corners[:, :, 1].min(axis=1))
    good = (total > _SMALL_PIECE * total.max()) & (high - low > _FLAT_M)
    if not good.any():
        raise AvatarError("the scan holds no piece tall enough for a body", hint="is the unit metres and +Y up?")
    if not good.all():
        job.note(f"{int((~good).sum())} of {count} pieces of the scan left out: crumbs or flat pieces such as a floor")
    kept = submesh(scan, good[piece])[0]
    height = float(np.ptp(kept.vertices[:, 1]))
    if not _MIN_HEIGHT_M < height < _FULL_BODY_M[1]:
        raise AvatarError(
            f"the scan is {height:.2f} m tall; a body or a dress form is {_MIN_HEIGHT_M} to {_FULL_BODY_M[1]} m",
            hint="check the unit, and that +Y is up",
        )
    return kept


def starts(scan: TriangleMesh) -> list[Start]:
    """Return the best guess for each of four facings, best first.

    Args:
        scan: Cleaned.
    """
    probes, _, _ = sample_surface(scan, _PROBES, 0)
    middle = probes.mean(axis=0)
    spread = (probes - middle)[:, [0, 2]]
    wide = np.linalg.eigh(spread.T @ spread)[1][:, -1]
    # the body is widest from side to side: the other two facings are there for forms without arms
    across = float(np.arctan2(-wide[1], wide[0]))
    found = [_best(probes, across + turn) for turn in (0.0, np.pi, np.pi / 2, -np.pi / 2)]
    return sorted(found, key=lambda start: start.score)


def _best(probes: FloatArray, yaw: float) -> Start:
    """Search size, height and arm pose on a grid; the sides are centred."""
    back = _about_y(-yaw)
    turned = probes @ back.T
    height = float(np.ptp(turned[:, 1]))
    body = template(0.5)
    stature = float(np.ptp(body.vertices[:, 1]))
    best: Start | None = None
    for name in ("a_pose", "arms_down", "t_pose"):
        points = named_pose(body, name).vertices
        tree = cKDTree(points[::2])
        for scale, lift in _sizes(turned, height, stature):
            local = (turned - [0.0, lift, 0.0]) / scale
            side = np.median(local[:, 0])
            for depth in (-0.04, 0.0, 0.04):
                shift = np.array([side, 0.0, np.median(local[:, 2]) + depth + 0.01])
                distance, _ = tree.query(local - shift, distance_upper_bound=_CAP_M)
                score = float(np.minimum(distance, _CAP_M).mean())
                if best is None or score < best.score:
                    place = back.T @ (scale * shift + [0.0, lift, 0.0])
                    best = Start(yaw, scale, place, name, score)
    assert best is not None
    return best


def _sizes(points: FloatArray, height: float, stature: float) -> list[tuple[float, float]]:
    """Sizes and lifts to try: of a whole body the height says both, of a part neither."""
    low = float(points[:, 1].min())
    if height > _FULL_BODY_M[0]:
        return [(height / stature, low)]
    return [(scale, lift) for scale in _PART_SCALES for lift in low - _PART_BOTTOMS * scale]


def _about_y(angle: float) -> NDArray[np.float64]:
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
