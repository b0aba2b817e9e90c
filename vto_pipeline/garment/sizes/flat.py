"""Flat measurements of a garment, as on a size chart, taken from its pattern.

The garment lies flat, so a girth is given as half of it: chest, waist, hip, hem, thigh, cuff.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from vto_pipeline.garment.sizes.outline import Outline, of_part, outlines
from vto_pipeline.garment.sizes.rules import Part, SizeRules
from vto_pipeline.garment.sizes.shoulder_point import shoulder_level
from vto_pipeline.garment.sizes.widths import armpit_level, crotch_level, edge_lengths, middle_level, width_at
from vto_pipeline.model.pattern import Pattern

HALVES = ("chest", "waist", "hip", "hem", "thigh", "cuff")
"""Those that are half of a girth."""
_HIP_M = 0.20  # of a skirt, below its waist
_SEAT_M = 0.075  # of trousers, above the crotch


@dataclass(frozen=True)
class FlatMeasure:
    """One measurement.

    Args:
        value: [m].
        found: Where it was taken, in words.
    """

    value: float
    found: str


def flat_measurements(pattern: Pattern, rules: SizeRules) -> dict[str, FlatMeasure]:
    """Measure a garment laid flat.

    Args:
        pattern: Of one size, with stitches.
        rules: Of its type.

    Returns:
        Name -> measurement, as far as the garment has them: chest, waist, hip, hem, thigh, cuff, length, shoulder,
        sleeve, rise, inseam, armhole_depth, bodice.

    Raises:
        GarmentError: a panel is no part of such a garment, or the pattern has no stitches.
    """
    named = outlines(pattern, rules)
    found = dict(_torso(of_part(named, "torso"))) | dict(_sleeves(named, pattern))
    found |= dict(_legs(named, pattern)) | dict(_skirt(of_part(named, "skirt")))
    band = of_part(named, "waistband")
    if band:
        half = edge_lengths(band, "waist") / 2.0
        found["waist"] = FlatMeasure(half, f"upper edge of {_names(band)}, half of it")
    if length := _length(found, band):
        found["length"] = length
    return found


def _torso(torso: list[Outline]) -> Iterator[tuple[str, FlatMeasure]]:
    cut = [(one, level) for one in torso if (level := armpit_level(one)) is not None]
    if cut:
        chest = sum(width_at(one.points(), level) for one, level in cut) / 2.0
        yield "chest", FlatMeasure(chest, f"across {_names([one for one, _ in cut])} at the armpit, half of the sum")
    for role, name in (("waist", "waist"), ("hem", "hem")):
        if length := edge_lengths(torso, role):
            yield name, FlatMeasure(length / 2.0, f"{role} of {_names(torso, role)}, half of it")
    if shoulders := [(one, k) for one in torso for k in one.edges_of("shoulder")]:
        mean = edge_lengths(torso, "shoulder") / len(shoulders)
        yield "shoulder", FlatMeasure(mean, "shoulder seam")
    depth: list[float] = []
    drop: list[float] = []
    for one in torso:
        top = one.corners[one.corners_between("shoulder", "neck"), 1]
        low = middle_level(one, "hem")
        low = middle_level(one, "waist") if low is None else low
        armpit = armpit_level(one)
        if len(top) and low is not None:
            drop.append(float(top.max()) - low)
        if len(top) and armpit is not None:
            depth.append(float(top.max()) - armpit)
    if drop:
        yield "bodice", FlatMeasure(float(np.mean(drop)), "along the grain, neck end of the shoulder to the lower edge")
    if depth:
        yield "armhole_depth", FlatMeasure(float(np.mean(depth)), "along the grain, neck end of the shoulder to armpit")


def _sleeves(named: Mapping[str, Outline], pattern: Pattern) -> Iterator[tuple[str, FlatMeasure]]:
    sleeves = of_part(named, "sleeve")
    lows = [(one, low) for one in sleeves if (low := middle_level(one, "cuff")) is not None]
    if lows:
        length = float(np.mean([shoulder_level(one, named, pattern) - low for one, low in lows]))
        yield "sleeve", FlatMeasure(length, "along the sleeve, end of the shoulder seam to the cuff")
        half = edge_lengths(sleeves, "cuff") / _count(named, pattern, "sleeve") / 2.0
        yield "cuff", FlatMeasure(half, "end of a sleeve, half of it")


def _legs(named: Mapping[str, Outline], pattern: Pattern) -> Iterator[tuple[str, FlatMeasure]]:
    legs = of_part(named, "leg")
    if not legs:
        return
    waist = edge_lengths(legs, "waist") / 2.0
    yield "waist", FlatMeasure(waist, f"upper edge of {_names(legs)}, half of it")
    levels = [crotch_level(one) for one in legs]
    tops = [middle_level(one, "waist") for one in legs]
    seat = sum(width_at(one.points(), level + _SEAT_M) for one, level in zip(legs, levels, strict=True)) / 2.0
    yield "hip", FlatMeasure(seat, f"across {_names(legs)} {100 * _SEAT_M:g} cm above the crotch, half of the sum")
    rise = float(np.mean([top - level for top, level in zip(tops, levels, strict=True) if top is not None]))
    yield "rise", FlatMeasure(rise, "along the grain, upper edge of the legs to the crotch")
    inseam = edge_lengths(legs, "inseam") / len(legs)
    yield "inseam", FlatMeasure(inseam, "seam from crotch to hem")
    thigh = sum(width_at(one.points(), level) for one, level in zip(legs, levels, strict=True)) / 4.0
    yield "thigh", FlatMeasure(thigh, "across one leg at the crotch, half of it")
    yield "hem", FlatMeasure(edge_lengths(legs, "hem") / 4.0, "end of one leg, half of it")
    lows = [middle_level(one, "hem") for one in legs]
    drop = [top - low for top, low in zip(tops, lows, strict=True) if top is not None and low is not None]
    if drop:
        yield "legs", FlatMeasure(float(np.mean(drop)), "along the grain, upper edge of the legs to the hem")


def _skirt(skirt: list[Outline]) -> Iterator[tuple[str, FlatMeasure]]:
    if not skirt:
        return
    waist, hem = (edge_lengths(skirt, role) / 2.0 for role in ("waist", "hem"))
    yield "waist", FlatMeasure(waist, f"upper edge of {_names(skirt)}, half of it")
    yield "hem", FlatMeasure(hem, f"hem of {_names(skirt)}, half of it")
    tops = [middle_level(one, "waist") for one in skirt]
    hips = [width_at(one.points(), top - _HIP_M) for one, top in zip(skirt, tops, strict=True) if top is not None]
    yield "hip", FlatMeasure(sum(hips) / 2.0, f"across {_names(skirt)} {100 * _HIP_M:g} cm below its upper edge, half")
    lows = [middle_level(one, "hem") for one in skirt]
    drop = [top - low for top, low in zip(tops, lows, strict=True) if top is not None and low is not None]
    if drop:
        yield "skirt", FlatMeasure(float(np.mean(drop)), "along the grain, upper edge of the skirt to the hem")


def _length(found: dict[str, FlatMeasure], band: list[Outline]) -> FlatMeasure | None:
    """Return the whole length, and take the lengths of skirt and legs out: they are but parts of it."""
    pieces: dict[str, float] = {name: found.pop(name).value for name in ("skirt", "legs") if name in found}
    if "bodice" in found:
        pieces["bodice"] = found["bodice"].value
    if band:
        ends = [one.corners[:, 1].max() - one.corners[:, 1].min() for one in band]
        pieces["waistband"] = float(np.mean(ends))
    if not pieces:
        return None
    if list(pieces) == ["bodice"]:
        return found.pop("bodice")
    return FlatMeasure(sum(pieces.values()), f"along the grain: {' + '.join(pieces)}")


def _count(named: Mapping[str, Outline], pattern: Pattern, part: Part) -> int:
    """Return how many sleeves there are: panels of that part that are sewn to each other are one."""
    names = [name for name, one in named.items() if one.part == part]
    links = [
        (names.index(s.first[0].panel), names.index(s.second[0].panel))
        for s in pattern.stitches
        if s.first[0].panel in names and s.second[0].panel in names
    ]
    rows, columns = zip(*links, strict=True) if links else ((), ())
    graph = coo_array((np.ones(len(links)), (rows, columns)), shape=(len(names), len(names)))
    return int(connected_components(graph, directed=False)[0])


def _names(panels: list[Outline], role: str | None = None) -> str:
    return ", ".join(one.panel.name for one in panels if role is None or one.edges_of(role))
