"""Sleeves and legs of a garment put on the limbs that are meant for them, whatever the pose.

The tube of cloth behind an opening is laid along the limb's line: its rings about the line, turned from the tube's own
direction to the limb's. How far up the limb is found as a tailor does: from cuff to cuff across the back, the body
measures as much as the garment. Trousers that reach below the ankle are gathered above the foot, which is wider than a
leg of trousers. The rest of the garment follows as rigidly as it can.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from vto_pipeline.cloth.placement.limbs.limbs import Limb, Limbs
from vto_pipeline.cloth.placement.limbs.openings import Piece
from vto_pipeline.cloth.placement.rigidity import Rigidity
from vto_pipeline.geometry.geodesic import distance_from
from vto_pipeline.geometry.topology import edges
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

_ROUNDS = 40
_STILL = 1e-3  # m: no vertex moves farther in the last round
_ANKLE = 0.06  # of the body's height
_FOLD, _BULGE = 6.0, 0.3  # edges along each fold of what is gathered, and how far out it goes, of the tube's radius
_HELD = 1e-3  # of the weight of a sleeve: what nothing leads stays where it is


def lead_onto_limbs(
    garment: TriangleMesh, body: TriangleMesh, limbs: Limbs, thin: TriangleMesh, pieces: Sequence[Piece]
) -> TriangleMesh:
    """Return the garment with the openings that are meant for one limb each laid about it.

    Args:
        garment: In its place about the body [m].
        body: [m].
        limbs: Its limbs.
        thin: The same triangles, of a body so thin that its limbs are lines [m].
        pieces: Of the garment, with the opening that is meant for each limb.
    """
    wanted, weight = garment.vertices.copy(), np.full(len(garment.vertices), _HELD)
    ways = limbs.ways_in(thin)
    for piece in pieces:
        for number, opening in enumerate(piece.meant):
            if opening < 0 or piece.meant.count(opening) > 1 or limbs.limbs[number].name == "head":
                continue
            far = _up_the_limb(piece, number, body, limbs.limbs)
            limb = limbs.limbs[number]
            least = _ankle(limb, body) if limb.name.endswith("leg") else -np.inf
            behind, places = _laid_along(piece, opening, limb, far, least, ways[number])
            wanted[piece.vertices[behind]], weight[piece.vertices[behind]] = places, 1.0
    if (weight == _HELD).all():
        return garment
    rigidity, x = Rigidity(garment), garment.vertices
    for _ in range(_ROUNDS):
        before, x = x, rigidity.follow(x, wanted, weight)
        if np.abs(x - before).max() < _STILL:
            break
    return TriangleMesh(x, garment.faces)


def _up_the_limb(piece: Piece, number: int, body: TriangleMesh, limbs: Sequence[Limb]) -> float:
    """Return how far from a limb's end its opening is to lie [m]; negative where the sleeve is longer than the limb."""
    opening, limb = piece.meant[number], limbs[number]
    kind = limb.name.split()[-1]  # its pair is of the same, as far as limbs have names
    others = [
        k
        for k, other in enumerate(piece.meant)
        if k != number and piece.meant.count(other) == 1 and limbs[k].name.endswith(kind) and kind != "limb"
    ]
    if not others:
        shoulder = limb.axis[np.searchsorted(limb.along, limb.joins)]
        return limb.joins - float(np.linalg.norm(piece.mesh.vertices[piece.openings[opening]].mean(axis=0) - shoulder))
    other = others[0]
    across = distance_from(piece.mesh, piece.openings[opening], np.inf)[piece.openings[piece.meant[other]]].min()
    whole = distance_from(body, np.array([limb.tip], np.int32), np.inf)[limbs[other].tip]
    return 0.5 * float(whole - across)


def _ankle(leg: Limb, body: TriangleMesh) -> float:
    """Return how far from the end of a leg its ankle is, along the foot and up [m]."""
    height = body.vertices[:, 1]
    above = leg.axis[:, 1] - height.min() > _ANKLE * np.ptp(height)
    return float(leg.along[above.argmax()])


