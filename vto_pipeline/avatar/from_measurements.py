"""A body from tape measurements: the given ones are met, the rest follow the population."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Literal

import numpy as np
from pydantic import Field

from vto_pipeline.avatar.measuring.definitions import DEFINITIONS, definition
from vto_pipeline.avatar.measuring.growth import build_of, childs_growth, resized, size_share
from vto_pipeline.avatar.measuring.population import Population, population
from vto_pipeline.avatar.measuring.tape import Reading, Tape
from vto_pipeline.avatar.model.shape import SEX_SHARE, ShapeSpace, shape_space
from vto_pipeline.errors import AvatarError
from vto_pipeline.geometry.topology import face_area_vectors
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar, Measurements
from vto_pipeline.model.job import Job
from vto_pipeline.model.settings import Config

_HOLD_M, _HOLD_KG = 0.0002, 0.05
_MASS_WEIGHT = 8.0
"""How much the expected mass counts beside all: the parameters' spread, each on its own, makes lean bodies heavy."""
_DAMPING, _TRIES = 1e-3, 8
_SETTLED = 1e-5
"""Relative fall of the residual below which the fit has arrived."""


class MeasurementsConfig(Config):
    """Settings of the fit to measurements."""

    sex: Literal["female", "male", "neutral"] = Field(
        default="neutral", description="Sex, where the measurements do not say"
    )
    iterations: int = Field(default=20, ge=1, le=100, description="Levenberg-Marquardt steps, at most")
    tolerance_mm: float = Field(
        default=2.0, gt=0, le=50, description="Larger misses of a given measurement are reported [mm]"
    )
    expected_weight: float = Field(
        default=4.0, gt=0, le=100, description="Weight of the expected measurements; 1 follows their spread"
    )
    unlikely_sigmas: float = Field(
        default=4.0, gt=0, le=20, description="A value this far from what the others predict is reported"
    )


