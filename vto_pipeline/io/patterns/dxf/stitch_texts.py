"""Stitches in words, as the standard has no place for them: one annotation each outside of the blocks."""

from __future__ import annotations

import re
from collections.abc import Iterable

from vto_pipeline.io.patterns.dxf.texts import key_and_value
from vto_pipeline.model.pattern import Side, Stitch

KEY = "SEAM"
_SIDE = re.compile(r'"((?:[^"\\]|\\.)*)" (\d+)( reversed)?')


def text_of(stitch: Stitch) -> str:
    """Return a stitch as in SEAM: "front" 3 + "side" 1 with "back" 5 reversed."""
    return f"{KEY}: " + " with ".join(" + ".join(map(_side_text, chain)) for chain in (stitch.first, stitch.second))


def stitches_of(texts: Iterable[str]) -> tuple[Stitch, ...]:
    """Return the stitches among texts."""
    found = []
    for key, value in map(key_and_value, texts):
        halves = _halves(value) if key == KEY else []
        if len(halves) == 2:
            found.append(Stitch(*halves))
    return tuple(found)


def _halves(value: str) -> list[tuple[Side, ...]]:
    """Return the chains on both sides of a seam."""
    chains: list[tuple[Side, ...]] = [()]
    at = 0
    while match := _SIDE.match(value, at):
        side = Side(re.sub(r"\\(.)", r"\1", match[1]), int(match[2]), not match[3])
        chains[-1] = (*chains[-1], side)
        at = match.end()
        if value.startswith(" with ", at):
            chains.append(())
            at += len(" with ")
        elif value.startswith(" + ", at):
            at += len(" + ")
    return chains if at == len(value) else []


def _side_text(side: Side) -> str:
    name = re.sub(r'(["\\])', r"\\\1", side.panel)
    return f'"{name}" {side.edge}' + ("" if side.forward else " reversed")
