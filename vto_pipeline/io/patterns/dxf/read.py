"""Patterns from DXF files after AAMA-292 and ASTM D6673: a block for each piece and size."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.patterns.dxf.entities import Piece, piece_of
from vto_pipeline.io.patterns.dxf.layers import BOUNDARY, layer_of
from vto_pipeline.io.patterns.dxf.piece import panel_of
from vto_pipeline.io.patterns.dxf.placement_text import WORN
from vto_pipeline.io.patterns.dxf.stitch_texts import stitches_of
from vto_pipeline.io.patterns.dxf.texts import find_unit, key_and_value
from vto_pipeline.io.patterns.record import answer
from vto_pipeline.model.pattern import Panel, Pattern
from vto_pipeline.units import LENGTH_M


def parse_dxf(path: str, unit: str) -> Arrays:
    """Return the pattern of a DXF file as our JSON in text. Runs in the sandbox.

    Args:
        path: The file.
        unit: In place of the file's, or empty.

    Raises:
        InputError: the unit is unknown; FormatError: not DXF, or no panel can be made of a block, which is named.
    """
    notes: list[str] = []
    try:
        return answer(_pattern(Path(path), unit, notes), notes)
    except InputError as e:
        where = f"{Path(path).name}, {e.where}" if e.where else Path(path).name
        raise type(e)(e.problem, where=where, hint=e.hint) from None


def _pattern(path: Path, unit: str, notes: list[str]) -> Pattern:
    document = _document(path, notes)
    names = [block.name for block in document.blocks if not block.name.startswith(("*", "$"))]
    inserts = [(name, insert.dxf.name) for name in names for insert in document.blocks.get(name).query("INSERT")]
    within = {inner for name, inner in inserts if inner != name}
    pieces: dict[str, Piece] = {}
    texts = [text for _, text in piece_of_modelspace(document).texts]
    for name in names:
        if name not in within:
            piece = piece_of(document.blocks.get(name))
            texts += [text for _, text in piece.texts]
            if BOUNDARY in piece.chains:
                pieces[name] = piece
            else:
                notes.append(f"block {name}: no lines on layer 1, so no panel")
    if not pieces:
        outside = sum(layer_of(entity.dxf.layer) == BOUNDARY for entity in document.modelspace())
        problem = f"no block has an outline on layer 1; {outside} entities lie there outside of blocks"
        raise FormatError(problem, hint="expected a file after AAMA or ASTM D6673, with a block for each piece")
    sides = [_longest_side(piece) for piece in pieces.values()]
    unit, source = find_unit(texts, document.header, sides, unit)
    panels = [panel_of(piece, name, LENGTH_M[unit], notes) for name, piece in pieces.items()]
    panels = _with_unique_names(panels, list(pieces), notes)
    styles = [value for key, value in map(key_and_value, texts) if key == "STYLE NAME"]
    name = styles[0] if styles and styles[0] else path.stem
    worn = key_and_value(WORN) in map(key_and_value, texts)
    return Pattern(name, tuple(panels), stitches_of(texts), f"{unit}, {source}", worn)


def piece_of_modelspace(document: Any) -> Piece:
    """Return what lies outside of blocks, inserts left aside."""
    space = document.modelspace()
    texts = [(layer_of(e.dxf.layer), e.dxf.text) for e in space.query("TEXT")]
    return Piece(texts=texts + [(layer_of(e.dxf.layer), e.plain_text()) for e in space.query("MTEXT")])


def _document(path: Path, notes: list[str]) -> Any:
    import ezdxf
    from ezdxf import recover

    try:
        document, auditor = recover.readfile(str(path))
    except (ezdxf.DXFError, ValueError, KeyError, IndexError, AttributeError, TypeError) as e:
        raise FormatError(f"not a DXF file that can be read: {type(e).__name__}: {e}"[:200]) from None
    for fault in auditor.errors[:5]:
        notes.append(f"damaged: {fault.message}")
    return document


def _longest_side(piece: Piece) -> float:
    points = np.concatenate([edge.points for chain in piece.chains[BOUNDARY] for edge in chain.edges])
    return float(np.ptp(points, axis=0).max())


def _with_unique_names(panels: list[Panel], blocks: list[str], notes: list[str]) -> list[Panel]:
    """Return panels whose names are unique in each size: blocks have unique names."""
    keys = [(panel.name, panel.size) for panel in panels]
    unique = []
    for panel, key, block in zip(panels, keys, blocks, strict=True):
        if keys.count(key) > 1:
            notes.append(
                f"block {block}: another has its piece name {key[0]!r} and size {key[1]!r}; named after the block"
            )
            panel = replace(panel, name=block)
        unique.append(panel)
    return unique