def fit_measurements(
    measurements: Measurements, config: MeasurementsConfig | None = None, job: Job | None = None
) -> Avatar:
    """Return the body that has the given measurements, in the bind pose.

    Levenberg-Marquardt on the shape parameters (Nocedal & Wright 2006, 10.3): given values are held, the others are
    drawn to their expectation under ANSUR II given these, the parameters to those of the mean body.

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
    _report_unlikely(population(sex), held, config, job)
    share = size_share(values.get("stature"), population(sex))
    build = build_of(sex, share)
    large, unsure_large, met = (resized(known, 1 / share) for known in (values, sigmas, held))
    expected = population(build).given(large, unsure_large)
    if share < 1.0:
        growth, unsure_growth = childs_growth(expected, large["stature"], share)
        expected = population(build).given({**growth, **large}, {**unsure_growth, **unsure_large})
        if not any(name == "mass" or name.endswith("girth") for name in values):
            met["mass"] = growth["mass"]  # nothing else says how lean it is, and the mean body is an adult's
    space = shape_space(SEX_SHARE[build])
    parameters = solve_shape(space, met, expected, config, job, mean_parameters(build, config))
    spread = np.sqrt(np.diag(expected.covariance).clip(0.0)).tolist()
    unsure = {name: s for name, s in zip(expected.names, spread, strict=True) if name not in held}
    body = replace(_smaller(space.avatar(parameters), share), sex=SEX_SHARE[sex], sigmas=resized(unsure, share))
    _report_errors(body, held, config, job)
    _report_folds(space, body, job)
    return body


def _smaller(body: Avatar, share: float) -> Avatar:
    """Return a body in the bind pose, so many times as large."""
    vertices = share * body.bind_vertices
    return replace(body, bind_vertices=vertices, vertices=vertices, joints=share * body.joints)


@lru_cache(maxsize=4)
def mean_parameters(sex: str, config: MeasurementsConfig) -> FloatArray:
    """Return the parameters of the population's mean, to which those of a person are drawn.

    The template has them all but for a few millimetres and kilograms, and these would show in what is not measured.
    """
    prior, space = population(sex), shape_space(SEX_SHARE[sex])
    held = {name: float(prior.mean[prior.names.index(name)]) for name in ("stature", "mass")}
    return solve_shape(space, held, prior.given(held, {}), config, Job(), np.zeros(len(space.names)))


def solve_shape(
    space: ShapeSpace,
    held: dict[str, float],
    expected: Population,
    config: MeasurementsConfig,
    job: Job,
    mean: FloatArray,
) -> FloatArray:
    """Return the shape's parameters by Levenberg-Marquardt, shape (P,); see `fit_measurements`.

    Args:
        space: The shape space.
        held: Measurements to be met [m, kg].
        expected: The others.
        config: Settings.
        job: For progress.
        mean: Parameters of the usual body, shape (P,).
    """
    tape = Tape(space.base)
    free = [k for k, name in enumerate(expected.names) if name not in held]
    names = [*held, *(expected.names[k] for k in free)]
    target = np.array([*held.values(), *expected.mean[free]])
    spread = expected.covariance[np.ix_(free, free)]
    floor = np.diag(0.02 * np.diag(spread) + 1e-8)
    weight = np.zeros((len(names), len(names)))
    weight[: len(held), : len(held)] = np.diag([1 / (_HOLD_KG if name == "mass" else _HOLD_M) for name in held])
    weight[len(held) :, len(held) :] = config.expected_weight * np.linalg.inv(np.linalg.cholesky(spread + floor))
    if "mass" not in held:
        k = expected.names.index("mass")
        heavier = (np.array(names) == "mass") * _MASS_WEIGHT / np.sqrt(expected.covariance[k, k])
        weight = np.concatenate([weight, heavier[None]])
    read = [DEFINITIONS[name] for name in names]
    held_back = space.whitener.T @ space.whitener

    def residual(parameters: FloatArray) -> tuple[FloatArray, list[Reading]]:
        vertices = space.vertices(parameters)
        readings = [tape.read(what, vertices) for what in read]
        wrong = np.array([reading.value for reading in readings]) - target
        return np.concatenate([weight @ wrong, space.whitener @ (parameters - mean)]), readings

    parameters, damping = mean, _DAMPING
    wrong, readings = residual(parameters)
    for step in range(config.iterations):
        slope = np.concatenate([weight @ [reading.by_parameters(space.fields) for reading in readings], space.whitener])
        normal, descent = slope.T @ slope, -slope.T @ wrong
        # a taut tape jumps from one bump to the next: a full step may overshoot
        for _ in range(_TRIES):
            move = np.linalg.solve(normal + damping * held_back, descent)
            tried, seen = residual(parameters + move)
            if tried @ tried < wrong @ wrong:
                break
            damping *= 10
        else:
            break
        gain = 1 - np.sqrt(tried @ tried / (wrong @ wrong))
        parameters, wrong, readings, damping = parameters + move, tried, seen, damping / 10
        job.progress((step + 1) / config.iterations, f"fit to {len(held)} measurements, step {step + 1}")
        if gain < _SETTLED:
            break
    return parameters


def _report_unlikely(prior: Population, held: dict[str, float], config: MeasurementsConfig, job: Job) -> None:
    away = prior.distance(held, {})
    # of n unit normals, the length is close to the root of n
    if away > np.sqrt(len(held)) + config.unlikely_sigmas:
        job.warn(
            f"no surveyed person has such a body ({away:.1f} standard deviations from the mean). "
            "Values that were not measured are guesses; see their uncertainties."
        )
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
                f"{others.mean[k] * scale:.1f} {unit} that the other measurements predict"
            )


def _report_errors(body: Avatar, held: dict[str, float], config: MeasurementsConfig, job: Job) -> None:
    if not np.isfinite(body.vertices).all():
        raise AvatarError("no body has these measurements: the fit diverged", hint="check the units")
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
            job.warn(
                f"{name}: asked for {value * 100:.1f} cm, reached {(value + error) * 100:.1f} cm "
                f"({error * 100:+.1f} cm): it contradicts the others"
            )
    job.measure(worst_error_mm=round(float(worst), 3))


def _report_folds(space: ShapeSpace, body: Avatar, job: Job) -> None:
    """Say where the asked lengths leave no room for the body between them."""
    turned = (face_area_vectors(space.base.mesh) * face_area_vectors(body.mesh)).sum(axis=1) < 0
    if turned.any():
        middle = space.base.vertices[body.faces[turned]].mean(axis=(0, 1))
        near = {name: np.linalg.norm(space.base.vertices[at] - middle) for name, at in body.landmarks.items()}
        job.warn(
            f"the surface folds over itself in {turned.sum()} faces near the {min(near, key=lambda n: near[n])}: "
            "the measurements contradict each other there"
        )
