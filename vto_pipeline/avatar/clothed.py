"""A body that fits inside a scan of clothes: its shape is that of the people whom the clothes fit, its pose the scan's.

Where bare skin shows, it is the shape of these people too, to some millimetres: no detail is taken from the scan.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vto_pipeline.avatar.correspondence import Target
from vto_pipeline.avatar.definitions import DEFINITIONS
from vto_pipeline.avatar.ease import wearers
from vto_pipeline.avatar.from_measurements import MeasurementsConfig, by_parameters, mean_parameters, solve_shape
from vto_pipeline.avatar.measure import measure, sex_name
from vto_pipeline.avatar.population import Population, population
from vto_pipeline.avatar.registration import Fit, model, refine
from vto_pipeline.avatar.scan_report import CORE, ends
from vto_pipeline.avatar.shape import ShapeSpace
from vto_pipeline.avatar.tape import Tape
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar, Measurements
from vto_pipeline.model.job import Job

_STEPS, _REACH_M = 12, 0.05
"""The reach stays: within a shorter one a limb is drawn to that side of its sleeve or trouser leg which is nearer."""
_WITHIN_M, _LOOSE_M = 0.003, 0.02
"""How sharply cloth and skin end the body, when the pose is found, and how far cloth hangs off, all round alike."""
_SHAPE_STAYS = 100.0
"""How much more than it should the shape is held while the pose is found."""
_LEVEL_M = 0.01
"""How surely a row lies at its level on what was fitted to clothes, which hide what would show it; our assumption."""


def undressed(space: ShapeSpace, fit: Fit, scan: Target, shell: Avatar, job: Job) -> tuple[Fit, dict[str, float]]:
    """Return shape and pose of the body inside, and the standard uncertainty of all its measurements [m, kg].

    Args:
        space: The shape space.
        fit: Of the model that was fitted to the clothes as if they were skin.
        scan: The clothes.
        shell: That model, displaced onto the clothes.
        job: For its seed.
    """
    sex, config = sex_name(space.base.sex), MeasurementsConfig()
    expected = wearers(population(sex), _clothes(shell), job.seed)
    parameters = solve_shape(space, {}, expected, config, Job(), mean_parameters(sex, config))
    found = replace(fit, parameters=parameters, expected=parameters)
    chosen = np.flatnonzero(ends(space) < CORE)[::3]
    clothes = scan.as_clothes((_WITHIN_M / _LOOSE_M) ** 2)
    for _ in range(_STEPS):
        pairs = clothes.pairs(model(space, found), space.base.faces, chosen, _REACH_M)
        found = refine(space, found, pairs, _WITHIN_M, _SHAPE_STAYS)
    return replace(found, parameters=parameters), _sigmas(space, parameters, expected)


def _clothes(shell: Avatar) -> Measurements:
    """Return what is read on the clothes; a girth near a hem or a cuff changes with its level, and is less sure."""
    read, tape = measure(shell), Tape(shell)
    girths = {name: what for name, what in DEFINITIONS.items() if what.kind == "girth"}
    unsure = {name: tape.by_level(what, shell.bind_vertices, _LEVEL_M) for name, what in girths.items()}
    return replace(read, sigmas=unsure)


def _sigmas(space: ShapeSpace, parameters: FloatArray, expected: Population) -> dict[str, float]:
    """What the population does not hold follows from the shape."""
    tape, vertices = Tape(space.base), space.vertices(parameters)
    slopes = {name: by_parameters(space, tape.read(what, vertices)) for name, what in DEFINITIONS.items()}
    whiten = np.linalg.inv(np.linalg.cholesky(expected.covariance + 1e-10 * np.eye(len(expected.names))))
    rows = np.concatenate([whiten @ [slopes[name] for name in expected.names], space.whitener])
    covariance = np.linalg.inv(rows.T @ rows)
    known = dict(zip(expected.names, np.sqrt(np.diag(expected.covariance)).tolist(), strict=True))
    return {name: known.get(name, float(np.sqrt(slope @ covariance @ slope))) for name, slope in slopes.items()}
