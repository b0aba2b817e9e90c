"""Sewing patterns: flat panels, and which edges are sewn to which."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import FloatArray, freeze

CurveKind = Literal["polyline", "bezier", "arc"]

_CLOSED_M = 1e-7  # between the end of an edge and the start of the next: readers join at less than a tenth of this
_POINTS: dict[str, tuple[int, float]] = {"polyline": (2, np.inf), "bezier": (3, 4), "arc": (2, 2)}
_REACH_M = 1e4  # farther out nothing is drawn; a curve of that size would be cut into pieces without end


@dataclass(frozen=True)
class Edge:
    """A curve in the plane of a panel.

    Args:
        kind: "polyline", a straight edge or a chain of straight ones; "bezier", quadratic or cubic; "arc" of a circle.
        points: Of a polyline; control points; start and end of an arc [m], shape (K, 2).
        bulge: Of an arc: the tangent of a quarter of its angle, positive anticlockwise, as DXF has it.
        label: What the file calls the edge.
    """

    kind: CurveKind
    points: FloatArray
    bulge: float = 0.0
    label: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", freeze("points of an edge", self.points, (None, 2), "f8"))
        if self.kind not in _POINTS:
            raise InputError(f"an edge of kind {self.kind!r}; expected one of {', '.join(_POINTS)}")
        low, high = _POINTS[self.kind]
        if not low <= len(self.points) <= high:
            raise InputError(f"an edge of kind {self.kind} with {len(self.points)} points; expected {low} to {high}")
        if np.abs(self.points).max() > _REACH_M:
            raise InputError(f"an edge at {np.abs(self.points).max():.3g} m; the limit is {_REACH_M:g} m")
        if not np.ptp(self.points, axis=0).any():
            x, y = self.points[0]
            raise InputError(f"an edge without length at ({x:.4f}, {y:.4f}) m")
        if self.kind == "arc" and (not np.isfinite(self.bulge) or self.bulge == 0.0 or not self._is_open()):
            raise InputError(f"an arc from start to end with bulge {self.bulge}; expected two places, and no zero")

    @property
    def shape(self) -> str:
        """What a person calls it: straight, polyline, quadratic, cubic or arc."""
        names = {("polyline", 2): "straight", ("bezier", 3): "quadratic", ("bezier", 4): "cubic"}
        return names.get((self.kind, len(self.points)), self.kind)

    def _is_open(self) -> bool:
        return bool((self.points[0] != self.points[-1]).any())


@dataclass(frozen=True)
class Notch:
    """A mark at the outline at which seams are matched.

    Args:
        position: [m], shape (2,).
        angle: Of its direction from the x axis [rad]; None: unknown.
        depth: [m]; 0: unknown.
        kind: "slit", "v", "t", "castle", "check" or "u".
    """

    position: FloatArray
    angle: float | None = None
    depth: float = 0.0
    kind: str = "slit"

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", freeze("notch", self.position, (2,), "f8"))


@dataclass(frozen=True)
class InnerLine:
    """A line inside a panel: fold, pocket, quilting, cut-out.

    Args:
        kind: "internal", "cutout", "stripe", "plaid" or "sew".
        curves: End to end.
    """

    kind: str
    curves: tuple[Edge, ...]


@dataclass(frozen=True)
class Placement:
    """Where a panel stands in space before it is sewn: space = rotation @ (x, y, 0) + translation.

    Args:
        rotation: Shape (3, 3).
        translation: [m], shape (3,).
        worn_at: Points of the panel, x and y, and where each was in space as the garment was worn [m], shape (W, 5);
            None: unknown, or the panel is flat there.
    """

    rotation: FloatArray
    translation: FloatArray
    worn_at: FloatArray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "rotation", freeze("rotation of a panel", self.rotation, (3, 3), "f8"))
        object.__setattr__(self, "translation", freeze("translation of a panel", self.translation, (3,), "f8"))
        if not np.allclose(self.rotation @ self.rotation.T, np.eye(3), rtol=0, atol=1e-6):
            raise InputError("rotation of a panel: the rows are not orthogonal unit vectors")
        if self.worn_at is not None:
            object.__setattr__(self, "worn_at", freeze("worn places of a panel", self.worn_at, (None, 5), "f8"))
            if len(self.worn_at) == 0:
                raise InputError("worn places of a panel: there are none")


@dataclass(frozen=True)
class Panel:
    """A flat piece of cloth.

    Args:
        name: Unique among the panels of its size.
        edges: The outline, along which it is sewn, end to end, closed and anticlockwise: the right side of the cloth
            faces the viewer.
        size: The garment size it is cut for; empty: the pattern has one only.
        grain: Start and end of the grain line, the warp [m], shape (2, 2); None: unknown, and y is taken.
        notches: At the outline.
        lines: Inside.
        drills: Drill holes [m], shape (D, 2).
        cut: Where the cloth is cut, outside `edges` by the seam allowance; empty: unknown.
        placement: In space; None: unknown.
        notes: What the file says of it in words.
    """

    name: str
    edges: tuple[Edge, ...]
    size: str = ""
    grain: FloatArray | None = None
    notches: tuple[Notch, ...] = ()
    lines: tuple[InnerLine, ...] = ()
    drills: FloatArray | None = None
    cut: tuple[Edge, ...] = ()
    placement: Placement | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.grain is not None:
            object.__setattr__(self, "grain", freeze(f"grain of panel {self.name}", self.grain, (2, 2), "f8"))
        if self.drills is not None:
            object.__setattr__(self, "drills", freeze(f"drill holes of {self.name}", self.drills, (None, 2), "f8"))
        _check_loop(self.edges, f"outline of panel {self.name!r}")
        if self.cut:
            _check_loop(self.cut, f"cut line of panel {self.name!r}")


def _check_loop(edges: Sequence[Edge], what: str) -> None:
    if not edges:
        raise InputError(f"{what}: no edges")
    for number, edge in enumerate(edges):
        gap = float(np.abs(edges[(number + 1) % len(edges)].points[0] - edge.points[-1]).max())
        if gap > _CLOSED_M:
            raise InputError(f"{what}: edge {number} ends {1e3 * gap:.4g} mm from the start of the next")


@dataclass(frozen=True)
class Side:
    """One edge in a seam.

    Args:
        panel: Name of the panel.
        edge: Number of the edge in its outline.
        forward: Whether the seam runs along the edge from its start to its end.
    """

    panel: str
    edge: int
    forward: bool = True


@dataclass(frozen=True)
class Stitch:
    """Two chains of edges sewn together, start to start and end to end, in proportion to their lengths.

    Args:
        first, second: The chains.
    """

    first: tuple[Side, ...]
    second: tuple[Side, ...]


@dataclass(frozen=True)
class Pattern:
    """A sewing pattern.

    Args:
        name: Of the garment.
        panels: In all sizes.
        stitches: Hold for each size.
        unit: The unit of length in the file, and how that is known.
        worn: Whether its panels stand where they were worn, in the room of that body; else where they are laid out.
    """

    name: str
    panels: tuple[Panel, ...]
    stitches: tuple[Stitch, ...] = ()
    unit: str = "m"
    worn: bool = False

    def __post_init__(self) -> None:
        if not self.panels:
            raise InputError("a pattern without panels")
        keys = [(panel.name, panel.size) for panel in self.panels]
        twice = sorted({key for key in keys if keys.count(key) > 1})
        if twice:
            raise InputError(f"panel {twice[0][0]!r} is there twice" + f" in size {twice[0][1]}" * bool(twice[0][1]))
        fewest: dict[str, int] = {}
        for panel in self.panels:
            fewest[panel.name] = min(len(panel.edges), fewest.get(panel.name, len(panel.edges)))
        for number, stitch in enumerate(self.stitches):
            for side in (*stitch.first, *stitch.second):
                if side.panel not in fewest:
                    raise InputError(f"stitch {number}: no panel {side.panel!r}; there are {', '.join(fewest)}")
                if not 0 <= side.edge < fewest[side.panel]:
                    raise InputError(
                        f"stitch {number}: panel {side.panel!r} has {fewest[side.panel]} edges, none is {side.edge}"
                    )
            if not stitch.first or not stitch.second:
                raise InputError(f"stitch {number}: a side without edges")

    @property
    def sizes(self) -> tuple[str, ...]:
        """The sizes there are, in the order of the file."""
        return tuple(dict.fromkeys(panel.size for panel in self.panels))

    def of_size(self, size: str) -> Pattern:
        """Return the panels of one size, with all stitches whose panels are among them.

        Raises:
            InputError: no such size.
        """
        if size not in self.sizes:
            raise InputError(f"no size {size!r}; there are {', '.join(repr(one) for one in self.sizes)}")
        panels = tuple(panel for panel in self.panels if panel.size == size)
        names = {panel.name for panel in panels}
        held = tuple(s for s in self.stitches if all(side.panel in names for side in (*s.first, *s.second)))
        return Pattern(self.name, panels, held, self.unit, self.worn)
