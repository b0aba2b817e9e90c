"""People who are known, in loose shirts and trousers: how near the body inside is found, and whether intervals hold."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.avatar.from_scan import ScanConfig, fit_scan
from vto_pipeline.avatar.measure import measure
from vto_pipeline.avatar.population import population
from vto_pipeline.bench.bench import Measured, Row, Watch
from vto_pipeline.bench.body.people import drawn
from vto_pipeline.bench.samples.top import make_shirt
from vto_pipeline.bench.samples.trousers import make_trousers
from vto_pipeline.bench.samples.wearer import Wearer
from vto_pipeline.bench.timing import Timing
from vto_pipeline.geometry.topology import submesh
from vto_pipeline.model.body import Avatar, Measurements
from vto_pipeline.model.mesh import TriangleMesh

GIRTHS = ("chest", "waist", "navel", "hip", "thigh", "neck", "upper_arm", "forearm", "wrist", "calf", "ankle")
_EASES_M = (0.010, 0.035)
"""Of the shirt, in radius."""
_SEEDS = {"female": (100, 102, 104, 106), "male": (101, 103, 107, 109)}
_AWAY_M, _TURNS, _HEIGHTS_M = 2.2, 16, (0.3, 0.9, 1.5, 2.2)


def clothed_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """Random people of either sex."""
    for sex in ("female",) if quick else ("female", "male"):
        seeds = _SEEDS[sex][:1] if quick else _SEEDS[sex]
        yield watch.row(
            f"{sex}, dressed",
            "scan of clothes",
            {"people": len(seeds)},
            len(someone(sex, seeds[0]).vertices),
            lambda sex=sex, seeds=seeds: _people(sex, seeds),  # type: ignore[misc]
        )


def someone(sex: str, seed: int) -> Avatar:
    """Return a random person, all girths as drawn, in the A-pose."""
    known = {k: v for k, v in drawn(sex, seed).values.items() if k.endswith("_girth") or k in ("stature", "inside_leg")}
    return fit_measurements(Measurements(known, sex=sex))


def dressed(body: Avatar, ease: float) -> TriangleMesh:
    """Return what cameras all round see of a body in shirt and trousers.

    Args:
        body: Standing on y = 0 about the origin.
        ease: Least gap between shirt and trunk [m].
    """
    wearer = Wearer(body)
    parts = [body.mesh, make_shirt(wearer, 14.0, ease=ease).mesh, make_trousers(wearer, 14.0, ease=0.012).mesh]
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=False)])
    whole = TriangleMesh(np.concatenate([part.vertices for part in parts]), faces.astype(np.int32))
    return submesh(whole, _seen(whole))[0]


def _seen(mesh: TriangleMesh) -> NDArray[np.bool_]:
    """Whether a camera sees a face's middle, shape (F,)."""
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor.from_numpy(mesh.vertices.astype(np.float32)),
        o3d.core.Tensor.from_numpy(mesh.faces.astype(np.uint32)),
    )
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    seen = np.zeros(len(middle), dtype=bool)
    for turn in np.arange(_TURNS) * 2 * np.pi / _TURNS:
        for height in _HEIGHTS_M:
            eye = np.array([_AWAY_M * np.sin(turn), height, _AWAY_M * np.cos(turn)])
            rays = np.concatenate([np.broadcast_to(eye, middle.shape), middle - eye], axis=1).astype(np.float32)
            # a ray reaches its face at 1; what comes before hides it
            seen |= scene.cast_rays(o3d.core.Tensor.from_numpy(rays))["t_hit"].numpy() > 1 - 2e-3
    return seen


def _people(sex: str, seeds: tuple[int, ...]) -> Measured:
    seconds, wrong, null, held = [], [], [], []
    names = [f"{row}_girth" for row in GIRTHS]
    for seed in seeds:
        body = someone(sex, seed)
        scan = dressed(body, float(np.random.default_rng(seed).uniform(*_EASES_M)))
        began = time.perf_counter()
        read = measure(fit_scan(scan, ScanConfig.model_validate({"sex": sex, "clothed": True})))
        seconds.append(time.perf_counter() - began)
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
