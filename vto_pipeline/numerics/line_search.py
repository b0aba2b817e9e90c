"""Backtracking line searches: which shares of a step to try, and which of them goes far enough down."""

from __future__ import annotations

from collections.abc import Iterator

_ARMIJO = 1e-4  # share of the predicted fall that is enough
_ROUNDING = 1e-10  # relative difference of two values that may be none
_FLATTER = 0.9  # share of a slope that counts as less


def backtracking_shares(shortest: float) -> Iterator[float]:
    """Yield 1, ½, ¼ ... as long as they are above the shortest share of a step worth taking."""
    share = 1.0
    while share > shortest:
        yield share
        share *= 0.5


def satisfies_armijo(
    value: float,
    slope: float,
    share: float,
    new_value: float,
    new_slope: float,
    *,
    own_slope: float | None = None,
    by_slope: bool = False,
) -> bool:
    """Return whether a step goes far enough down (Nocedal & Wright 2006, section 3.1).

    Armijo's condition; or where the difference of two values is only rounding, that on slopes of Hager & Zhang 2005,
    eq. 4.1.

    Args:
        value, slope: Where the step begins, along the whole step.
        share: How much of it is taken.
        new_value, new_slope: Where it ends.
        own_slope: The slope without what has no derivative; the same by default.
        by_slope: Whether a slope that falls is enough, whatever the values.
    """
    if new_value <= value + _ARMIJO * share * slope:
        return True
    flatter = abs(new_slope) <= _FLATTER * abs(slope if own_slope is None else own_slope)
    return (by_slope or new_value <= value + _ROUNDING * abs(value)) and flatter
