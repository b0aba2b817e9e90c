"""What DXF has no place for, in texts of a block: names of edges, and which notches are cut as a v."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace

from vto_pipeline.io.patterns.dxf import layers
from vto_pipeline.model.pattern import Panel

_TEXT = re.compile(r"(EDGE|NOTCH) (\d+): (.*)", re.DOTALL)
_OWN_LAYER = {kind for layer, kind in layers.NOTCH_KINDS.items() if layer != layers.NOTCHES}


def texts_of(panel: Panel) -> Iterator[str]:
    """Yield texts as in EDGE 3: side seam, or NOTCH 1: v; numbers count from 0, notches those on the common layer."""
    yield from (f"EDGE {k}: {edge.label}" for k, edge in enumerate(panel.edges) if edge.label)
    common = [notch for notch in panel.notches if notch.kind not in _OWN_LAYER]
    yield from (f"NOTCH {k}: v" for k, notch in enumerate(common) if notch.kind == "v")


def is_said(text: str) -> bool:
    """Return whether a text is one of these."""
    return _TEXT.fullmatch(text) is not None


def with_texts(panel: Panel, texts: Iterable[str]) -> Panel:
    """Return a panel as the texts among these have it; numbers of what is not there are passed over."""
    edges, notches = list(panel.edges), list(panel.notches)
    for what, number, value in (match.groups() for match in map(_TEXT.fullmatch, texts) if match):
        k = int(number)
        if what == "EDGE" and k < len(edges):
            edges[k] = replace(edges[k], label=value)
        elif what == "NOTCH" and k < len(notches) and notches[k].kind == "slit":
            notches[k] = replace(notches[k], kind=value)
    return replace(panel, edges=tuple(edges), notches=tuple(notches))
