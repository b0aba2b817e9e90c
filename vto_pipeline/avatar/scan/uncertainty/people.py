"""How much people differ in what a scan does not show: no measurement is surer than that.

The model fills the unseen in from the seen, and is sure of it: its own build leaves little open. People are built more
freely. What is left to know of them, once all that the scan shows is measured, is the population's.
"""

from __future__ import annotations

import numpy as np

from vto_pipeline.avatar.measuring.avatar_measurements import measure_avatar, sex_name
from vto_pipeline.avatar.measuring.definitions import DEFINITIONS
from vto_pipeline.avatar.measuring.population import population
from vto_pipeline.avatar.measuring.tape import LANDMARK_M, Tape
from vto_pipeline.avatar.scan.correspondence import Target
from vto_pipeline.avatar.scan.report import EXPLAINED_M
from vto_pipeline.geometry.closest import closest_points
from vto_pipeline.model.body import Avatar

_ALIKE_M = 0.10
"""How far along the surface it bulges alike: belly, breast and seat are as wide; our assumption."""
_HALF = 2.0
"""People differ at the front apart from the back: half of a girth that is hidden leaves all of its spread open."""
_SHOWN = 0.3
"""A measurement of which less is open counts as taken, as surely as it is."""
_LIKE = {
    "underbust_girth": "chest_girth",
    "high_hip_girth": "hip_girth",
    "armscye_girth": "upper_arm_girth",
    "elbow_girth": "forearm_girth",
}
"""Girths that no survey has, and those whose spread they have, as a share."""


def as_people_differ(body: Avatar, sigmas: dict[str, float], scan: Target) -> dict[str, float]:
    """Return standard uncertainties that are no smaller than people differ in what was not seen [m, kg].

    Args:
        body: Registered to the scan.
        sigmas: Name -> standard uncertainty of each measurement, of other causes.
        scan: What it was registered to [m].
    """
    hidden = open_shares(body, scan)
    read = measure_avatar(body).values
    people = population(sex_name(body.sex))
    shown = {name: read[name] for name in people.names if hidden[name] < _SHOWN}
    if len(shown) == len(people.names):
        return sigmas
    left = people.given(shown, {name: float(np.hypot(sigmas[name], LANDMARK_M)) for name in shown})
    spread = dict(zip(left.names, np.sqrt(np.diag(left.covariance)).tolist(), strict=True))
    spread |= {name: spread[other] * read[name] / read[other] for name, other in _LIKE.items()}
    return {name: max(sigma, hidden[name] * spread.get(name, 0.0)) for name, sigma in sigmas.items()}


def open_shares(body: Avatar, scan: Target) -> dict[str, float]:
    """Return name -> the share of a measurement's spread that is open: 0 of what is seen, 1 of what is far from it.

    The surface is a Matern 3/2 process (Rasmussen & Williams 2006, eq. 4.17) that is known at the scan: at a distance
    it has a standard deviation. A tape adds that up by how much it depends on each place.

    Args:
        body: Registered to the scan.
        scan: What it was registered to [m].
    """
    distance = closest_points(body.vertices, scan.vertices, scan.faces)[2]
    away = np.sqrt(3.0) * distance / _ALIKE_M
    alike = (1.0 + away) * np.exp(-away)
    free = np.sqrt(1.0 - np.minimum(alike, 1.0) ** 2)
    free[distance < EXPLAINED_M] = 0.0
    tape, shares = Tape(body), {}
    for name, what in DEFINITIONS.items():
        sides = []
        for side in ("left", "right"):
            reading = tape.read(what, body.bind_vertices, side)
            pull = np.linalg.norm(reading.gradient, axis=1)
            sides.append(float(pull @ free[reading.vertices] / pull.sum()))
        shares[name] = min(1.0, _HALF * float(np.mean(sides)))
    return shares
