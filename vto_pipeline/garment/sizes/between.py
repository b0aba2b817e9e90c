"""A size between two others of the same make: each point in proportion between where the two have it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vto_pipeline.errors import InputError
from vto_pipeline.io.patterns.loops import edges_length
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.pattern import Edge, InnerLine, Notch, Panel, Pattern, Placement
from vto_pipeline.numerics.plane_curves import at_shares

_SAME_SHARE = 1e-6  # of the length of an edge: points of both nearer than this are one


def mesh_between(small: TriangleMesh, large: TriangleMesh, share: float) -> TriangleMesh:
    """Return the mesh between two whose triangles are the same.

    Args:
        small, large: The two sizes [m].
        share: 0 for the small one, 1 for the large one.

    Raises:
        InputError: their triangles differ.
    """
    if small.faces.shape != large.faces.shape or (small.faces != large.faces).any():
        problem = f"the triangles of the meshes differ: {len(small.faces)} and {len(large.faces)} of them"
        raise InputError(problem, hint="a size between two is made of meshes with the same triangles, or of patterns")
    texture = small.texture
    if texture is not None and large.texture is not None:
        texture = _mix(texture, large.texture, share)
    return replace(small, vertices=_mix(small.vertices, large.vertices, share), texture=texture, skin=None)


def pattern_between(small: Pattern, large: Pattern, share: float) -> Pattern:
    """Return the pattern between two of the same panels, edges and seams.

    Args:
        small, large: The two, each of one size.
        share: 0 for the small one, 1 for the large one.

    Returns:
        The pattern, without the name of a size.

    Raises:
        InputError: panels, edges, seams or what is marked on a panel differ; the first one is named.
    """
    names = [{panel.name for panel in one.panels} for one in (small, large)]
    if names[0] != names[1]:
        raise InputError(f"panels that only one of the patterns has: {', '.join(sorted(names[0] ^ names[1]))}")
    if small.stitches != large.stitches:
        raise InputError("the seams of the two patterns differ")
    others = {panel.name: panel for panel in large.panels}
    return replace(small, panels=tuple(_panel(panel, others[panel.name], share) for panel in small.panels))


def _panel(a: Panel, b: Panel, share: float) -> Panel:
    _check(a, len(a.edges), len(b.edges), "edges")
    _check(a, len(a.notches), len(b.notches), "notches")
    _check(a, [len(one.curves) for one in a.lines], [len(one.curves) for one in b.lines], "lines inside")
    _check(a, len(a.cut), len(b.cut), "edges of the cut line")
    _check(a, _count(a.drills), _count(b.drills), "drill holes")
    lines = (
        InnerLine(one.kind, _edges(a.name, one.curves, two.curves, share))
        for one, two in zip(a.lines, b.lines, strict=True)
    )
    placed = (
        a.placement
        and b.placement
        and Placement(a.placement.rotation, _mix(a.placement.translation, b.placement.translation, share))
    )
    return replace(
        a,
        size="",
        edges=_edges(a.name, a.edges, b.edges, share),
        grain=None if a.grain is None or b.grain is None else _mix(a.grain, b.grain, share),
        notches=tuple(_notch(one, two, share) for one, two in zip(a.notches, b.notches, strict=True)),
        lines=tuple(lines),
        drills=None if a.drills is None or b.drills is None else _mix(a.drills, b.drills, share),
        cut=_edges(a.name, a.cut, b.cut, share),
        placement=placed,
    )


def _check(panel: Panel, one: object, two: object, what: str) -> None:
    if one != two:
        raise InputError(f"panel {panel.name!r}: {one} and {two} {what} in the two patterns")


def _count(points: FloatArray | None) -> int:
    return 0 if points is None else len(points)


def _edges(name: str, one: tuple[Edge, ...], two: tuple[Edge, ...], share: float) -> tuple[Edge, ...]:
    return tuple(_edge(name, k, a, b, share) for k, (a, b) in enumerate(zip(one, two, strict=True)))


def _edge(name: str, number: int, a: Edge, b: Edge, share: float) -> Edge:
    if a.kind != b.kind or (a.kind == "bezier" and len(a.points) != len(b.points)):
        raise InputError(f"panel {name!r}: edge {number} is {a.shape} in one pattern and {b.shape} in the other")
    if a.kind == "arc":
        angle = (1.0 - share) * np.arctan(a.bulge) + share * np.arctan(b.bulge)
        return replace(a, points=_mix(a.points, b.points, share), bulge=float(np.tan(angle)))
    if len(a.points) == len(b.points):
        return replace(a, points=_mix(a.points, b.points, share))
    shares = np.sort(np.concatenate([_corner_shares(a), _corner_shares(b)]))
    shares = shares[np.append(True, np.diff(shares) > _SAME_SHARE)]
    shares[-1] = 1.0
    places = [at_shares("polyline", edge.points, 0.0, shares) for edge in (a, b)]
    return replace(a, points=_mix(places[0], places[1], share))


def _corner_shares(edge: Edge) -> FloatArray:
    ways = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(edge.points, axis=0), axis=1))])
    return np.asarray(ways / edges_length([edge]))


def _notch(a: Notch, b: Notch, share: float) -> Notch:
    angle = a.angle
    if angle is not None and b.angle is not None:
        turn = (b.angle - angle + np.pi) % (2.0 * np.pi) - np.pi  # the short way round
        angle += share * float(turn)
    return replace(a, position=_mix(a.position, b.position, share), angle=angle)


def _mix(a: FloatArray, b: FloatArray, share: float) -> FloatArray:
    return np.asarray((1.0 - share) * a + share * b)
