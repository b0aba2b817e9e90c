"""Children, by the statistics of adults: at an adult's size, with a child's head and legs.

The survey knows no body shorter than a small adult, and what it says of longer bodies does not hold below: girths
would stay while heights shrink. So a child is looked at enlarged to that size, where all is measured and expected, and
comes back as small as it is.

A head grows far less than a body does, and legs a little more. From 0.75 to 1.15 m of stature heads go from 0.455 to
0.515 m round (WHO 2006; Nellhaus 1968), as the fourth root of stature does; the powers are our fit to that, and for
legs our assumption.
"""

from __future__ import annotations

from collections.abc import Mapping

from vto_pipeline.avatar.measuring.population import Population

_SMALLEST_SIGMAS = 3.0
"""So far below the mean the statistics are trusted."""
_HEAD, _LEGS = 0.25, 1.12
"""Powers of stature by which heads and legs grow."""
_SURE_M = 0.005
"""Of what follows by them, at an adult's size; our assumption."""
_LEAN_KG_M2, _LEANER_KG_M3, _LEAN_SHARE = 15.3, 3.2, 0.12
"""Body mass index of a child of a metre, how it grows with stature, and its spread (WHO 2006 and 2007, both sexes)."""
_BEFORE_PUBERTY = 0.95
"""Enlarged more than this, girls are built as boys are."""


def size_share(stature: float | None, population: Population) -> float:
    """Return how large a body is against the smallest that the statistics know, 1 at most."""
    if stature is None:
        return 1.0
    k = population.names.index("stature")
    return float(min(1.0, stature / (population.mean[k] - _SMALLEST_SIGMAS * population.covariance[k, k] ** 0.5)))


def build_of(sex: str, share: float) -> str:
    """Return whose statistics and shape a body of this size share has: "female", "male" or "neutral"."""
    return sex if share > _BEFORE_PUBERTY else "male"


def resized(values: Mapping[str, float], factor: float) -> dict[str, float]:
    """Return measurements of the same shape so many times as large [m, kg]."""
    return {name: value * factor ** (3 if name == "mass" else 1) for name, value in values.items()}


def childs_growth(enlarged: Population, stature: float, share: float) -> tuple[dict[str, float], dict[str, float]]:
    """Return what a child's growth says of its enlarged body, values and standard uncertainties [m, kg].

    Args:
        enlarged: What is expected of an adult with the enlarged measurements.
        stature: Enlarged [m].
        share: Of the child's size in that.
    """
    small = share * stature
    usual = dict(zip(enlarged.names, enlarged.mean.tolist(), strict=True))
    larger, longer = share ** (_HEAD - 1), share ** (_LEGS - 1)
    values = {
        "head_girth": usual["head_girth"] * larger,
        "back_neck_height": stature - (stature - usual["back_neck_height"]) * larger,
        "inside_leg": usual["inside_leg"] * longer,
        "mass": (_LEAN_KG_M2 + _LEANER_KG_M3 * max(small - 1.0, 0.0)) * small**2 / share**3,
    }
    return values, {**dict.fromkeys(values, _SURE_M), "mass": _LEAN_SHARE * values["mass"]}
