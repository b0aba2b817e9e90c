"""Known people in loose shirts and trousers: error of the body inside, and coverage of its intervals."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.avatar.from_scan import ScanConfig, fit_scan
from vto_pipeline.avatar.measure import measure
from vto_pipeline.avatar.measuring.population import population
from vto_pipeline.bench.bench import Measured, Row, Watch
from vto_pipeline.bench.body.people import first_hits, random_measurements
from vto_pipeline.bench.samples.garments.top import make_shirt
from vto_pipeline.bench.samples.garments.trousers import make_trousers
from vto_pipeline.bench.samples.garments.wearer import Wearer
from vto_pipeline.bench.timing import Timing, clocked
from vto_pipeline.geometry.topology import concatenate, submesh
from vto_pipeline.model.body import Avatar, Measurements
from vto_pipeline.model.mesh import TriangleMesh

GIRTHS = ("chest", "waist", "navel", "hip", "thigh", "neck", "upper_arm", "forearm", "wrist", "calf", "ankle")
_EASES_M = (0.010, 0.035)
"""Of the shirt, in radius."""
_SEEDS = {"female": (100, 102, 104, 106), "male": (101, 103, 105, 107)}
"""One after the other, so that nobody is picked."""
_AWAY_M, _TURNS, _HEIGHTS_M = 2.2, 16, (0.3, 0.9, 1.5, 2.2)


def clothed_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """Random people of either sex."""
    for sex in ("female",) if quick else ("female", "male"):
        seeds = _SEEDS[sex][:1] if quick else _SEEDS[sex]
        yield watch.row(
            f"{sex}, dressed",
            "scan of clothes",
            {"people": len(seeds)},
            len(random_wearer(sex, seeds[0]).vertices),
            lambda sex=sex, seeds=seeds: _people(sex, seeds),  # type: ignore[misc]
        )


def random_wearer(sex: str, seed: int) -> Avatar:
    """Return a random person, all girths as drawn, in the A-pose."""
    known = {
        k: v
        for k, v in random_measurements(sex, seed).values.items()
        if k.endswith("_girth") or k in ("stature", "inside_leg")
    }
    return fit_measurements(Measurements(known, sex=sex))


def visible_clothed_surface(body: Avatar, clearance: float) -> TriangleMesh:
    """Return what cameras all round see of a body in shirt and trousers.

    Args:
        body: Standing on y = 0 about the origin.
        clearance: Least gap between shirt and trunk [m].
    """
    wearer = Wearer(body)
    parts = [
        body.mesh,
        make_shirt(wearer, 14.0, clearance=clearance).mesh,
        make_trousers(wearer, 14.0, clearance=0.012).mesh,
    ]
    whole = concatenate(parts)
    return submesh(whole, _seen(whole))[0]


def _seen(mesh: TriangleMesh) -> NDArray[np.bool_]:
    """Whether a camera sees a face's middle, shape (F,)."""
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    turn, height = (g.ravel() for g in np.meshgrid(np.arange(_TURNS) * 2 * np.pi / _TURNS, _HEIGHTS_M, indexing="ij"))
    eyes = np.column_stack([_AWAY_M * np.sin(turn), height, _AWAY_M * np.cos(turn)])[:, None]
    ahead = middle - eyes
    hits = first_hits(mesh, np.concatenate([np.broadcast_to(eyes, ahead.shape), ahead], axis=2))
    # a ray reaches its face at 1; what comes before hides it
    return np.asarray((hits > 1 - 2e-3).any(axis=0))


def _people(sex: str, seeds: tuple[int, ...]) -> Measured:
    seconds, wrong, null, held = [], [], [], []
    names = [f"{row}_girth" for row in GIRTHS]
    for seed in seeds:
        body = random_wearer(sex, seed)
        scan = visible_clothed_surface(body, float(np.random.default_rng(seed).uniform(*_EASES_M)))
        fitted, taken = clocked(fit_scan, scan, ScanConfig.model_validate({"sex": sex, "clothed": True}))
        seconds.append(taken)
        read = measure(fitted)
        true = measure(body).values
        people = population(sex).given({"stature": true["stature"]}, {})
        away = np.array([read.values[name] - true[name] for name in names])
        wrong.append(np.abs(away))
        null.append([abs(people.mean[people.names.index(name)] - true[name]) for name in names])
        held.append(np.abs(away) <= 1.96 * np.array([read.sigmas[name] for name in names]))
    mae, by_stature = 1e3 * np.mean(wrong, axis=0), 1e3 * np.mean(null, axis=0)
    return Timing(float(np.median(seconds)), len(seeds)), {
        **{f"{name}_mae_mm": float(value) for name, value in zip(names, mae, strict=True)},
        **{f"{name}_by_stature_mm": float(value) for name, value in zip(names, by_stature, strict=True)},
        "inside_interval_share": float(np.mean(held)),
    }
