"""Girths from a front and a side picture: error and interval, compared with stature alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.avatar.from_silhouettes import SilhouettesConfig, fit_silhouettes
from vto_pipeline.avatar.measure import measure
from vto_pipeline.avatar.measuring.population import complete_measurements
from vto_pipeline.avatar.measuring.tape import mass_reading
from vto_pipeline.avatar.model.pose import named_pose, pose_avatar
from vto_pipeline.avatar.template.template import JOINT_KINDS
from vto_pipeline.bench.bench import Measured, Row, Watch
from vto_pipeline.bench.body.people import first_hits, random_measurements
from vto_pipeline.bench.samples.customer import make_customer, measure_truth
from vto_pipeline.bench.timing import Timing, clocked
from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.model.arrays import ByteArray
from vto_pipeline.model.body import Measurements
from vto_pipeline.model.frames import Silhouettes
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

GIRTHS = ("chest_girth", "waist_girth", "hip_girth")
_HEIGHT, _WIDTH = 800, 800
_LENS_M, _LENSES_M = 1.0, (0.8, 1.5)
"""Height of the lens where nothing else is said; between these for random people."""
_BACKDROP, _BODY, _NOISE = 205.0, 95.0, 4.0
_HELD_OUT = 9000
"""First of the seeds that nothing else uses."""
_BUMPS, _BUMP_M, _BUMP_HEIGHT_M = 40, (0.04, 0.12), 0.003
_LOOSE_RAD = {
    "spine": 0.02,
    "chest": 0.02,
    "neck": 0.06,
    "head": 0.06,
    "clavicle": 0.04,
    "shoulder": 0.10,
    "elbow": 0.15,
    "hip": 0.03,
    "knee": 0.03,
}


@dataclass(frozen=True)
class Person:
    """Who is photographed.

    Args:
        sex: "female" or "male".
        body: Standing on y = 0 about the origin.
        distance: Of the camera [m].
        lens: Height of the camera [m].
        true: Stature and girths [m], mass [kg].
    """

    sex: str
    body: TriangleMesh
    distance: float
    lens: float
    true: dict[str, float]


def silhouette_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """A body of another model, and random people of either sex, before a plain backdrop.

    The people have all that was drawn for them, bumps that no parameter makes, and stances of their own; yet they are
    bodies of our own kind, and drawn from the statistics that the fit has.
    """
    yield _row(watch, "another model's body", 1, lambda k: _foreign())
    for sex in ("female",) if quick else ("female", "male"):
        yield _row(watch, f"{sex}, two outlines", 1 if quick else 10, lambda k, sex=sex: _someone(sex, _HELD_OUT + k))  # type: ignore[misc]


def _row(watch: Watch, scene: str, count: int, someone: Callable[[int], Person]) -> Row:
    return watch.row(
        scene, "silhouettes", {"people": count}, _HEIGHT * _WIDTH, lambda: _people([someone(k) for k in range(count)])
    )


def _foreign() -> Person:
    body = make_customer()
    truth = measure_truth(body).values
    tall = float(np.ptp(body.vertices[:, 1]))
    girths = {"chest_girth": truth["bust_girth"], "waist_girth": truth["waist_girth"], "hip_girth": truth["hip_girth"]}
    mass = mass_reading(body.vertices, body.faces).value
    return Person("female", body, 2.5, _LENS_M, girths | {"stature": tall, "mass": mass})


def _someone(sex: str, seed: int) -> Person:
    """Return a person with everything drawn, in an A-pose of their own, 3 mm of bumps on the skin."""
    known = {name: value for name, value in random_measurements(sex, seed).values.items() if name != "mass"}
    body, rng = fit_measurements(Measurements(known, sex=sex)), np.random.default_rng(seed)
    skin = body.bind_vertices
    away = np.linalg.norm(skin[:, None] - skin[rng.choice(len(skin), _BUMPS, replace=False)], axis=2)
    height = (np.exp(-((away / rng.uniform(*_BUMP_M, _BUMPS)) ** 2)) * rng.normal(0.0, _BUMP_HEIGHT_M, _BUMPS)).sum(1)
    body = replace(body, bind_vertices=skin + height[:, None] * vertex_normals(TriangleMesh(skin, body.faces)))
    loose = [_LOOSE_RAD.get(kind, 0.0) for kind in JOINT_KINDS]
    turns = named_pose(body, "a_pose").pose + rng.normal(0.0, 1.0, (len(loose), 3)) * np.array(loose)[:, None]
    mesh = pose_avatar(body, turns, np.zeros(3)).mesh
    floor = np.array([0.0, mesh.vertices[:, 1].min(), 0.0])
    distance, lens = 2.5 * float(rng.uniform(0.94, 1.06)), float(rng.uniform(*_LENSES_M))
    return Person(sex, TriangleMesh(mesh.vertices - floor, mesh.faces), distance, lens, dict(measure(body).values))


def photograph(body: TriangleMesh, yaw: float, distance: float, seed: int, lens: float = _LENS_M) -> ByteArray:
    """Return a grey picture through a level pinhole, shape (H, W, 3).

    Args:
        body: Standing on y = 0 about the origin.
        yaw: How far it has turned from facing the camera [rad].
        distance: Of the camera from its axis [m].
        seed: Of the noise.
        lens: Height of the pinhole [m].
    """
    cos, sin = np.cos(yaw), np.sin(yaw)
    turned = body.vertices @ np.array([[cos, 0.0, -sin], [0.0, 1.0, 0.0], [sin, 0.0, cos]])
    stature = float(np.ptp(body.vertices[:, 1]))
    focal = 0.85 * _HEIGHT * (distance - 0.2) / stature
    column, row = np.meshgrid(np.arange(_WIDTH) + 0.5, np.arange(_HEIGHT) + 0.5)
    up = (0.5 * _HEIGHT - row) / focal + (0.5 * stature - lens) / distance
    across = (column - 0.5 * _WIDTH) / focal
    ahead = np.stack([across, up, -np.ones_like(up)], axis=2)
    eye = np.broadcast_to([0.0, lens, distance], ahead.shape)
    hit = np.isfinite(first_hits(TriangleMesh(turned, body.faces), np.concatenate([eye, ahead], axis=2)))
    grey = np.where(hit, _BODY, _BACKDROP)[:, :, None] + np.random.default_rng(seed).normal(
        0.0, _NOISE, (_HEIGHT, _WIDTH, 3)
    )
    return np.clip(grey, 0, 255).astype(np.uint8)


def _people(people: list[Person]) -> Measured:
    seconds, wrong, null, held = [], [], [], []
    for k, one in enumerate(people):
        job, config = Job(), SilhouettesConfig.model_validate({"sex": one.sex})
        front, side = (photograph(one.body, yaw, one.distance, k, one.lens) for yaw in (0.0, np.pi / 2))
        names = Silhouettes(Path("front"), Path("side"), one.true["stature"])
        seconds.append(clocked(fit_silhouettes, names, front, side, config, job)[1])
        guess = complete_measurements(
            Measurements({name: one.true[name] for name in ("stature", "mass")}, sex=one.sex)
        ).values
        read = [float(str(job.metrics[f"{name}_m"])) - one.true[name] for name in GIRTHS]
        half = [float(str(job.metrics[f"{name}_interval_mm"])) * 1e-3 for name in GIRTHS]
        wrong.append(read)
        null.append([abs(guess[name] - one.true[name]) for name in GIRTHS])
        held.append([abs(away) <= reach for away, reach in zip(read, half, strict=True)])
    mae, bias = 1e3 * np.abs(wrong).mean(axis=0), 1e3 * np.mean(wrong, axis=0)
    by_weight = 1e3 * np.mean(null, axis=0)
    return Timing(float(np.median(seconds)), len(people)), {
        **{f"{name}_mae_mm": float(value) for name, value in zip(GIRTHS, mae, strict=True)},
        **{f"{name}_bias_mm": float(value) for name, value in zip(GIRTHS, bias, strict=True)},
        **{f"{name}_by_weight_mm": float(value) for name, value in zip(GIRTHS, by_weight, strict=True)},
        "inside_interval_share": float(np.mean(held)),
    }
