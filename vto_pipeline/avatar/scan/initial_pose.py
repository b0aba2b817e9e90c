"""Initial guess of a registration: axis, facing, place, size and arm pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vto_pipeline.avatar.model.pose import named_pose
from vto_pipeline.avatar.scan.upright import candidate_up_rotations, inside_out, without_floor
from vto_pipeline.avatar.template.template import template
from vto_pipeline.errors import AvatarError
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud, TriangleMesh

_PROBES = 300
_PLACE_M = 0.03
"""One point of a cloud counts in each cube of this side [m]: clouds are denser at faces and hands."""
_CAP_M = 0.15
_SURELY_WHOLE_M, CHILD_M = 1.30, 0.80
"""A scan this tall is of a whole body; one less tall is of a child or of a part; a smaller one is of a part."""
_SURE_M = 0.035
"""A body that is matched so well by the first guess stands along +Y."""
_OTHER_AXIS = 1.25
_PART_SCALES = (0.92, 1.0, 1.08)
_PART_BOTTOMS = np.arange(0.0, 1.25, 0.04)
"""At which height of the template a partial scan may end below [m]."""


@dataclass(frozen=True)
class InitialPose:
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


@dataclass(frozen=True)
class Upright:
    """A scan along the axis that explains it best.

    Args:
        name: The file's axis that is up, such as "+Z".
        turn: What makes that axis +Y, shape (3, 3).
        inside_out: Whether its faces were flipped.
        stands: The scan, +Y up, without floor.
        guesses: The best guess for each facing, best first.
    """

    name: str
    turn: FloatArray
    inside_out: bool
    stands: TriangleMesh
    guesses: list[InitialPose]


def upright_initial_poses(scan: TriangleMesh, job: Job) -> tuple[TriangleMesh, list[InitialPose]]:
    """Return the scan with +Y up, facing outwards and without floor, and the guesses for it, best first.

    The file's own +Y is kept unless another axis explains the scan clearly better.

    Args:
        scan: In metres.
        job: Notified of a turn.
    """
    found = best_axis(scan)
    if found is None:
        raise AvatarError("the scan is not as tall as a body or a dress form in any direction", hint="check the unit")
    if len(found.stands.faces) < len(scan.faces):
        job.note("cut off a floor that was joined to the feet")
    if found.name != "+Y":
        job.note(f"{found.name} of the scan is up; the avatar is rotated so that +Y is up")
    if found.inside_out:
        job.note("the scan was inside out; its faces were flipped")
    return found.stands, found.guesses


def best_axis(scan: TriangleMesh) -> Upright | None:
    """Return a scan, in metres, with the axis up that explains it best, or None where it is tall along none.

    The file's own +Y is kept unless another axis explains the scan clearly better.
    """
    best: tuple[float, Upright] | None = None
    for name, turn in candidate_up_rotations(scan).items():
        stands = without_floor(TriangleMesh(scan.vertices @ turn.T, scan.faces))
        if over := inside_out(stands):
            stands = TriangleMesh(stands.vertices, stands.faces[:, ::-1])
        guesses = initial_poses(stands)
        score = guesses[0].score * (1.0 if name == "+Y" else _OTHER_AXIS)
        if best is None or score < best[0]:
            best = (score, Upright(name, turn, over, stands, guesses))
        if name == "+Y" and score < _SURE_M:
            break
    return None if best is None else best[1]


def initial_poses(scan: TriangleMesh | PointCloud) -> list[InitialPose]:
    """Return the best guess for each of four facings, best first.

    Args:
        scan: In metres, +Y up.
    """
    probes = _probes(scan)
    middle = probes.mean(axis=0)
    spread = (probes - middle)[:, [0, 2]]
    wide = np.linalg.eigh(spread.T @ spread)[1][:, -1]
    # the body is widest from side to side: the other two facings are there for forms without arms
    across = float(np.arctan2(-wide[1], wide[0]))
    found = [_best(probes, across + turn) for turn in (0.0, np.pi, np.pi / 2, -np.pi / 2)]
    return sorted(found, key=lambda start: start.score)


def _probes(scan: TriangleMesh | PointCloud) -> FloatArray:
    if isinstance(scan, TriangleMesh):
        return sample_surface(scan, _PROBES, 0)[0]
    _, kept = np.unique(np.floor(scan.points / _PLACE_M), axis=0, return_index=True)
    return scan.points[np.random.default_rng(0).choice(kept, min(_PROBES, len(kept)), replace=False)]


def _best(probes: FloatArray, yaw: float) -> InitialPose:
    """Search size, height and arm pose on a grid; the sides are centred."""
    back = _about_y(-yaw)
    turned = probes @ back.T
    height = float(np.ptp(turned[:, 1]))
    body = template(0.5)
    stature = float(np.ptp(body.vertices[:, 1]))
    best: InitialPose | None = None
    for name in ("a_pose", "arms_down", "t_pose"):
        points = named_pose(body, name).vertices
        tree = cKDTree(points[::2])
        for scale, floor_y in _sizes(turned, height, stature):
            local = (turned - [0.0, floor_y, 0.0]) / scale
            side = np.median(local[:, 0])
            for depth in (-0.04, 0.0, 0.04):
                shift = np.array([side, 0.0, np.median(local[:, 2]) + depth + 0.01])
                distance, _ = tree.query(local - shift, distance_upper_bound=_CAP_M)
                score = float(np.minimum(distance, _CAP_M).mean())
                if best is None or score < best.score:
                    place = back.T @ (scale * shift + [0.0, floor_y, 0.0])
                    best = InitialPose(yaw, scale, place, name, score)
    assert best is not None
    return best


def _sizes(points: FloatArray, height: float, stature: float) -> list[tuple[float, float]]:
    """Sizes and lifts to try: of a whole body the height says both, of a part neither."""
    low = float(points[:, 1].min())
    whole = [(height / stature, low)]
    if height > _SURELY_WHOLE_M:
        return whole
    parts = [(scale, floor_y) for scale in _PART_SCALES for floor_y in low - _PART_BOTTOMS * scale]
    return parts + (whole if height > CHILD_M else [])


def _about_y(angle: float) -> NDArray[np.float64]:
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
