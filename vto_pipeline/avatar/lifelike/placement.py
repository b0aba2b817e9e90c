"""Head, hands and feet of another body brought to where the avatar has its own.

Each goes there as it is, turned and scaled; only a head may be made less tall, so that its chin stays above the row of
the neck. Directions are the avatar's own: of its rows, its fingertips, its toes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from vto_pipeline.avatar.lifelike.graft import Seat, beyond
from vto_pipeline.geometry.section import plane_section
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.mesh import TriangleMesh

_SIDES = {"left": "l", "right": "r"}
_REACH = {"head": 0.05, "hand": 0.045, "foot": 0.07}
"""Over which a part takes on the avatar's shape, for a grown body [m]."""
_GROWN_M = 1.7
_CHIN_M = 0.012
"""Of a grown body's chin above the row of the neck."""
_LEAST_TALL = 0.79
"""Of a head's height, against its girth; a neck that leaves less room gets a smaller head."""
_ROUNDS = 8


@dataclass(frozen=True)
class Donor:
    """The body that parts are taken from, at rest.

    Args:
        mesh: Its surface [m], with colours.
        places: Name -> point, such as a joint [m].
    """

    mesh: TriangleMesh
    places: Mapping[str, FloatArray]


@dataclass(frozen=True)
class Part:
    """One part and where it goes.

    Args:
        joint: The avatar's joint that carries it.
        seat: Where it sits on the avatar.
        placed: The donor's vertices when the part is where it is to be [m], shape (V, 3).
        tip: A vertex of the donor that belongs to the part.
    """

    joint: str
    seat: Seat
    placed: FloatArray
    tip: int


def place_parts(avatar: Avatar, donor: Donor) -> list[Part]:
    """Return head, hands and feet, placed on the avatar in the bind pose."""
    sided = [place(avatar, donor, side) for side in _SIDES for place in (_hand, _foot)]
    return [_head(avatar, donor), *sided]


def _reach(avatar: Avatar, part: str) -> float:
    return _REACH[part] * float(np.ptp(avatar.bind_vertices[:, 1])) / _GROWN_M


def _head(avatar: Avatar, donor: Donor) -> Part:
    body, points = avatar.bind_vertices, donor.mesh.vertices
    row, crown = avatar.loops["head"], avatar.landmarks["crown"]
    low, high, girth = _girth(TriangleMesh(body, avatar.faces), body[row, 1].mean(), np.inf)
    top, below_top = body[crown, 1], body[crown, 1] - body[row, 1].mean()
    donor_top = int(np.argmax(points[:, 1]))
    jaw = _chin(donor)
    tall = points[donor_top, 1] - points[jaw, 1]
    room = top - body[avatar.loops["neck"], 1].mean() - _CHIN_M * top / _GROWN_M
    upright = room / tall
    for _ in range(_ROUNDS):  # the level at which both are measured scales along
        level = points[donor_top, 1] - below_top / upright
        donor_low, donor_high, donor_girth = _girth(donor.mesh, level, 0.5 * tall)
        scale = min(girth / donor_girth, room / (_LEAST_TALL * tall))
        upright = min(scale, room / tall)
    middle, donor_middle = (low + high) / 2, (donor_low + donor_high) / 2
    size = np.array([scale, upright, scale])
    placed = (points - [donor_middle[0], points[donor_top, 1], donor_middle[2]]) * size + [middle[0], top, middle[2]]
    seat = Seat(avatar.loops["neck"], crown, np.array([0.0, 1.0, 0.0]), _reach(avatar, "head"))
    return Part("head", seat, placed, donor_top)


def _girth(mesh: TriangleMesh, level: float, reach: float) -> tuple[FloatArray, FloatArray, float]:
    """Return the lowest and highest corner of a horizontal section near the median plane [m], and its girth [m]."""
    points = plane_section(mesh, np.array([0.0, level, 0.0]), np.array([0.0, 1.0, 0.0])).points
    points = points[np.abs(points[:, 0]) < reach]
    hull = ConvexHull(points[:, [0, 2]])
    return points.min(axis=0), points.max(axis=0), float(hull.area)


