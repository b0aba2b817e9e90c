"""Tangled starts: cloth that passes through itself or a body, each slightly different for each seed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

_EDGE = 0.014  # [m]
_NOISE = 5e-4  # of each vertex [m]: the scene is nowhere symmetric

_Generator = np.random.Generator
_Mesh = tuple[FloatArray, IntArray]


@dataclass(frozen=True)
class BadStart:
    """A tangle.

    Args:
        positions: Of the cloth [m], shape (V, 3).
        faces: Shape (F, 3).
        body: What else is in the way.
    """

    positions: FloatArray
    faces: IntArray
    body: TriangleMesh | None = None


def bad_start(name: str, seed: int) -> BadStart:
    """Return one of `BAD_STARTS`, jittered."""
    rng = np.random.default_rng(seed)
    (positions, faces), body = BAD_STARTS[name](rng)
    return BadStart(positions + _NOISE * rng.uniform(-1.0, 1.0, positions.shape), faces, body)


def _crossed(rng: _Generator) -> tuple[_Mesh, None]:
    """A sheet that stands in another, less than half of it through: a contour between two points of its boundary."""
    x, faces = _sheet(0.2, 0.2)
    x = _turned(
        _turned(_moved(x, -0.1, 0.0, -0.1), 0, 0.5 * np.pi + rng.uniform(-0.6, 0.6)), 1, rng.uniform(0.0, np.pi)
    )
    x = _moved(x, 0.15, rng.choice([-1.0, 1.0]) * rng.uniform(0.04, 0.07), 0.15 + rng.uniform(-0.02, 0.02))
    return _concatenate(_sheet(0.3, 0.3), (x, faces)), None


def _corner(rng: _Generator) -> tuple[_Mesh, None]:
    """The corner of a sheet through another: a short contour between two sides."""
    x, faces = _sheet(0.2, 0.2)
    x = _turned(_turned(x, 1, 0.25 * np.pi), 0, rng.uniform(0.5, 1.2))
    x = _moved(x, 0.05, -rng.uniform(0.02, 0.04), 0.15)
    return _concatenate(_sheet(0.3, 0.3), (x, faces)), None


def _woven(rng: _Generator) -> tuple[_Mesh, None]:
    """Two sheets side by side, half of the one's rim above and half below the other: boundary to boundary."""
    x, faces = _sheet(0.2, 0.2)
    x = _turned(_moved(x, -0.1, 0.0, -0.1), 0, rng.choice([-1.0, 1.0]) * rng.uniform(0.15, 0.4))
    x = _moved(x, 0.22 + rng.uniform(-0.02, 0.02), 0.0, 0.1 + rng.uniform(-0.03, 0.03))
    return _concatenate(_sheet(0.2, 0.2), (x, faces)), None


def _sleeve(rng: _Generator) -> tuple[_Mesh, None]:
    """The end of a tube through the side of a larger one: a contour closed on both."""
    x, faces = _tube(0.05, 0.3)
    x = _turned(x, 2, -0.5 * np.pi + rng.uniform(-0.3, 0.3))
    x = _moved(x, 0.15 - rng.uniform(0.02, 0.06), 0.2, rng.uniform(-0.03, 0.03))
    return _concatenate(_tube(0.15, 0.4), (x, faces)), None


def _collar(rng: _Generator) -> tuple[_Mesh, None]:
    """A sheet folded over, its flap, narrower than what it lies on, steeply through itself."""
    x, faces = _sheet(0.25, 0.4)
    fold, radius, tilt = 0.2 + rng.uniform(-0.01, 0.01), 0.02, rng.uniform(0.35, 0.6)
    past = x[:, 2] - fold
    angle, flap = np.clip(past / radius, 0.0, np.pi), np.maximum(past - np.pi * radius, 0.0)
    y = np.where(past < 0.0, 0.0, radius * (1.0 - np.cos(angle))) - flap * np.sin(tilt)
    z = np.where(past < 0.0, x[:, 2], fold + radius * np.sin(angle)) - flap * np.cos(tilt)
    return (np.column_stack([x[:, 0], y, z]), faces), None


def _layers(rng: _Generator) -> tuple[_Mesh, None]:
    """A tube in a tube, 3 mm apart, which comes through in a few places: closed contours."""
    x, faces = _tube(0.1, 0.25)
    outward = x * [1.0, 0.0, 1.0] / np.hypot(x[:, 0], x[:, 2])[:, None]
    for place in x[rng.integers(len(x), size=5)]:
        x = x + outward * (rng.uniform(6e-3, 12e-3) * np.exp(-((x - place) ** 2).sum(axis=1) / 0.03**2))[:, None]
    return _concatenate(_tube(0.103, 0.24), (x, faces)), None


def _tip(rng: _Generator) -> tuple[_Mesh, None]:
    """One vertex through the middle of a large triangle: a loop within one face."""
    x, faces = _sheet(0.1, 0.1)
    x = _moved(x, rng.uniform(0.0, 0.1), 0.004, rng.uniform(0.0, 0.1))
    coarse = _sheet(0.24, 0.24, 0.08)
    inner = np.abs(x - x.mean(axis=0)).max(axis=1) < 0.03
    face = coarse[0][coarse[1]].mean(axis=1)
    middle = face[((face[:, None] - x[inner]) ** 2).sum(axis=2).min(axis=1).argmin()]
    x[np.flatnonzero(inner)[((x[inner] - middle) ** 2).sum(axis=1).argmin()], 1] = -0.003
    return _concatenate(coarse, (x, faces)), None


