"""Which of MakeHuman's macro targets, in which shares, make a person of a given sex, age and build.

Ages and builds are blended between the data's own: a newborn year, a child, a young and an old person; thin, average
and heavy. Peoples of the world have equal shares: the avatar says nothing of its ancestors.
"""

from __future__ import annotations

from itertools import product

import numpy as np

_AGES = {"baby": 1.0, "child": 10.0, "young": 25.0, "old": 90.0}
"""Age of each shape [years], as MakeHuman's age slider has it."""
_BODY_MASS = {"minweight": 16.5, "averageweight": 22.0, "maxweight": 38.0}
"""Body mass index that each shape stands for [kg/m2]; our assumption, read off the volumes of its grown bodies."""
_PEOPLES = ("african", "asian", "caucasian")

TARGETS = tuple(
    [f"{people}-{sex}-{age}" for people, sex, age in product(_PEOPLES, ("female", "male"), _AGES)]
    + [
        f"universal-{sex}-{age}-averagemuscle-{mass}"
        for sex, age, mass in product(("female", "male"), _AGES, _BODY_MASS)
    ]
)
"""Every target that `shares` can ask for."""


def shares(sex: float, age_years: float, body_mass_index: float) -> dict[str, float]:
    """Return the share of each target of a person; those without one are left out.

    Args:
        sex: 0 female ... 1 male.
        age_years: Held within the data's ages.
        body_mass_index: Held within the data's builds [kg/m2].
    """
    sexes = {"female": 1.0 - sex, "male": sex}
    ages, masses = _between(_AGES, age_years), _between(_BODY_MASS, body_mass_index)
    found = {
        f"{people}-{name}-{age}": part * share / len(_PEOPLES)
        for people, (name, part), (age, share) in product(_PEOPLES, sexes.items(), ages.items())
    }
    found |= {
        f"universal-{name}-{age}-averagemuscle-{mass}": part * share * weight
        for (name, part), (age, share), (mass, weight) in product(sexes.items(), ages.items(), masses.items())
    }
    return {target: share for target, share in found.items() if share > 0}


def _between(knots: dict[str, float], value: float) -> dict[str, float]:
    """Return the share of each knot in a value between two of them."""
    places = list(knots.values())
    each = np.eye(len(places))
    return {name: float(np.interp(value, places, each[k])) for k, name in enumerate(knots)}
