"""A body inside a scan of clothes: pose from the scan, shape from the people whom the clothes fit.

Where bare skin shows, it is the shape of these people too, to some millimetres: no detail is taken from the scan.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vto_pipeline.avatar.from_measurements import MeasurementsConfig, mean_parameters, solve_shape
from vto_pipeline.avatar.measuring.avatar_measurements import measure_avatar, sex_name
from vto_pipeline.avatar.measuring.definitions import DEFINITIONS
from vto_pipeline.avatar.measuring.population import Population, population
from vto_pipeline.avatar.measuring.tape import Tape
from vto_pipeline.avatar.model.fit import Fit, posed_vertices
from vto_pipeline.avatar.model.shape import ShapeSpace
from vto_pipeline.avatar.scan.body_under_clothes import likely_wearers
from vto_pipeline.avatar.scan.correspondence import Target
from vto_pipeline.avatar.scan.registration import refine_registration
from vto_pipeline.avatar.scan.report import CORE, extremity_weights
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


def fit_under_clothes(
    space: ShapeSpace, fit: Fit, scan: Target, shell: Avatar, job: Job, tape: Measurements | None = None
) -> tuple[Fit, dict[str, float]]:
    """Return shape and pose of the body inside, and the standard uncertainty of all its measurements [m, kg].

    Args:
        space: The shape space.
        fit: Of the model that was fitted to the clothes as if they were skin.
        scan: The clothes.
        shell: That model, displaced onto the clothes.
        job: For its seed.
        tape: What was measured of the body itself.
    """
    sex, config = sex_name(space.base.sex), MeasurementsConfig()
    known = {} if tape is None else dict(tape.values)
    people = population(sex) if tape is None else population(sex).given(known, dict(tape.sigmas))
    expected = likely_wearers(people, _clothes(shell), job.seed)
    held = {} if tape is None else {name: value for name, value in known.items() if name not in tape.sigmas}
    parameters = solve_shape(space, held, expected, config, Job(), mean_parameters(sex, config))
    found = replace(fit, parameters=parameters, expected=parameters)
    chosen = np.flatnonzero(extremity_weights(space.base) < CORE)[::3]
    clothes = scan.as_clothes((_WITHIN_M / _LOOSE_M) ** 2)
    for _ in range(_STEPS):
        pairs = clothes.pairs(posed_vertices(space, found), space.base.faces, chosen, _REACH_M)
        found = refine_registration(space, found, pairs, _WITHIN_M, _SHAPE_STAYS)
    return replace(found, parameters=parameters), _sigmas(space, parameters, expected)


def _clothes(shell: Avatar) -> Measurements:
    """Return the girths of the clothes; near a hem or a cuff they are less certain."""
    read, tape = measure_avatar(shell), Tape(shell)
    girths = {name: what for name, what in DEFINITIONS.items() if what.kind == "girth"}
    unsure = {name: tape.by_level(what, shell.bind_vertices, _LEVEL_M) for name, what in girths.items()}
    return replace(read, sigmas=unsure)


def _sigmas(space: ShapeSpace, parameters: FloatArray, expected: Population) -> dict[str, float]:
    """Return uncertainties; those missing in the population follow from the shape."""
    tape, vertices = Tape(space.base), space.vertices(parameters)
    slopes = {name: tape.read(what, vertices).by_parameters(space.fields) for name, what in DEFINITIONS.items()}
    whiten = np.linalg.inv(np.linalg.cholesky(expected.covariance + 1e-10 * np.eye(len(expected.names))))
    rows = np.concatenate([whiten @ [slopes[name] for name in expected.names], space.whitener])
    covariance = np.linalg.inv(rows.T @ rows)
    known = dict(zip(expected.names, np.sqrt(np.diag(expected.covariance)).tolist(), strict=True))
    return {name: known.get(name, float(np.sqrt(slope @ covariance @ slope))) for name, slope in slopes.items()}