def _laid_along(
    piece: Piece, opening: int, limb: Limb, far: float, least: float, way: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Return the vertices of the tube behind an opening, shape (N,), and their places about a limb [m], shape (N, 3).

    Args:
        piece: With the opening.
        opening: Its index.
        limb: That goes there.
        far: From the limb's end to the opening, were the tube straight [m].
        least: As far at least is the opening to be: then the tube is gathered behind it [m].
        way: In along the limb's middle, where an armhole goes, shape (M, 3) [m].
    """
    mesh, loop = piece.mesh, piece.openings[opening]
    step = _median_edge(mesh)
    depth = distance_from(mesh, loop, np.inf)
    others = [k for k in range(len(piece.openings)) if k != opening]
    end = min([max(limb.joins - far, 0.0), *(0.4 * depth[piece.openings[k]].min() for k in others)])
    behind = np.flatnonzero(depth <= max(end, step)).astype(np.int32)
    ring = np.minimum(depth[behind] / (1.5 * step), np.floor(max(end, step) / (1.5 * step))).astype(np.int64)
    count = ring.max() + 1
    size = np.maximum(np.bincount(ring, minlength=count), 1)
    middle = np.stack([np.bincount(ring, x, count) for x in mesh.vertices[behind].T], axis=1) / size[:, None]
    middle[0] = mesh.vertices[loop].mean(axis=0)
    at = far + np.bincount(ring, depth[behind], count) / size
    gathered = 1.0
    if far < least < at[-1]:
        gathered = float((at[-1] - least) / (at[-1] - at[0]))
        at = at[-1] - gathered * (at[-1] - at)
    own = _direction(middle) if count > 2 else np.repeat(_normal(mesh.vertices[loop])[None], count, axis=0)
    goal, theirs = _on_line(limb, at)
    if count <= 2:  # an armhole
        goal[:] = _nearest(way, middle[0])
        own *= np.sign((own * theirs).sum(axis=1, keepdims=True))
    turn = _between(own, theirs, 1.0 if count > 2 else 0.5)
    off = mesh.vertices[behind] - middle[ring]
    along = (off * own[ring]).sum(axis=1, keepdims=True) * own[ring]
    folds = np.cos(2.0 * np.pi * depth[behind] / (_FOLD * step))[:, None]
    off = gathered * along + (1.0 + (1.0 - gathered) * _BULGE * folds) * (off - along)
    places = goal[ring] + np.einsum("nij,nj->ni", turn[ring], off)
    return behind, places


def _nearest(points: FloatArray, to: FloatArray) -> FloatArray:
    """Return the point nearest to another, shape (3,)."""
    return np.asarray(points[np.argmin(np.linalg.norm(points - to, axis=1))])


def _median_edge(mesh: TriangleMesh) -> float:
    ends = mesh.vertices[edges(mesh)]
    return float(np.median(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)))


def _on_line(limb: Limb, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return points of a limb's line at lengths from its end [m], and the unit direction inward there, (N, 3) each."""
    inward = np.gradient(limb.axis, limb.along, axis=0)
    inward /= np.maximum(np.linalg.norm(inward, axis=1, keepdims=True), 1e-12)
    on = np.clip(at, 0.0, limb.along[-1])
    point, way = (np.stack([np.interp(on, limb.along, x) for x in of.T], axis=1) for of in (limb.axis, inward))
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
    return point + (at - on)[:, None] * way, way


def _direction(middle: FloatArray) -> FloatArray:
    """Return the unit direction of a line of points at each, shape (N, 3)."""
    way = np.gradient(middle, axis=0)
    return np.asarray(way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12))


def _normal(loop: FloatArray) -> FloatArray:
    """Return the unit normal of the area within a loop of points, shape (3,)."""
    around = loop - loop.mean(axis=0)
    area = np.cross(around, np.roll(around, -1, axis=0)).sum(axis=0)
    return np.asarray(area / max(np.linalg.norm(area), 1e-12))


def _between(one: FloatArray, other: FloatArray, share: float) -> FloatArray:
    """Return the least rotations from unit vectors to others, or a share of them, shape (N, 3, 3)."""
    axis, cosine = np.cross(one, other), (one * other).sum(axis=1)
    sine = np.linalg.norm(axis, axis=1)
    angle = share * np.arctan2(sine, cosine)
    return Rotation.from_rotvec(axis * (angle / np.maximum(sine, 1e-12))[:, None]).as_matrix()
