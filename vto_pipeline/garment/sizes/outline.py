"""What each edge of a panel is, by what it is sewn to and by where it lies: shoulder, armhole, side, hem and so on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.sizes.rules import Part, SizeRules
from vto_pipeline.io.patterns.loops import edges_points
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.pattern import Panel, Pattern

Partner = tuple[Part, str]
"""Part and name of the panel that an edge is sewn to."""

_FLAT_M = 1e-4
_EXTREME = 0.02  # of a panel's width: as near to its border as this is at the border


@dataclass(frozen=True)
class Outline:
    """A panel with the names of its edges.

    Args:
        panel: The panel.
        part: Which part of the garment it is.
        frame: Rows are the directions across and up in the panel's plane, shape (2, 2). Up is towards the head, in a
            sleeve towards the shoulder.
        roles: Name of each edge: "shoulder", "armhole", "side", "neck", "front", "waist", "hem", "cap", "cuff", "seam",
            "crotch", "inseam", "outseam", "end", "dart"; empty where none fits.
        corners: Start of each edge in the frame [m], shape (E, 2).
    """

    panel: Panel
    part: Part
    frame: FloatArray
    roles: tuple[str, ...]
    corners: FloatArray

    def points(self) -> FloatArray:
        """Return the outline as a closed polyline in the frame [m], shape (N, 2), its end left out."""
        return np.asarray(edges_points(self.panel.edges, _FLAT_M)[:-1] @ self.frame.T)

    def edges_of(self, role: str) -> list[int]:
        """Return the numbers of the edges of one name."""
        return [k for k, one in enumerate(self.roles) if one == role]

    def corners_between(self, first: str, second: str) -> list[int]:
        """Return the corners where edges of two names meet, in either order."""
        pairs = ((self.roles[k - 1], one) for k, one in enumerate(self.roles))
        return [k for k, pair in enumerate(pairs) if pair in ((first, second), (second, first))]


def outlines(pattern: Pattern, rules: SizeRules) -> dict[str, Outline]:
    """Name the edges of all panels.

    Args:
        pattern: Of one size, with stitches.
        rules: Of its type.

    Raises:
        GarmentError: a panel is no part of such a garment, or the pattern has no stitches.
    """
    if not pattern.stitches:
        problem = f"pattern {pattern.name!r} says nothing of its seams, so its edges cannot be named"
        raise GarmentError(problem, hint="give it stitches, as JSON of GarmentCode and panels.json have them")
    parts = {panel.name: rules.part_of(panel.name) for panel in pattern.panels}
    partners: dict[tuple[str, int], Partner] = {}
    for stitch in pattern.stitches:
        for own, other in ((stitch.first, stitch.second), (stitch.second, stitch.first)):
            for side in own:
                partners[side.panel, side.edge] = (parts[other[0].panel], other[0].panel)
    return {
        panel.name: _outline(panel, parts[panel.name], [partners.get((panel.name, k)) for k in range(len(panel.edges))])
        for panel in pattern.panels
    }


def _outline(panel: Panel, part: Part, partners: Sequence[Partner | None]) -> Outline:
    up = _sleeve_up(panel, partners) if part == "sleeve" else _up(panel)
    frame = np.stack([[up[1], -up[0]], up])
    corners = np.stack([edge.points[0] for edge in panel.edges]) @ frame.T
    roles = _NAMERS[part](panel.name, corners, partners)
    return Outline(panel, part, frame, tuple(roles), corners)


def _axes(panel: Panel) -> FloatArray:
    """Return the directions along and across the grain, either way, shape (4, 2)."""
    along = np.array([0.0, 1.0]) if panel.grain is None else panel.grain[1] - panel.grain[0]
    along = along / np.linalg.norm(along)
    across = np.array([along[1], -along[0]])
    return np.stack([along, -along, across, -across])


def _up(panel: Panel) -> FloatArray:
    """Return which direction of the grain, or across it, points up where the panel stands in space."""
    axes = _axes(panel)
    if panel.placement is None:
        return axes[0]
    return np.asarray(axes[int(np.argmax(axes @ panel.placement.rotation[1, :2]))])


def _sleeve_up(panel: Panel, partners: Sequence[Partner | None]) -> FloatArray:
    middles = np.stack([edge.points[[0, -1]].mean(axis=0) for edge in panel.edges])
    cap = [k for k, partner in enumerate(partners) if partner is not None and partner[0] == "torso"]
    if not cap:
        raise GarmentError(f"sleeve {panel.name!r} is sewn to no front or back")
    axes = _axes(panel)
    return np.asarray(axes[int(np.argmax(axes @ (middles[cap].mean(axis=0) - middles.mean(axis=0))))])


def _steep(corners: FloatArray, k: int) -> bool:
    across, along = np.abs(corners[(k + 1) % len(corners)] - corners[k])
    return bool(along > across)


def _middle(corners: FloatArray, k: int) -> FloatArray:
    return np.asarray(0.5 * (corners[k] + corners[(k + 1) % len(corners)]))


def _torso(name: str, corners: FloatArray, partners: Sequence[Partner | None]) -> list[str]:
    low, high = corners.min(axis=0), corners.max(axis=0)
    half = 0.5 * (low + high)[1]
    roles = []
    for k, partner in enumerate(partners):
        upper, steep = _middle(corners, k)[1] > half, _steep(corners, k)
        if partner is None:
            ends = corners[[k, (k + 1) % len(corners)], 0]
            rim = (high - low)[0] * _EXTREME
            at_rim = bool((ends < low[0] + rim).all() or (ends > high[0] - rim).all())
            roles.append("front?" if steep and at_rim else "hem" if not (steep or upper) else "free")
        elif partner[1] == name:
            roles.append("dart")
        elif partner[0] == "torso":
            roles.append("side" if steep else "shoulder" if upper else "waist")
        else:
            roles.append({"sleeve": "armhole", "hood": "neck"}.get(partner[0], "waist"))
    count = len(roles)
    around = [{roles[k - 1], roles[(k + 1) % count]} for k in range(count)]
    for k in range(count):
        if roles[k] == "front?":
            roles[k] = "free" if around[k] & {"shoulder", "side"} else "front"
    for run in _runs(roles, "free"):
        beside = {roles[run[0] - 1], roles[(run[-1] + 1) % count]}
        fits = "armhole" if beside == {"shoulder", "side"} else "neck" if "shoulder" in beside else ""
        for k in run:
            roles[k] = fits
    for run in _runs(roles, "side"):  # a seam down the middle touches no armhole
        if not {roles[run[0] - 1], roles[(run[-1] + 1) % count]} & {"armhole"}:
            for k in run:
                roles[k] = "middle"
    return roles


def _sleeve(name: str, corners: FloatArray, partners: Sequence[Partner | None]) -> list[str]:
    return ["cuff" if p is None else {"torso": "cap", "sleeve": "seam"}.get(p[0], "") for p in partners]


def _leg(name: str, corners: FloatArray, partners: Sequence[Partner | None]) -> list[str]:
    half = 0.5 * (corners[:, 1].min() + corners[:, 1].max())
    roles = []
    for k, partner in enumerate(partners):
        if partner is None:
            roles.append("waist" if _middle(corners, k)[1] > half else "hem")
        elif partner[0] == "leg":
            roles.append(f"to {partner[1]}")
        else:
            roles.append("waist")
    if len(_runs(roles, f"to {name}")) == 1:  # both sides of a dart are one run, those of an inseam are two
        roles = ["dart" if role == f"to {name}" else role for role in roles]
    runs = {role: _runs(roles, role) for role in set(roles) if role.startswith("to ")}
    once = [role for role, found in runs.items() if len(found) == 1]
    twice = [role for role, found in runs.items() if len(found) == 2]
    if len(once) != 1 or len(twice) != 1:
        problem = f"panel {name!r} is not sewn as a leg: to its own leg along two seams, to the other along one"
        raise GarmentError(problem, hint=f"it is sewn to {', '.join(sorted(role[3:] for role in runs)) or 'nothing'}")
    (crotch,) = runs[once[0]]
    for k in crotch:
        roles[k] = "crotch"
    for run in runs[twice[0]]:
        touches = {roles[run[0] - 1], roles[(run[-1] + 1) % len(roles)]}
        for k in run:
            roles[k] = "inseam" if "crotch" in touches else "outseam"
    return roles


def _skirt(name: str, corners: FloatArray, partners: Sequence[Partner | None]) -> list[str]:
    half = 0.5 * (corners[:, 1].min() + corners[:, 1].max())
    roles = []
    for k, partner in enumerate(partners):
        if partner is not None and partner[1] == name:
            roles.append("dart")
        elif partner is not None:
            roles.append("side" if partner[0] == "skirt" else "waist")
        elif _steep(corners, k):
            roles.append("")
        else:
            roles.append("waist" if _middle(corners, k)[1] > half else "hem")
    return roles


def _waistband(name: str, corners: FloatArray, partners: Sequence[Partner | None]) -> list[str]:
    half = 0.5 * (corners[:, 1].min() + corners[:, 1].max())
    levels = ("waist" if _middle(corners, k)[1] > half else "lower" for k in range(len(corners)))
    return ["end" if _steep(corners, k) else level for k, level in enumerate(levels)]


def _hood(name: str, corners: FloatArray, partners: Sequence[Partner | None]) -> list[str]:
    return ["neck" if partner is not None and partner[0] == "torso" else "" for partner in partners]


_NAMERS = {"torso": _torso, "sleeve": _sleeve, "leg": _leg, "skirt": _skirt, "waistband": _waistband, "hood": _hood}


def _runs(roles: Sequence[str], role: str) -> list[list[int]]:
    """Return the edges of one name that follow each other around the outline, a list for each such run."""
    count = len(roles)
    starts = [k for k in range(count) if roles[k] == role and roles[k - 1] != role]
    found = []
    for start in starts:
        length = next(n for n in range(1, count + 1) if roles[(start + n) % count] != role)
        found.append([(start + n) % count for n in range(length)])
    return found


def of_part(found: Mapping[str, Outline], part: Part) -> list[Outline]:
    """Return the panels of one part."""
    return [one for one in found.values() if one.part == part]
