"""Which artifacts can be made from the inputs, and which inputs are missing."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from itertools import product

from vto_pipeline.pipeline.catalogue import Catalogue

Ways = set[frozenset[str]]


def reachable(given: Iterable[str], catalogue: Catalogue, *, without: str = "") -> frozenset[str]:
    """Artifacts that are given or that some chain of stages makes; `without` is an artifact no stage may make."""
    return _reachable(frozenset(given), catalogue, without)


@lru_cache(maxsize=1024)  # the rows of a batch ask the same over and over
def _reachable(given: frozenset[str], catalogue: Catalogue, without: str) -> frozenset[str]:
    have = set(given)
    grew = True
    while grew:
        before = len(have)
        for stage in catalogue.stages:
            if have.issuperset(stage.needs):
                have.update(artifact for artifact in stage.makes if artifact != without)
        grew = len(have) > before
    return frozenset(have)


def lacking(artifact: str, given: Iterable[str], catalogue: Catalogue, *, only: str | None = None) -> list[list[str]]:
    """Keys under `given:` that are missing for an artifact: the leaves, not their consequences.

    Args:
        artifact: What cannot be made.
        given: Artifacts there are.
        catalogue: The tables.
        only: The one stage that may make it, or None for any.

    Returns:
        Groups of alternatives; one key of each group would do. Only the smallest additions are considered, and where
        several things are missing at once, the keys of one section are the alternatives.
    """
    return [list(group) for group in _lacking(artifact, frozenset(given), catalogue, only)]


@lru_cache(maxsize=1024)
def _lacking(artifact: str, given: frozenset[str], catalogue: Catalogue, only: str | None) -> list[list[str]]:
    ways = _ways(artifact, reachable(given, catalogue), catalogue, frozenset(), only)
    fewest = min((len(way) for way in ways), default=0)
    named = {key for way in ways if len(way) == fewest for key in way}
    keys = [key for key in catalogue.given if key in named]
    if fewest <= 1:
        return [keys] if keys else []
    groups: dict[str, list[str]] = {}
    for key in keys:
        groups.setdefault(key.partition(".")[0], []).append(key)
    return list(groups.values())


def _ways(
    artifact: str, have: frozenset[str], catalogue: Catalogue, above: frozenset[str], only: str | None = None
) -> Ways:
    """Smallest sets of keys that would make an artifact available; `above` guards against circles."""
    if artifact in have and only is None:
        return {frozenset()}
    if artifact in above:
        return set()
    found: Ways = set() if only else {frozenset([key]) for key in catalogue.keys(artifact)}
    for stage in catalogue.makers(artifact):
        if only in (None, stage.name):
            choices = [_ways(need, have, catalogue, above | {artifact}) for need in stage.needs]
            found |= {frozenset().union(*parts) for parts in product(*choices)}
    return {way for way in found if not any(other < way for other in found)}