def _shifted(rng: _Generator) -> tuple[_Mesh, TriangleMesh]:
    """A tube about a rounded body, too far to one side."""
    side = rng.uniform(0.0, 2.0 * np.pi)
    x, faces = _tube(0.108, 0.25)
    far = rng.uniform(0.010, 0.016)
    x = _moved(x, far * np.cos(side), 0.0, far * np.sin(side))
    return (x, faces), _ball((0.0, 0.125, 0.0), (0.1, 0.3, 0.1))


def _unclean(rng: _Generator) -> tuple[_Mesh, TriangleMesh]:
    """A tube about two balls that overlap, one of them with a hole."""
    side = rng.uniform(0.0, 2.0 * np.pi)
    x, faces = _tube(0.122, 0.2)
    far = rng.uniform(0.025, 0.030)
    x = _moved(x, far * np.cos(side), 0.0, far * np.sin(side))
    one, other = _ball((0.0, 0.06, 0.0), (0.1, 0.1, 0.1)), _ball((0.0, 0.14, 0.0), (0.1, 0.1, 0.1))
    open_below = one.faces[one.vertices[one.faces].mean(axis=1)[:, 1] > -0.03]
    vertices, joined = _concatenate((one.vertices, open_below), (other.vertices, other.faces))
    return (x, faces), TriangleMesh(vertices, joined)


BAD_STARTS: dict[str, Callable[[_Generator], tuple[_Mesh, TriangleMesh | None]]] = {
    "crossed sheets": _crossed,
    "corner through sheet": _corner,
    "boundary to boundary": _woven,
    "sleeve through torso": _sleeve,
    "collar through itself": _collar,
    "inner layer through outer": _layers,
    "loop in one face": _tip,
    "garment in body": _shifted,
    "garment in unclean body": _unclean,
}
"""Name -> cloth and body for a generator of random numbers."""


def _sheet(width: float, depth: float, edge: float = _EDGE) -> _Mesh:
    """A rectangle in the plane y = 0 with alternating diagonals, from the origin along +x and +z."""
    columns, rows = round(width / edge) + 1, round(depth / edge) + 1
    z, x = np.meshgrid(np.linspace(0.0, depth, rows), np.linspace(0.0, width, columns), indexing="ij")
    points = np.column_stack([x.ravel(), np.zeros(x.size), z.ravel()])
    row, column = (axis.ravel() for axis in np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij"))
    a = row * columns + column
    return points, _split(a, a + 1, a + columns, a + columns + 1, (row + column) % 2 == 1)


def _tube(radius: float, height: float) -> _Mesh:
    """An open cylinder about +y, from the origin."""
    around, rings = round(2.0 * np.pi * radius / _EDGE / 2) * 2, round(height / _EDGE) + 1
    angle = np.tile(2.0 * np.pi * np.arange(around) / around, rings)
    y = np.repeat(np.linspace(0.0, height, rings), around)
    points = np.column_stack([radius * np.cos(angle), y, radius * np.sin(angle)])
    row, column = (axis.ravel() for axis in np.meshgrid(np.arange(rings - 1), np.arange(around), indexing="ij"))
    a, b = row * around + column, row * around + (column + 1) % around
    return points, _split(b, a, b + around, a + around, (row + column) % 2 == 1)


def _split(a: IntArray, b: IntArray, c: IntArray, d: IntArray, odd: IntArray) -> IntArray:
    """Return the triangles of the squares a b d c, cut along ad, or along bc where odd."""
    first = np.where(odd[:, None], np.column_stack([a, c, b]), np.column_stack([a, d, b]))
    second = np.where(odd[:, None], np.column_stack([b, c, d]), np.column_stack([a, c, d]))
    return np.vstack([first, second]).astype(np.int32)


def _ball(center: tuple[float, float, float], radii: tuple[float, float, float]) -> TriangleMesh:
    """An ellipsoid of about 20 mm edges."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=3, radius=1.0)
    return TriangleMesh(np.asarray(ball.vertices) * radii + center, ball.faces)


def _moved(points: FloatArray, x: float, y: float, z: float) -> FloatArray:
    """Return the points shifted [m]."""
    return points + np.array([x, y, z])


def _turned(points: FloatArray, axis: int, angle: float) -> FloatArray:
    """Return the points turned about a coordinate axis [rad]."""
    u, v = (axis + 1) % 3, (axis + 2) % 3
    result = points.copy()
    result[:, u] = np.cos(angle) * points[:, u] - np.sin(angle) * points[:, v]
    result[:, v] = np.sin(angle) * points[:, u] + np.cos(angle) * points[:, v]
    return result


def _concatenate(one: _Mesh, other: _Mesh) -> _Mesh:
    """Return two meshes as one, not welded."""
    return np.vstack([one[0], other[0]]), np.vstack([one[1], other[1] + len(one[0])]).astype(np.int32)
