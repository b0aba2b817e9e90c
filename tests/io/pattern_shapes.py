"""Patterns for tests: made by formula or by hypothesis, and files of other programs built with ezdxf."""

from __future__ import annotations

from pathlib import Path

import ezdxf
import numpy as np
from hypothesis import strategies as st

from vto_pipeline.model.pattern import Edge, InnerLine, Notch, Panel, Pattern, Placement, Side, Stitch

TURNED = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])


def half_disc(radius: float, name: str = "half", x: float = 0.0) -> Panel:
    """A straight edge and an arc over it, so that area and lengths are known."""
    ends = np.array([[x - radius, 0.0], [x + radius, 0.0]])
    return Panel(name, (Edge("polyline", ends), Edge("arc", ends[::-1], 1.0)))


def rich_pattern() -> Pattern:
    """Every kind of edge, and of all that a panel can hold, with awkward names."""
    corners = np.array([[0.0, 0.0], [0.4, 0.01], [0.38, 0.6], [0.03, 0.55]])
    edges = (
        Edge("polyline", np.array([corners[0], [0.13, -0.02], [0.3, -0.015], corners[1]]), label="hem"),
        Edge("bezier", np.array([corners[1], [0.45, 0.3], corners[2]])),
        Edge("bezier", np.array([corners[2], [0.3, 0.5], [0.1, 0.7], corners[3]])),
        Edge("arc", np.array([corners[3], corners[0]]), -0.2),
    )
    grown = np.array([[-0.01, -0.04], [0.45, -0.04], [0.45, 0.7], [-0.01, 0.7]])
    cut = tuple(Edge("polyline", np.stack([grown[k], grown[(k + 1) % 4]])) for k in range(4))
    pocket = np.array([[0.1, 0.1], [0.2, 0.1], [0.2, 0.2], [0.1, 0.1]])
    rich = Panel(
        'front "A" & <b>',
        edges,
        "M",
        grain=np.array([[0.2, 0.1], [0.2, 0.5]]),
        notches=(Notch(corners[0], 0.5, 0.004, "slit"), Notch(np.array([0.3, -0.015]), None, 0.0, "t")),
        lines=(
            InnerLine("internal", (Edge("polyline", pocket),)),
            InnerLine("internal", (Edge("bezier", np.array([[0.1, 0.3], [0.2, 0.35], [0.3, 0.3]])),)),
            InnerLine("cutout", (Edge("polyline", pocket + np.array([0.1, 0.15])),)),
        ),
        drills=np.array([[0.25, 0.4], [0.15, 0.45]]),
        cut=cut,
        placement=Placement(TURNED, np.array([0.1, 1.2, -0.3])),
        notes=("QUANTITY: 2", "ANNOTATION: ½ of the front"),
    )
    back = half_disc(0.3, "back\\", x=1.0)
    sized = Panel(back.name, back.edges, "M")
    stitches = (
        Stitch((Side(rich.name, 0), Side(rich.name, 1)), (Side(sized.name, 1, False),)),
        Stitch((Side(rich.name, 2),), (Side(rich.name, 3, False),)),
    )
    return Pattern("shirt & <tie>", (rich, sized, Panel(back.name, half_disc(0.31, x=1.0).edges, "L")), stitches)


@st.composite
def panels(draw: st.DrawFn) -> Panel:
    """A star-shaped outline of mixed edges, which bulge by less than would make them meet."""
    count = draw(st.integers(3, 8))
    radii = draw(st.lists(st.floats(0.2, 0.6), min_size=count, max_size=count))
    kinds = draw(st.lists(st.sampled_from(["polyline", "quadratic", "cubic", "arc"]), min_size=count, max_size=count))
    bends = draw(st.lists(st.floats(0.02, 0.15), min_size=count, max_size=count))
    angle = 2.0 * np.pi * np.arange(count) / count
    corners = np.stack([np.cos(angle), np.sin(angle)], axis=1) * np.array(radii)[:, None]
    edges = []
    for k, (kind, bend) in enumerate(zip(kinds, bends, strict=True)):
        start, end = corners[k], corners[(k + 1) % count]
        out = bend * np.array([end[1] - start[1], start[0] - end[0]])
        third, two_thirds = (start + t * (end - start) + out for t in (1 / 3, 2 / 3))
        if kind == "arc":
            edges.append(Edge("arc", np.stack([start, end]), bend))
        elif kind == "polyline":
            edges.append(Edge("polyline", np.stack([start, end])))
        else:
            inner = [0.5 * (start + end) + out] if kind == "quadratic" else [third, two_thirds]
            edges.append(Edge("bezier", np.stack([start, *inner, end])))
    return Panel("star", tuple(edges))


class Foreign:
    """A DXF file of another program."""

    def __init__(self, *texts: str, version: str = "R12") -> None:
        self.document = ezdxf.new(version)
        self.space = self.document.modelspace()
        for text in texts:
            self.space.add_text(text, dxfattribs={"layer": "1"})

    def block(self, name: str, *texts: str):
        """Add an empty block with texts, inserted once."""
        block = self.document.blocks.new(name)
        for text in texts:
            block.add_text(text, dxfattribs={"layer": "1"})
        self.space.add_blockref(name, (0, 0), dxfattribs={"layer": "1"})
        return block

    def save(self, path: Path) -> Path:
        """Write the file."""
        self.document.saveas(path)
        return path


def outline(block, points, layer: int = 1, *, closed: bool = True) -> None:
    """Add a polyline to a block."""
    block.add_polyline2d(points, close=closed, dxfattribs={"layer": str(layer)})


def shoelace(points: np.ndarray) -> float:
    """Area of a polygon."""
    x, y = np.asarray(points, dtype=float).T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
