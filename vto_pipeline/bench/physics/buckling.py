"""Buckling: the weight or tip load at which a strip on edge, clamped at one end, falls sideways."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from vto_pipeline.bench.bench import Row, Watch
from vto_pipeline.bench.physics.cantilever import DENSITY, LENGTH, MESHES, ClampedStrip, clamped_strip
from vto_pipeline.bench.physics.closed_forms import lateral_buckling, lateral_buckling_at_tip, upright_strip
from vto_pipeline.bench.physics.refinement import RefinementCase, refined
from vto_pipeline.cloth.implicit_step.stiffness import Stiffness
from vto_pipeline.cloth.rest.equilibrium import EquilibriumConfig, equilibrium
from vto_pipeline.cloth.swatch.meshes import MeshKind
from vto_pipeline.numerics.linear.direct import DirectSolver

_RIGIDITY = 1e-5  # [N·m]
_STIFFNESS = 1e5  # membrane [N/m], so that the strip hardly bends in its plane before it falls
_ACROSS = 4  # edges across a strip on edge: the closed form is that of a thin one, so it gets thinner as they shrink
_HALVINGS = 12


def buckling_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """Lateral buckling under weight and under a load at the tip, and the fall of an upright strip."""
    scenes = {
        "lateral buckling, weight": (lateral_buckling(), ("shape_operator", "hinge")),
        "lateral buckling, tip": (lateral_buckling_at_tip(), ("shape_operator",)),
        "upright strip": (upright_strip(), ("shape_operator",)),
    }
    for scene, (exact, models) in scenes.items():
        for bending in models:
            for kind in MESHES:
                finest = 2 if quick else 4
                counts = ((5, 10, 20, 40) if scene == "upright strip" else (20, 40, 80, 160))[:finest]
                make = partial(_case, scene, exact, bending, kind)
                yield from refined(watch, scene, bending, {"mesh": kind}, "edges", counts, make)


def _case(scene: str, exact: float, bending: str, kind: MeshKind, edges: int) -> RefinementCase:
    upright = scene == "upright strip"
    width = LENGTH * (0.2 if upright else _ACROSS / edges)
    one = clamped_strip(
        bending, kind, edges, _RIGIDITY, width=width, stiffness=_STIFFNESS, on_edge=not upright, gravity=0.0
    )

    def run() -> dict[str, float]:
        found = critical_load(one, scene, exact)
        return {"critical_share": abs(found / exact - 1.0), "critical": found}

    return RefinementCase(len(one.flat), run)


def critical_load(one: ClampedStrip, scene: str, expected: float) -> float:
    """Return the load, w L³ / B or P L² / (B b), at which the exact stiffness loses its first positive eigenvalue.

    At each load the strip is first brought to rest in its own plane, where nothing pushes it sideways; it is stable
    there if its stiffness can be factored after Cholesky. Halving between half and double the expected load.
    """
    stiffness = Stiffness(one.model)
    low, high = 0.5 * expected, 2.0 * expected
    if _unstable(one, stiffness, scene, low) or not _unstable(one, stiffness, scene, high):
        return float("nan")
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _unstable(one, stiffness, scene, middle) else (middle, high)
    return 0.5 * (low + high)


def _unstable(one: ClampedStrip, stiffness: Stiffness, scene: str, load: float) -> bool:
    forces = np.zeros_like(one.flat)
    model = one.model
    if scene == "lateral buckling, tip":
        width = float(np.ptp(one.flat[one.tip, 1]))
        share = model.mass[one.tip] / model.mass[one.tip].sum()
        forces[one.tip, 1] = -load * one.rigidity * width / LENGTH**2 * share
    else:
        pull = load * one.rigidity / (DENSITY * LENGTH**3)
        model = replace(model, gravity=np.array([-pull, 0.0, 0.0] if scene == "upright strip" else [0.0, -pull, 0.0]))
    rest = equilibrium(model, one.flat, EquilibriumConfig(exact_below=0.0, tolerance=1e-6), load=forces).positions
    return not DirectSolver(stiffness.matrix).factorise(stiffness.assemble_exact(rest).blocks)