def _chin(donor: Donor) -> int:
    """Return the vertex of the chin's lowest point: straight below the mouth, in the median plane."""
    points, mouth = donor.mesh.vertices, donor.places["mouth"]
    eyes = (donor.places["l-eye"] + donor.places["r-eye"]) / 2
    face = np.linalg.norm(eyes - mouth)
    near = (np.abs(points[:, 0] - mouth[0]) < 0.2 * face) & (np.linalg.norm(points - mouth, axis=1) < 1.2 * face)
    near &= points[:, 2] > mouth[2] - 0.1 * face
    return int(np.argmin(np.where(near, points[:, 1], np.inf)))


def _hand(avatar: Avatar, donor: Donor, side: str) -> Part:
    body, points, short = avatar.bind_vertices, donor.mesh.vertices, _SIDES[side]
    row = avatar.loops[f"{side}_wrist"]
    wrist, elbow = body[row].mean(axis=0), body[avatar.loops[f"{side}_forearm"]].mean(axis=0)
    tip = avatar.landmarks[f"{side}_fingertip"]
    # a quarter round the row from its first vertex, which lies on the back of the hand, are little finger and thumb
    quarter = len(row) // 4
    frame = _frame(body[tip] - wrist, body[row[3 * quarter]] - body[row[quarter]])

    def place(name: str) -> FloatArray:
        return donor.places[f"{short}-{name}"]

    base, middle = place("hand"), place("finger-3-1")
    donor_frame = _frame(middle - base, place("finger-2-1") - place("finger-5-1"))
    donor_tip = _nearest(points, place("finger-3-4"))
    scale = float(np.linalg.norm(body[tip] - wrist) / ((points[donor_tip] - base) @ donor_frame[0]))
    placed = (points - base) @ donor_frame.T @ frame * scale + wrist
    axis = (wrist - elbow) / np.linalg.norm(wrist - elbow)
    return Part(f"{side}_wrist", Seat(row, tip, axis, _reach(avatar, "hand")), placed, donor_tip)


def _foot(avatar: Avatar, donor: Donor, side: str) -> Part:
    body, points, short = avatar.bind_vertices, donor.mesh.vertices, _SIDES[side]
    heel, toe = (body[avatar.landmarks[f"{side}_{name}"]] for name in ("heel", "toe"))
    up = np.array([0.0, 1.0, 0.0])
    seat = Seat(avatar.loops[f"{side}_ankle"], avatar.landmarks[f"{side}_toe"], -up, _reach(avatar, "foot"))
    ankle, tip = donor.places[f"{short}-ankle"], _nearest(points, donor.places[f"{short}-toe-2-4"])
    forward = points[tip] - ankle
    own = (np.linalg.norm(points - ankle, axis=1) < 2 * np.linalg.norm(forward)) & (points[:, 1] < ankle[1])
    donor_frame, frame = (_frame(along * (1, 0, 1), np.cross(up, along)) for along in (forward, toe - heel))
    along = (points - ankle) @ donor_frame[0]
    scale = float(np.linalg.norm((toe - heel) * (1, 0, 1)) / np.ptp(along[own]))
    placed = (points - ankle) @ donor_frame.T @ frame * scale
    # the shank stands on the foot as it does on the avatar's, heel at heel and sole on sole
    middle, sole = body[seat.row].mean(axis=0), body[beyond(TriangleMesh(body, avatar.faces), seat), 1].min()
    ahead = (heel - middle) @ frame[0] - scale * along[own].min()
    placed += (middle + ahead * frame[0]) * (1, 0, 1) + [0.0, sole - placed[own, 1].min(), 0.0]
    return Part(f"{side}_ankle", seat, placed, tip)


def _nearest(points: FloatArray, place: FloatArray) -> int:
    return int(np.argmin(np.linalg.norm(points - place, axis=1)))


def _frame(along: FloatArray, across: FloatArray) -> FloatArray:
    """Return a right-handed frame, rows: along; across as far as it is not along; across both."""
    first = along / np.linalg.norm(along)
    second = across - (across @ first) * first
    second /= np.linalg.norm(second)
    return np.stack([first, second, np.cross(first, second)])
