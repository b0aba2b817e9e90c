"""Uncertainty of measurements where the scan shows the body: levels, and the surface itself.

A girth on a steep flank changes with the level of its loop, which no smooth body shows to the millimetre; and a
registered surface lies off the scan's by what its smoothness and the scan's noise leave over.
"""

from __future__ import annotations

import numpy as np

from vto_pipeline.avatar.measuring.avatar_measurements import measure_avatar, sex_name
from vto_pipeline.avatar.measuring.definitions import DEFINITIONS, Definition
from vto_pipeline.avatar.measuring.measuring_levels import level_spread
from vto_pipeline.avatar.measuring.population import population
from vto_pipeline.avatar.measuring.tape import Tape
from vto_pipeline.avatar.model.shape import ShapeSpace
from vto_pipeline.avatar.scan.correspondence import Target
from vto_pipeline.avatar.scan.report import CORE, EXPLAINED_M, extremity_weights
from vto_pipeline.geometry.closest import closest_points
from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.mesh import TriangleMesh

_ALIKE_M = 0.04
"""Over which a registered surface errs alike: what the displacement's stiffness smooths over; our assumption."""
_GOES_WITH = {"underbust": "chest", "high_hip": "navel"}
"""Levels that nothing shows and no survey has, and whose uncertainty they share."""


def level_sigmas(body: Avatar) -> dict[str, float]:
    """Return name -> standard uncertainty from the measuring level [m], of an upright registered body.

    A level the body shows is known as `level_spread` says, another as well as people of these levels have it alike.
    """
    spread = level_spread(body.bind_vertices, body)
    read = measure_avatar(body)
    people = population(sex_name(body.sex))
    shown = {f"{row}_height": sigma for row, sigma in spread.items() if f"{row}_height" in people.names}
    others = people.given({name: read.values[name] for name in ("stature", *shown)}, shown)
    for row in ("chest", "waist", "navel", "hip"):
        k = others.names.index(f"{row}_height")
        spread.setdefault(row, float(np.sqrt(others.covariance[k, k])))
    spread |= {row: spread[other] for row, other in _GOES_WITH.items()}
    tape, sigmas = Tape(body), {}
    for name, what in DEFINITIONS.items():
        reach = spread.get(what.place.rpartition(":")[2], 0.0)
        if what.kind in ("girth", "breadth", "depth"):
            sigmas[name] = tape.by_level(what, body.bind_vertices, reach) if reach else 0.0
        else:
            sigmas[name] = reach if what.kind in ("height", "path") else 0.0
    return sigmas


def surface_sigmas(space: ShapeSpace, scan: Target, body: Avatar) -> dict[str, float]:
    """Return name -> standard uncertainty from the distance of the surface to the scan [m, kg].

    The distances are a random field along the normals, as large as they are all over trunk and limbs, alike over
    `_ALIKE_M`: a girth sums them up all round.
    """
    _, at, away = closest_points(body.vertices, scan.vertices, scan.faces)
    off = ((at - body.vertices) * vertex_normals(body.mesh)).sum(axis=1)
    judged = (away < EXPLAINED_M) & (extremity_weights(space.base) < CORE)
    size = float(np.sqrt((off[judged] ** 2).mean())) if judged.any() else 0.0
    normals = vertex_normals(TriangleMesh(body.bind_vertices, body.faces))
    tape = Tape(body)
    return {name: size * _summed(what, tape, body.bind_vertices, normals) for name, what in DEFINITIONS.items()}


def _summed(what: Definition, tape: Tape, vertices: FloatArray, normals: FloatArray) -> float:
    """Standard deviation of a measurement when the surface errs by a unit along its normals, alike near by."""
    if what.kind == "mass":
        return 0.0  # of a whole body, errors that are alike over centimetres cancel
    variance = 0.0
    for side in ("left", "right"):
        reading = tape.read(what, vertices, side)
        pull = (reading.gradient * normals[reading.vertices]).sum(axis=1)
        apart = np.linalg.norm(vertices[reading.vertices, None] - vertices[None, reading.vertices], axis=2)
        variance += 0.5 * float(pull @ np.exp(-((apart / _ALIKE_M) ** 2)) @ pull)
    return float(np.sqrt(max(variance, 0.0)))
