"""A body from a tape: every given measurement met, the rest as the population has it."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from vto_pipeline.avatar.definitions import DEFINITIONS, definition
from vto_pipeline.avatar.population import Population, population
from vto_pipeline.avatar.shape import SEX_SHARE, ShapeSpace, shape_space
from vto_pipeline.avatar.tape import Reading, Tape
from vto_pipeline.errors import AvatarError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar, Measurements
from vto_pipeline.model.job import Job
from vto_pipeline.model.settings import Config

_HOLD_M, _HOLD_KG = 0.0002, 0.05
_MAX_STEP = 2.0
_HALVINGS = 6
_SETTLED = 1e-3


class MeasurementsConfig(Config):
    """Settings of the fit to measurements."""

    sex: Literal["female", "male", "neutral"] = Field(
        default="neutral", description="whose body it is where the measurements do not say"
    )
    iterations: int = Field(default=12, ge=1, le=100, description="Gauss-Newton steps at most")
    tolerance_mm: float = Field(
        default=2.0, gt=0, le=50, description="larger misses of a given measurement are reported [mm]"
    )
    expected_weight: float = Field(
        default=5.0, gt=0, le=100, description="how strongly the expected measurements hold, 1 as their spread"
    )
    unlikely_sigmas: float = Field(
        default=4.0, gt=0, le=20, description="a given value this far from what the others say is reported"
    )


def fit_measurements(
    measurements: Measurements, config: MeasurementsConfig | None = None, job: Job | None = None
) -> Avatar:
    """Return the body that has the given measurements, in the bind pose.

    Gauss-Newton on the shape parameters (Nocedal & Wright 2006, 10.3): given values are held, the others are drawn to
    their expectation under ANSUR II given these, the parameters to the mean body.

    Args:
        measurements: Names of `definitions`; a value with a sigma is an observation, one without is held.
        config: Settings.
        job: Receives `<name>_error_mm` for each held value, and warnings about contradictions.

    Raises:
        InputError: an unknown measurement name.
        AvatarError: no measurement at all, or no believable body has them.
    """
    config, job = config or MeasurementsConfig(), job or Job()
    values = {definition(name).name: value for name, value in measurements.values.items()}
    sigmas = {definition(name).name: value for name, value in measurements.sigmas.items()}
    if not values:
        raise AvatarError("no measurement is given", hint="give at least stature")
    held = {name: value for name, value in values.items() if name not in sigmas}
    sex = config.sex if measurements.sex == "neutral" else measurements.sex
    prior = population(sex)
    _report_unlikely(prior, held, config, job)
    expected = prior.given(values, sigmas)
    space = shape_space(SEX_SHARE[sex])
    parameters = _solve(space, held, expected, config, job)
    body = space.avatar(parameters)
    _report_errors(body, held, config, job)
    return body


def _solve(
    space: ShapeSpace, held: dict[str, float], expected: Population, config: MeasurementsConfig, job: Job
) -> FloatArray:
    tape = Tape(space.base)
    free = [k for k, name in enumerate(expected.names) if name not in held]
    names = [*held, *(expected.names[k] for k in free)]
    target = np.array([*held.values(), *expected.mean[free]])
    spread = expected.covariance[np.ix_(free, free)]
    floor = np.diag(0.02 * np.diag(spread) + 1e-8)
    weight = np.zeros((len(names), len(names)))
    weight[: len(held), : len(held)] = np.diag([1 / (_HOLD_KG if name == "mass" else _HOLD_M) for name in held])
    weight[len(held) :, len(held) :] = config.expected_weight * np.linalg.inv(np.linalg.cholesky(spread + floor))
    read = [DEFINITIONS[name] for name in names]

    def residual(parameters: FloatArray) -> tuple[FloatArray, list[Reading]]:
        vertices = space.vertices(parameters)
        readings = [tape.read(what, vertices) for what in read]
        wrong = np.array([reading.value for reading in readings]) - target
        return np.concatenate([weight @ wrong, space.whitener @ parameters]), readings

    parameters = np.zeros(len(space.names))
    wrong, readings = residual(parameters)
    for step in range(config.iterations):
        slope = np.array([_by_parameters(space, reading) for reading in readings])
        move = np.linalg.lstsq(np.concatenate([weight @ slope, space.whitener]), -wrong, rcond=None)[0]
        size = np.abs(move / space.sigmas).max()
        move *= min(1.0, _MAX_STEP / size)
        # a taut tape jumps from one bump to the next: a full step may overshoot
        for _ in range(_HALVINGS):
            tried, seen = residual(parameters + move)
            if tried @ tried < wrong @ wrong:
                break
            move /= 2
        else:
            break
        parameters, wrong, readings = parameters + move, tried, seen
        job.progress((step + 1) / config.iterations, f"fit to {len(held)} measurements, step {step + 1}")
        if size < _SETTLED:
            break
    return parameters


def _by_parameters(space: ShapeSpace, reading: Reading) -> FloatArray:
    return np.einsum("nk,pnk->p", reading.gradient, space.fields[:, reading.vertices])


def _report_unlikely(prior: Population, held: dict[str, float], config: MeasurementsConfig, job: Job) -> None:
    for name in held:
        if name not in prior.names:
            continue
        others = prior.given({k: v for k, v in held.items() if k != name}, {})
        k = prior.names.index(name)
        away = (held[name] - others.mean[k]) / np.sqrt(others.covariance[k, k])
        if abs(away) > config.unlikely_sigmas:
            unit, scale = ("kg", 1.0) if name == "mass" else ("cm", 100.0)
            job.warn(
                f"{name} = {held[name] * scale:.1f} {unit} is {abs(away):.1f} standard deviations from the "
                f"{others.mean[k] * scale:.1f} {unit} that the other measurements lead one to expect"
            )


def _report_errors(body: Avatar, held: dict[str, float], config: MeasurementsConfig, job: Job) -> None:
    if not np.isfinite(body.vertices).all():
        raise AvatarError("no body has these measurements: the fit diverged", hint="check units")
    tape = Tape(body)
    worst = 0.0
    for name, value in held.items():
        error = tape.read(DEFINITIONS[name], body.bind_vertices).value - value
        if name == "mass":
            job.measure(mass_error_kg=round(float(error), 3))
            continue
        job.measure(**{f"{name}_error_mm": round(float(error) * 1e3, 3)})
        worst = max(worst, abs(error) * 1e3)
        if abs(error) * 1e3 > config.tolerance_mm:
            job.warn(f"{name} = {value * 100:.1f} cm is missed by {error * 100:+.1f} cm: it contradicts the others")
    job.measure(worst_error_mm=round(float(worst), 3))
