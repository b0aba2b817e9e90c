"""Continuous queries whose answer is known exactly, because they are built around it in whole numbers.

**Hits.** At the time m / 2^j the point of contact is a mixture of the corners in whole numbers. Each point has a motion
D in whole numbers, so from H it comes from H - m D at time 0 and gets to H + (2^j - m) D at time 1. Nothing is rounded:
coordinates stay below 2^53, and the scale is a power of two. The first contact is then no later than m / 2^j.

**Misses.** The least distance over the motion is known: features that slide in parallel planes, that turn together,
that pass each other's rim. Each is turned out of the axes by a whole-number matrix M with MᵀM = q², which scales
distances by q.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

IntArray = NDArray[np.int64]

CLOTH = -26
"""Exponent of the scale at which figures are about 16 mm."""
_WEIGHTS = 64  # shares of a corner are multiples of 1 / 64
_CORNER = 2**14  # corners are within this, times _WEIGHTS
_MOTION = 2**10  # motions per 2^-j of the time, times _WEIGHTS
_FAR = 2**51  # from the origin
REACH = 2**40
"""Size of a figure that misses, in whole numbers; its gap is at least 1."""
_FRAMES = np.array(
    [
        [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[1, 2, 2], [2, 1, -2], [2, -2, 1]],
        [[2, 3, 6], [3, -6, 2], [6, 2, -3]],
    ]
)
_TURNS = np.array([[4, 3], [3, 4], [0, 5]])  # 5 (cos, sin) of 37°, 53° and 90°


class Queries(NamedTuple):
    """Queries with their truth.

    Args:
        start, end: Positions, shape (N, 4, 3): vertex and face, or edge and edge.
        edges: Which of the two.
        latest: Time by which they have touched, exact; inf: they never do. Shape (N,).
        gap: Least distance as a share of the size; 0 for hits.
    """

    start: NDArray[np.float64]
    end: NDArray[np.float64]
    edges: bool
    latest: NDArray[np.float64]
    gap: float


@dataclass(frozen=True)
class Hits:
    """A family of hits.

    Args:
        shape: Of the triangle, or the two directions of the edges; "thin": nearly parallel, to one part in 2^14;
            "flat": no area, or an edge without length.
        place: Of the contact on them.
        motion: "grazing": at the contact the relative velocity is along the surface; "coplanar": all in one plane,
            at all times; "together": a large common motion and a small one of each; "still": none.
        ends: Contact at time 0 or 1.
        far: Far from the origin.
        exponents: Of the scale 2^k that makes metres of the whole numbers; the figures are about 2^20 of them.
    """

    shape: Literal["any", "thin", "flat"] = "any"
    place: Literal["inside", "rim"] = "inside"
    motion: Literal["any", "grazing", "coplanar", "together", "still"] = "any"
    ends: bool = False
    far: bool = False
    exponents: tuple[int, ...] = (CLOTH,)


HITS: Mapping[str, Hits] = {
    "plain": Hits(),
    "edge-on": Hits(place="rim"),
    "grazing": Hits(motion="grazing"),
    "grazing the rim": Hits(motion="grazing", place="rim"),
    "coplanar": Hits(motion="coplanar"),
    "coplanar at the rim": Hits(motion="coplanar", place="rim"),
    "near-parallel": Hits(shape="thin"),
    "near-parallel grazing": Hits(shape="thin", motion="grazing"),
    "degenerate": Hits(shape="flat"),
    "degenerate coplanar": Hits(shape="flat", motion="coplanar"),
    "still": Hits(motion="still"),
    "first or last instant": Hits(ends=True, place="rim"),
    "moving together, far": Hits(motion="together", far=True),
    "tiny": Hits(exponents=(-1074, -1060, -400, -60)),
    "huge": Hits(exponents=(0, 300, 900)),
    "tiny grazing": Hits(motion="grazing", exponents=(-1074, -600, -60)),
}
MISSES = ("sliding in parallel planes", "turning together", "past the rim")


def hits(name: str, count: int, edges: bool, seed: int) -> Queries:
    """Return queries of one family of `HITS`."""
    rng = np.random.default_rng(seed)
    family = HITS[name]
    build = _edges_that_touch if edges else _vertex_and_face
    contact, motion = build(rng, count, family)
    if family.motion == "coplanar":
        tilt = rng.integers(-3, 4, (count, 3, 2))
        contact, motion = contact[..., :2] @ tilt.swapaxes(1, 2), motion[..., :2] @ tilt.swapaxes(1, 2)
    if family.motion == "together":
        motion += rng.integers(-(2**30), 2**30, (count, 1, 3))
    halvings = rng.integers(0, 11, count)
    whole = 2**halvings
    part = whole * rng.integers(0, 2, count) if family.ends else rng.integers(0, whole + 1)
    if family.motion == "still":
        motion, part = 0 * motion, 0 * part
    offset = rng.integers(-_FAR, _FAR, (count, 1, 3)) if family.far else 0
    start = contact + offset - part[:, None, None] * motion
    end = start + whole[:, None, None] * motion
    scale = np.exp2(rng.choice(family.exponents, count))[:, None, None]
    return Queries(start * scale, end * scale, edges, part / whole, 0.0)


def misses(name: str, gap: int, count: int, edges: bool, seed: int) -> Queries:
    """Return queries of one family of `MISSES` that come as near as `gap` / 2^40 of their size, and no nearer."""
    rng = np.random.default_rng(seed)
    if name == "turning together":
        figure = np.roll(_crossing(rng, count, edges, gap), 1, axis=-1)  # the gap along x, in the plane of the turn
        cosine, sine = _TURNS[rng.integers(0, len(_TURNS), count)].T
        start = 5 * figure
        x, y, z = np.moveaxis(figure, -1, 0)
        cosine, sine = cosine[:, None], sine[:, None]
        end = np.stack([cosine * x - sine * y, sine * x + cosine * y, 5 * z], axis=-1)
    else:
        if name == "past the rim":
            figure, motion = _passing(rng, count, edges, gap)
        else:
            figure = _crossing(rng, count, edges, gap)
            motion = rng.integers(-REACH // 4, REACH // 4, figure.shape)
            motion[..., 2] = 0
        quarter = rng.integers(0, 5, (count, 1, 1))
        start, end = figure - quarter * (motion // 4), figure + (4 - quarter) * (motion // 4)
    frame = _FRAMES[rng.integers(0, len(_FRAMES), count)]
    start, end = start @ frame.swapaxes(1, 2), end @ frame.swapaxes(1, 2)
    scale = 2.0 ** (CLOTH - 20)  # to the size of the hits
    return Queries(start * scale, end * scale, edges, np.full(count, np.inf), gap / REACH)


def _vertex_and_face(rng: np.random.Generator, count: int, family: Hits) -> tuple[IntArray, IntArray]:
    """Return the touching vertex and face, and their motions; shape (N, 4, 3) each."""
    corners = _WEIGHTS * rng.integers(-_CORNER, _CORNER, (count, 3, 3))
    if family.shape == "thin":
        side = corners[:, 1] - corners[:, 0]
        corners[:, 2] = corners[:, 0] + side + _WEIGHTS * rng.integers(-1, 2, (count, 3))
    elif family.shape == "flat":
        share = rng.integers(-1, 3, (count, 2, 1))  # all on one line, some in one point
        corners[:, 1:] = corners[:, :1] + share * _WEIGHTS * rng.integers(-_CORNER, _CORNER, (count, 1, 3))
    cuts = np.sort(rng.integers(1, _WEIGHTS, (count, 2)), axis=1)
    weights = np.column_stack([cuts[:, 0], cuts[:, 1] - cuts[:, 0], _WEIGHTS - cuts[:, 1]])
    if family.place == "rim":
        away = rng.integers(0, 3, count)  # this corner has no share; every other query one more corner has none
        here = (away + 1) % 3
        row = np.arange(count)
        weights[row, here] += weights[row, away]
        weights[row, away] = 0
        weights[::2] = _WEIGHTS * (np.arange(3) == here[::2, None])
    velocities = _WEIGHTS * rng.integers(-_MOTION, _MOTION, (count, 3, 3))
    vertex = np.einsum("nk,nkd->nd", weights, corners) // _WEIGHTS
    if family.motion == "grazing":
        along = rng.integers(-2, 3, (count, 2, 1)) * (corners[:, 1:] - corners[:, :1]) // _WEIGHTS
        velocity = np.einsum("nk,nkd->nd", weights, velocities) // _WEIGHTS + along.sum(axis=1)
    else:
        velocity = _WEIGHTS * rng.integers(-_MOTION, _MOTION, (count, 3))
    return np.concatenate([vertex[:, None], corners], axis=1), np.concatenate([velocity[:, None], velocities], axis=1)


def _edges_that_touch(rng: np.random.Generator, count: int, family: Hits) -> tuple[IntArray, IntArray]:
    """Return two touching edges and their motions; shape (N, 4, 3) each."""
    place = _WEIGHTS * rng.integers(-_CORNER, _CORNER, (count, 3))
    along = rng.integers(-_CORNER, _CORNER, (2, count, 3))
    if family.shape == "thin":
        along[1] = along[0] + rng.integers(-1, 2, (count, 3))
    elif family.shape == "flat":
        along[1] = rng.integers(-1, 2, (count, 1)) * along[0]
        along[0, ::3] = 0
    reach = rng.integers(1, _WEIGHTS, (2, 2, count, 1))  # of each edge: how far its first and its second end are
    if family.place == "rim":
        reach[0, rng.integers(0, 2, count), np.arange(count)] = 0
        reach[1, rng.integers(0, 2, count)[::2], np.arange(0, count, 2)] = 0
    velocity = _WEIGHTS * rng.integers(-_MOTION, _MOTION, (2, count, 3))
    if family.motion == "grazing":
        velocity[1] = velocity[0] + (rng.integers(-2, 3, (2, count, 1)) * along).sum(axis=0)
    spin = rng.integers(-_MOTION, _MOTION, (2, count, 3))  # about the point of contact
    ends, motions = [], []
    for k in range(2):
        for sign, far in ((-1, reach[k, 0]), (1, reach[k, 1])):
            ends.append(place + sign * far * along[k])
            motions.append(velocity[k] + sign * far * spin[k])
    return np.stack(ends, axis=1), np.stack(motions, axis=1)


def _crossing(rng: np.random.Generator, count: int, edges: bool, gap: int) -> IntArray:
    """Return features in the planes z = 0 and z = gap, one over the inside of the other; shape (N, 4, 3)."""
    angle = rng.uniform(0.0, 2.0 * np.pi, (count, 1))
    if edges:
        angle = angle + np.array([0.0, 1.0, 0.3, 1.3]) * np.pi
    else:
        angle = angle + np.array([0.0, 0.0, 0.6, 1.3]) * np.pi
    figure = np.zeros((count, 4, 3), np.int64)
    radius = rng.integers(REACH // 8, REACH, (count, 4))
    figure[..., 0], figure[..., 1] = radius * np.cos(angle), radius * np.sin(angle)
    if edges:
        figure[:, 2:, 2] = gap
    else:
        figure[:, 0] = 0, 0, gap
    return figure


def _passing(rng: np.random.Generator, count: int, edges: bool, gap: int) -> tuple[IntArray, IntArray]:
    """Return a feature about to pass the rim of another at the least distance `gap`, and motions; shapes (N, 4, 3)."""
    figure = np.zeros((count, 4, 3), np.int64)
    radius = rng.integers(REACH // 8, REACH, (count, 3))
    first = figure[:, :2] if edges else figure[:, 1:3]  # the edge along x that is passed
    first[:, 0, 0], first[:, 1, 0] = -radius[:, 0], radius[:, 1]
    if edges:
        figure[:, 2, 1], figure[:, 3, 1] = gap, gap + radius[:, 2]
        moving = slice(2, 4)
    else:
        figure[:, 0, 1], figure[:, 3, 1] = -gap, radius[:, 2]
        moving = slice(0, 1)
    motion = np.zeros_like(figure)
    motion += rng.integers(-REACH // 4, REACH // 4, (count, 1, 3))
    motion[:, moving, 2] += rng.integers(REACH // 8, REACH, (count, 1))
    motion[:, moving, 0] += rng.integers(-REACH // 16, REACH // 16, (count, 1))
    return figure, motion
