"""What a notebook shows of a value. Pictures are drawn in rooms above this one; whoever has them puts a card in."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

CARDS: dict[type, Callable[[Any], str]] = {}
"""Class -> a function that returns HTML for a value of it. `vto_pipeline.api` fills it."""


class Presented:
    """A value that notebooks show as a card, once there is one for its class; until then they print it."""

    def _repr_html_(self) -> str | None:
        card = CARDS.get(type(self))
        return None if card is None else card(self)
