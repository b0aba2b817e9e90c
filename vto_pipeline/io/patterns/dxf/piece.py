"""A block of an AAMA file as a panel."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.patterns.dxf import layers
from vto_pipeline.io.patterns.dxf.borders import split_at_borders
from vto_pipeline.io.patterns.dxf.entities import Piece
from vto_pipeline.io.patterns.dxf.placement_text import placement_of
from vto_pipeline.io.patterns.dxf.remarks import is_said, with_texts
from vto_pipeline.io.patterns.dxf.texts import key_and_value
from vto_pipeline.io.patterns.fold import Fold, fold_of
from vto_pipeline.io.patterns.loops import JOIN_M, Chain, Joined, anticlockwise, edges_area, join
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.pattern import Edge, InnerLine, Notch, Panel

_READ = {layers.BOUNDARY, layers.TURN_POINTS, layers.CURVE_POINTS, layers.MIRROR, layers.GRAIN, layers.DRILLS,
         layers.SEW, layers.ANNOTATION, *layers.NOTCH_KINDS, *layers.LINE_KINDS}  # fmt: skip
_SEAM_SHARE = 0.3  # of what the boundary encloses, in a seam line all round; of a narrow strip an allowance takes half
_NAMES = ("PIECE NAME", "SIZE")
_DROPPED = {layers.GRADE_REFERENCE: "grade reference", **dict.fromkeys(layers.VALIDATION, "curves to validate with")}


def panel_of(piece: Piece, block: str, scale: float, notes: list[str]) -> Panel:
    """Return a block as a panel.

    Args:
        piece: What the block holds.
        block: Its name.
        scale: Metres per unit of the file.
        notes: Receives what was not taken, or taken in a way the file does not say.

    Raises:
        FormatError: the outline is open, branches, or there are several; the block and the entity are named.
    """
    words = reversed([key_and_value(text) for _, text in piece.texts])
    values = {key: value for key, value in words if key in _NAMES}  # the first of each
    chains = {layer: [_scaled(chain, scale) for chain in found] for layer, found in piece.chains.items()}
    turns = _places(piece, layers.TURN_POINTS, scale)
    outline, holes = _outline(join(chains.get(layers.BOUNDARY, [])), block, notes)
    sewn = join(chains.get(layers.SEW, []))
    cut: tuple[Edge, ...] = ()
    inner = [*sewn.loops, *sewn.open, *sewn.branching]
    seam = _largest(sewn.loops) if sewn.loops else ()
    if seam and abs(edges_area(seam)) > _SEAM_SHARE * abs(edges_area(outline)):
        cut, outline = outline, seam
        inner = [line for line in inner if line.edges is not seam]
    lines = [InnerLine("cutout", hole.edges) for hole in holes]
    lines += [InnerLine("sew", line.edges) for line in inner]
    for layer, kind in layers.LINE_KINDS.items():
        lines += [InnerLine(kind, chain.edges) for chain in chains.get(layer, [])]
    drills = _places(piece, layers.DRILLS, scale)
    notches = _notches(piece, chains, scale)
    edges = split_at_borders(anticlockwise(outline), turns)
    cut = split_at_borders(anticlockwise(cut), turns) if cut else ()
    mirror = fold_of(chains.get(layers.MIRROR, []))
    if mirror is not None and len(turns):
        edges = split_at_borders(edges, np.concatenate([turns, mirror]))
    _note_the_rest(piece, block, notes)
    panel = Panel(
        values.get("PIECE NAME") or block,
        edges,
        values.get("SIZE", ""),
        fold_of(chains.get(layers.GRAIN, [])),
        notches,
        tuple(lines),
        drills if len(drills) else None,
        cut,
        placement=next(filter(None, (placement_of(text) for _, text in piece.texts)), None),
        notes=_remarks(piece),
    )
    panel = with_texts(panel, (text for _, text in piece.texts))
    if mirror is None:
        return panel
    if Fold(mirror).cuts_off(edges):
        notes.append(f"block {block}: drawn as a half, opened at its mirror line")
        return Fold(mirror).opened_panel(panel)
    return replace(panel, lines=(*panel.lines, InnerLine("mirror", chains[layers.MIRROR][0].edges)))


def _remarks(piece: Piece) -> tuple[str, ...]:
    """Return what else the file says of a piece."""
    texts = [text for layer, text in piece.texts if layer in (layers.BOUNDARY, layers.ANNOTATION)]
    told = (*_NAMES, "UNITS")
    own = (t for t in texts if key_and_value(t)[0] not in told and placement_of(t) is None and not is_said(t))
    return tuple(dict.fromkeys(own))


def _outline(joined: Joined, block: str, notes: list[str]) -> tuple[tuple[Edge, ...], list[Chain]]:
    """Return the outline of a block, and loops inside of it."""
    where = f"block {block}"
    for name in joined.doubled:
        notes.append(f"{where}: {name} repeats another line of the outline and is left out")
    if joined.branching:
        x, y = 1e3 * joined.branching[0].start
        named = ", ".join(chain.name for chain in joined.branching[:3])
        raise FormatError(f"the outline branches near ({x:.1f}, {y:.1f}) mm: {named}", where=where)
    if not joined.loops:
        if not joined.open:
            raise FormatError("layer 1 holds no lines", where=where)
        longest = max(joined.open, key=lambda chain: len(chain.edges))
        gap = 1e3 * float(np.linalg.norm(longest.start - longest.end))
        x, y = 1e3 * longest.end
        raise FormatError(
            f"the outline is open: begun with {longest.name}, it ends at ({x:.1f}, {y:.1f}) mm, "
            f"{gap:.2f} mm from its start",
            where=where,
            hint=f"ends within {1e3 * JOIN_M:g} mm are joined",
        )
    for chain in joined.open:
        notes.append(f"{where}: {chain.name} on layer 1 is an open line and not taken")
    outer = _largest(joined.loops)
    holes = [loop for loop in joined.loops if loop.edges is not outer]
    low, high = (f(np.concatenate([e.points for e in outer]), axis=0) for f in (np.min, np.max))
    for hole in holes:
        points = np.concatenate([edge.points for edge in hole.edges])
        if (points < low).any() or (points > high).any():
            raise FormatError(f"two outlines on layer 1; {hole.name} begins the second", where=where)
        notes.append(f"{where}: {hole.name} on layer 1 lies inside the outline and is taken for a cut-out")
    return outer, holes


def _largest(loops: Sequence[Chain]) -> tuple[Edge, ...]:
    return max((loop.edges for loop in loops), key=lambda edges: abs(edges_area(edges)))


def _scaled(chain: Chain, scale: float) -> Chain:
    return Chain(chain.name, tuple(replace(edge, points=scale * edge.points) for edge in chain.edges))


def _places(piece: Piece, layer: int, scale: float) -> FloatArray:
    return scale * np.array([place for place, _, _ in piece.points.get(layer, ())], dtype=np.float64).reshape(-1, 2)


def _notches(piece: Piece, chains: dict[int, list[Chain]], scale: float) -> tuple[Notch, ...]:
    """Return notches given as points, with their angle and depth, or as lines from the outline inwards."""
    found = []
    for layer, kind in layers.NOTCH_KINDS.items():
        for place, angle, depth in piece.points.get(layer, ()):
            found.append(Notch(scale * place, None if angle is None else _radians(angle), scale * depth, kind))
        for chain in chains.get(layer, ()):
            x, y = chain.end - chain.start
            found.append(Notch(chain.start, float(np.arctan2(y, x)), float(np.hypot(x, y)), kind))
    return tuple(found)


def _radians(degrees: float) -> float:
    """Return an angle within half a turn of zero."""
    return math.radians(math.remainder(degrees, 360.0))


def _note_the_rest(piece: Piece, block: str, notes: list[str]) -> None:
    """Note what of a block was not taken."""
    for layer in sorted({*piece.chains, *piece.points} - _READ):
        count = len(piece.chains.get(layer, ())) + len(piece.points.get(layer, ()))
        what = _DROPPED.get(layer, "of no meaning in the standard")
        notes.append(f"block {block}: layer {layer if layer >= 0 else 'without a number'}: {count} not taken, {what}")
    for name in piece.skipped:
        notes.append(f"block {block}: {name} is no line, point or text, and not taken")
    if len(piece.chains.get(layers.GRAIN, ())) > 1:
        notes.append(f"block {block}: {len(piece.chains[layers.GRAIN])} grain lines, the first is taken")
