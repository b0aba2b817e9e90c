"""Which size of a run to take: the one whose wearing ease lies where the table of allowances has it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from vto_pipeline.assess.allowance import Allowance
from vto_pipeline.errors import InputError

_TIGHT_COUNTS = 2.0  # as much as loose: cloth that is short cannot be taken in


@dataclass(frozen=True)
class ZoneFit:
    """One zone of one size.

    Args:
        ease: Girth of the garment less that of the body [m].
        low, high: Wanted ease [m]; None: no bound is known, or it may be any looser.
    """

    ease: float
    low: float | None
    high: float | None

    @property
    def off(self) -> float:
        """How far the ease is outside of what is wanted [m]; negative: too tight."""
        if self.low is not None and self.ease < self.low:
            return self.ease - self.low
        return max(self.ease - self.high, 0.0) if self.high is not None else 0.0

    @property
    def from_middle(self) -> float:
        """How far the ease is from the middle of what is wanted [m]; from its lower bound, where there is no other."""
        if self.low is None:
            return 0.0
        return abs(self.ease - (self.low if self.high is None else 0.5 * (self.low + self.high)))

    def words(self) -> str:
        """Return the ease beside the wanted one, in cm, and what is wrong with it."""
        if self.low is None:
            wanted = "none known"
        else:
            wanted = (
                f"{100 * self.low:.1f} or more"
                if self.high is None
                else f"{100 * self.low:.1f} to {100 * self.high:.1f}"
            )
        if self.ease < 0.0:
            said = ", smaller than the body"
        elif self.off:
            said = f", {'tight' if self.off < 0 else 'loose'} by {100 * abs(self.off):.1f}"
        else:
            said = ""
        return f"{100 * self.ease:+.1f} cm of ease (wanted: {wanted}){said}"


@dataclass(frozen=True)
class SizeFit:
    """How a size fits.

    Args:
        size: Its name.
        zones: Zone -> how it fits.
    """

    size: str
    zones: Mapping[str, ZoneFit]

    @property
    def wearable(self) -> bool:
        """Whether it goes around the body without being stretched."""
        return all(zone.ease >= 0.0 for zone in self.zones.values())

    @property
    def fits(self) -> bool:
        """Whether all zones have the wanted ease."""
        return self.wearable and all(zone.off == 0.0 for zone in self.zones.values())

    @property
    def misfit(self) -> float:
        """Sum of what is wrong in all zones [m], tight twice; 0 where it fits."""
        return sum(zone.off if zone.off >= 0.0 else -_TIGHT_COUNTS * zone.off for zone in self.zones.values())

    def reason(self) -> str:
        """Return the fit in words."""
        return "; ".join(f"{name} {zone.words()}" for name, zone in self.zones.items())


def rank_sizes(
    garment: Mapping[str, Mapping[str, float]],
    body: Mapping[str, float],
    allowances: Mapping[str, Allowance],
    may_be_loose: Sequence[str] = (),
) -> list[SizeFit]:
    """Rank the sizes of a garment for a body.

    Args:
        garment: Size -> zone -> girth of the garment [m].
        body: Zone -> girth of the body [m].
        allowances: Zone -> wanted ease.
        may_be_loose: Zones that are flared by design, so that the upper bound does not count.

    Returns:
        All sizes, the best first: those that can be worn, by what is wrong with them; among sizes that fit, by how near
        their ease is to the middle of the wanted one.

    Raises:
        InputError: garment and body share no zone whose wanted ease is known.
    """
    judged = []
    for size, girths in garment.items():
        zones = {}
        for zone, girth in girths.items():
            if zone in body:
                wanted = allowances.get(zone)
                low, high = (None, None) if wanted is None else (wanted.low, wanted.high)
                zones[zone] = ZoneFit(girth - body[zone], low, None if zone in may_be_loose else high)
        if not any(zone.low is not None for zone in zones.values()):
            known = ", ".join(allowances) or "none"
            problem = f"size {size}: no zone is known of the garment ({', '.join(girths) or 'none'}), of the body "
            raise InputError(f"{problem}({', '.join(body) or 'none'}) and of the wanted ease ({known})")
        judged.append(SizeFit(size, zones))
    return sorted(
        judged,
        key=lambda one: (not one.wearable, one.misfit, sum(zone.from_middle for zone in one.zones.values())),
    )
