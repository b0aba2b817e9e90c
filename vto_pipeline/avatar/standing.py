"""A body mesh that others made: the axis along which it stands, its facing, its size, and whether it is one."""

from __future__ import annotations

import numpy as np

from vto_pipeline.avatar.scan.initial_pose import CHILD_M, best_axis, initial_poses
from vto_pipeline.avatar.scan.upright import AXES, in_metres
from vto_pipeline.errors import AvatarError
from vto_pipeline.geometry.topology import face_components
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud, TriangleMesh
from vto_pipeline.units import LENGTH_M

_LIKE_A_BODY_M = 0.06
"""Mean distance of the first guess: bodies of 20 to 200 kg that stand have 0.05 at most, lying ones 0.08 and more."""
_SIDEWAYS = np.cos(np.deg2rad(60.0))
_CLEARLY = 0.97
"""A guess of the facing counts where it is so much better than the one next to +Z; front and back differ by 6 %."""

_AS_TALL = 0.6
"""A piece so tall, as a share of the whole, is no arm and no leg that was modelled by itself."""


_PERSON_M = 1.7
_WHOLE_M = 0.045
"""Mean distance of the first guess at a person's size: whole bodies have 0.033 at most, parts 0.055 and more."""
_REACH_M = 2.5
"""From the floor to the hands of a tall person who raises them; what guesses a file's unit finds nothing larger [m]."""
_TAKEN_FOR = {"in": ("inches", "cm"), "ft": ("feet", "dm")}
"""Units that are not guessed -> their plural, and the metric unit in which a body has the size of a form."""


def refuse_misread_unit(scan: TriangleMesh) -> None:
    """Refuse a whole body that is smaller or larger than anybody who stands: its unit was misread.

    Raises:
        AvatarError: with the units in which it would be a person.
    """
    if (problem := misread_unit(scan)) is not None:
        raise AvatarError(problem, hint="give the unit; in a document: {file: body.ply, unit: in}")


def misread_unit(body: TriangleMesh | PointCloud) -> str | None:
    """Return what is wrong with the size of a whole body that is smaller or larger than anybody who stands, else None.

    Forms are as small, but have no head, arms and legs.

    Args:
        body: As it was read [m], any axis up.
    """
    points = body.vertices if isinstance(body, TriangleMesh) else body.points
    extent = np.ptp(points, axis=0)
    if CHILD_M <= extent.max() <= _REACH_M:
        return None
    for name, turn in AXES.items():
        height = float(extent["XYZ".index(name[1])])
        if height <= 0.5 * extent.max():
            continue
        person = (_PERSON_M / height) * points @ turn.T
        sized: TriangleMesh | PointCloud = PointCloud(person)
        if isinstance(body, TriangleMesh):
            sized = TriangleMesh(person, body.faces)
        if initial_poses(sized)[0].score < _WHOLE_M:
            return _no_such_person(height)
    return None


def _no_such_person(height: float) -> str:
    if height > CHILD_M:
        return f"a whole body of {height:.2f} m: no one is so tall"
    sizes = [(height * LENGTH_M[unit] / LENGTH_M[taken], name) for unit, (name, taken) in _TAKEN_FOR.items()]
    others = ", ".join(f"{size:.2f} m if the file is in {name}" for size, name in sizes)
    return f"a whole body of {height:.2f} m: no one who stands is so small ({others})"


def warn_of_misread_unit(body: TriangleMesh | PointCloud, job: Job) -> None:
    """Warn of a whole body that is smaller or larger than anybody who stands.

    Args:
        body: As it was read [m], any axis up.
        job: Warned.
    """
    if (problem := misread_unit(body)) is not None:
        job.warn(f"{problem}. If that is so, give the unit in a document: {{file: body.ply, unit: in}}")


def stood_up(body: TriangleMesh, job: Job) -> TriangleMesh:
    """Return a body mesh turned so that +Y is up: cloth falls along -Y. It stays whole; what is no body stays as it is.

    Its facing stays, since a garment may stand on it already; one that is not +Z is warned of.

    Args:
        body: In metres, any axis up.
        job: Notified of the turn, warned of the facing, and of a whole body that is too small for a person.
    """
    warn_of_misread_unit(body, job)
    found = best_axis(body)
    if found is None or found.guesses[0].score > _LIKE_A_BODY_M:
        return body
    best = found.guesses[0]
    ahead = max(found.guesses, key=lambda guess: np.cos(guess.yaw))
    if np.cos(best.yaw) < _SIDEWAYS and best.score < _CLEARLY * ahead.score:
        front = np.array([np.sin(best.yaw), np.cos(best.yaw)])  # along x and z
        axis = int(np.argmax(np.abs(front)))
        job.warn(
            f"the body faces {'-' if front[axis] < 0.0 else '+'}{'XZ'[axis]}, not +Z as files have it. A garment that "
            "was not made on it may be put on back to front; if so, turn the body"
        )
    if found.name == "+Y":
        return body
    job.note(f"{found.name} of the body mesh is up; it was turned so that +Y is up")
    return TriangleMesh(body.vertices @ found.turn.T, body.faces)


def turn_of(source: TriangleMesh, job: Job) -> FloatArray:
    """Return the turn that the avatar of a body has from its file: what makes +Y up, shape (4, 4).

    Args:
        source: The body that a garment was on, any axis up [m].
        job: Notified where that is a turn.
    """
    found, turn = best_axis(in_metres(source, Job())), np.eye(4)
    if found is not None and found.name != "+Y":
        job.note(f"{found.name} of the body that the garment was on is up; both were turned so that +Y is up")
        turn[:3, :3] = found.turn
    return turn


def warn_of_several(body: TriangleMesh, job: Job) -> None:
    """Warn of pieces as tall as bodies that stand beside each other: the garment goes onto the one that fills it best.

    Args:
        body: In metres, +Y up.
        job: Warned.
    """
    count, piece = face_components(body)
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    corners = body.vertices[body.faces]
    np.minimum.at(low, piece, corners.min(axis=1))
    np.maximum.at(high, piece, corners.max(axis=1))
    tall = np.flatnonzero((high - low)[:, 1] > _AS_TALL * np.ptp(body.vertices[:, 1]))
    apart = (low[tall][:, np.newaxis] > high[tall])[:, :, [0, 2]].any()
    if apart:
        job.warn(
            f"{len(tall)} bodies stand beside each other in the mesh: the garment is put on the one that fills it "
            "best; remove the others"
        )
