"""A strip clamped at one end: under its own weight and under a load at its tip, for every bending model."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.bench.bench import Row, Watch
from vto_pipeline.bench.physics.elastica import Elastica, cantilever
from vto_pipeline.bench.physics.refinement import RefinementCase, refined
from vto_pipeline.cloth.model.build import ClothModel, build_cloth
from vto_pipeline.cloth.model.materials import Materials
from vto_pipeline.cloth.model.settings import checked
from vto_pipeline.cloth.rest.equilibrium import Equilibrium, equilibrium
from vto_pipeline.cloth.swatch.meshes import MeshKind, strip
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.units import GRAVITY

BENDING = ("shape_operator", "hinge", "isometric", "springs")
"""Models of bending, the one that claims to converge first."""

MESHES: tuple[MeshKind, ...] = ("grid", "irregular")

LENGTH = 0.04  # [m]
WIDTH = 0.2 * LENGTH
DENSITY = 0.15  # [kg/m²]
STIFFNESS = 1000.0  # membrane [N/m]


@dataclass(frozen=True)
class ClampedStrip:
    """A flat strip, clamped where x ≤ 0.

    Args:
        model: The cloth.
        flat: Its rest positions [m], shape (V, 3).
        tip: Vertices at the free end.
        rigidity: B [N·m].
    """

    model: ClothModel
    flat: FloatArray
    tip: NDArray[np.int64]
    rigidity: float


def clamped_strip(
    bending: str,
    kind: MeshKind,
    edges: int,
    rigidity: float,
    *,
    width: float = WIDTH,
    stiffness: float = STIFFNESS,
    on_edge: bool = False,
    gravity: float = GRAVITY,
    seed: int = 0,
) -> ClampedStrip:
    """Return a strip with this many edges from clamp to tip, and two more in the clamp.

    Args:
        bending: A model of bending of `Materials`.
        kind: Of mesh.
        edges: Along the free length.
        rigidity: B [N·m].
        width: [m].
        stiffness: Membrane stiffness [N/m].
        on_edge: Its width is plumb instead of level.
        gravity: [m/s²].
        seed: Of an irregular mesh.
    """
    edge = LENGTH / edges
    points, faces = strip(kind, -2.0 * edge, LENGTH, width, edge, seed)
    x, y, none = points[:, 0], points[:, 1], np.zeros(len(points))
    flat = np.column_stack([x, y, none] if on_edge else [x, none, -y])
    held = np.flatnonzero(x < 0.01 * edge)
    shear = 0.5 * stiffness  # no contraction across: an isotropic sheet with Poisson's ratio zero
    fabric = Fabric("strip", DENSITY, 1e-4, stiffness, stiffness, shear, 0.0, rigidity, rigidity, 0.0, 0.3)
    model = build_cloth(
        TriangleMesh(flat, faces),
        RestShape(flat),
        fabric,
        pinned=held,
        gravity=(0.0, -gravity, 0.0),
        materials=checked(Materials, {"bending": bending}),
    )
    return ClampedStrip(model, flat, np.flatnonzero(x > LENGTH - 0.01 * edge), rigidity)


def cantilever_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """Γ = 1, 8 and 50, and a tip load of PL²/B = 5."""
    weight = DENSITY * GRAVITY
    scenes = [(f"elastica {gamma:g}", gamma, 0.0, weight * LENGTH**3 / gamma) for gamma in (1.0, 8.0, 50.0)]
    for scene, gamma, tip, rigidity in [*scenes, ("tip load 5", 0.0, 5.0, 1e-5)]:
        exact = cantilever(gamma, tip)
        models = BENDING if not quick or scene == "elastica 8" else BENDING[:1]
        for bending in models:
            counts = (10, 20) if quick and bending != BENDING[0] else refinements(quick)
            for kind in MESHES:
                make = partial(_case, bending, kind, exact, GRAVITY if gamma > 0.0 else 0.0, tip, rigidity)
                yield from refined(watch, scene, bending, {"mesh": kind}, "edges", counts, make)


def refinements(quick: bool) -> tuple[int, ...]:
    """Return edges along the strip, from coarse to fine."""
    return (5, 10, 20, 40) if quick else (10, 20, 40, 80)


def _case(
    bending: str, kind: MeshKind, exact: Elastica, gravity: float, tip: float, rigidity: float, edges: int
) -> RefinementCase:
    one = clamped_strip(bending, kind, edges, rigidity, gravity=gravity)

    def run() -> dict[str, float]:
        load = np.zeros_like(one.flat)
        load[one.tip, 1] = -tip * rigidity / LENGTH**2 * WIDTH * _tip_shares(one)
        return strip_errors(one, equilibrium(one.model, one.flat, load=load), exact)

    return RefinementCase(len(one.flat), run)


def _tip_shares(one: ClampedStrip) -> FloatArray:
    """Return the share of the load that each vertex of the tip bears: half as much at the corners."""
    mass = one.model.mass[one.tip]
    across = one.flat[one.tip, 2]
    order = np.argsort(across)
    apart = np.diff(across[order])
    share = np.zeros(len(mass))
    share[order[:-1]] += 0.5 * apart
    share[order[1:]] += 0.5 * apart
    return np.asarray(share / share.sum())


def strip_errors(one: ClampedStrip, found: Equilibrium, exact: Elastica) -> dict[str, float]:
    """Return the errors of a strip at rest: of its whole shape in drops of its tip, and of drop and reach."""
    x = found.positions
    reach, drop = x[one.tip, 0].mean() / LENGTH, -x[one.tip, 1].mean() / LENGTH
    arc = np.clip(one.flat[:, 0] / LENGTH, 0.0, 1.0)
    there = np.column_stack([np.interp(arc, exact.arc, exact.reach), -np.interp(arc, exact.arc, exact.drop)])
    free = one.flat[:, 0] > 0.0
    away = np.linalg.norm(x[free, :2] / LENGTH - there[free], axis=1)
    profile = float(away.max() / exact.drop[-1])
    return {
        "profile_share": profile,
        "drop_share": float(abs(drop / exact.drop[-1] - 1.0)),
        "reach_share": float(abs(reach / exact.reach[-1] - 1.0)),
        "ratio_share": float(abs(drop / reach / (exact.drop[-1] / exact.reach[-1]) - 1.0)),
        "residual_share": found.residuals[-1],
        "iterations": float(found.iterations),
    }
