"""Small vibrations: the generalised eigenproblem of exact stiffness and mass at equilibrium, against closed forms."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import eigsh

from vto_pipeline.bench.bench import Row, Watch
from vto_pipeline.bench.physics.cantilever import (
    DENSITY,
    LENGTH,
    MESHES,
    ClampedStrip,
    MeshKind,
    clamped_strip,
    refinements,
)
from vto_pipeline.bench.physics.closed_forms import cantilever_modes, hanging_sheet_modes
from vto_pipeline.bench.physics.refinement import RefinementCase, refined
from vto_pipeline.cloth.collision.contacts import empty_contacts
from vto_pipeline.cloth.implicit_step.stiffness import Stiffness
from vto_pipeline.cloth.integrators import INTEGRATORS
from vto_pipeline.cloth.model.build import ClothModel, ClothState, build_cloth
from vto_pipeline.cloth.model.materials import Materials
from vto_pipeline.cloth.model.settings import checked
from vto_pipeline.cloth.rest.equilibrium import EquilibriumConfig, equilibrium
from vto_pipeline.cloth.swatch.meshes import strip
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.linear.block_matrix import to_scipy
from vto_pipeline.units import GRAVITY

_RIGIDITY = 1e-5  # [N·m]
_MODES = 3
_SHEET = 0.5  # length of the hanging sheet [m]
_POWERS = 8  # of the length, that the shape of a hanging sheet is made of


def mode_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """The first three modes of a clamped strip and of a hanging sheet, and one of the strip's in motion."""
    for bending in ("shape_operator", "hinge"):
        for kind in MESHES:
            make = partial(_clamped, bending, kind)
            yield from refined(watch, "cantilever modes", bending, {"mesh": kind}, "edges", refinements(quick), make)
    counts: tuple[int, ...] = (8, 16, 32, 64) if quick else (10, 20, 40, 80)
    for kind in MESHES:
        yield from refined(watch, "hanging sheet modes", "none", {"mesh": kind}, "edges", counts, partial(_hung, kind))
    counts = (5, 10) if quick else (5, 10, 20)
    yield from refined(watch, "cantilever in motion", "shape_operator", {"mesh": "irregular"}, "edges", counts, _moving)


def _clamped(bending: str, kind: MeshKind, edges: int) -> RefinementCase:
    one = clamped_strip(bending, kind, edges, _RIGIDITY, gravity=0.0)
    scale = LENGTH**2 * np.sqrt(DENSITY / _RIGIDITY)
    return RefinementCase(
        len(one.flat), lambda: _mode_errors(scale * bending_frequencies(one.model, one.flat), cantilever_modes)
    )


def _mode_errors(found: FloatArray, exact: Callable[[int], FloatArray]) -> dict[str, float]:
    shares = np.abs(found / exact(_MODES) - 1.0)
    return {f"mode_{i + 1}_share": float(share) for i, share in enumerate(shares)}


def _hung(kind: MeshKind, edges: int) -> RefinementCase:
    """A sheet that hangs from its top edge and does not bend, y = 0 at the top."""
    points, faces = strip(kind, 0.0, _SHEET, 0.2 * _SHEET, _SHEET / edges)
    flat = np.column_stack([points[:, 1], -points[:, 0], np.zeros(len(points))])
    held = np.flatnonzero(flat[:, 1] > -1e-9)
    fabric = Fabric("sheet", DENSITY, 1e-4, 1e5, 1e5, 5e4, 0.0, 0.0, 0.0, 0.0, 0.3)
    model = build_cloth(
        TriangleMesh(flat, faces),
        RestShape(flat),
        fabric,
        pinned=held,
        materials=checked(Materials, {"bending": "none"}),
    )
    scale = np.sqrt(_SHEET / GRAVITY)
    return RefinementCase(
        len(flat), lambda: _mode_errors(scale * hanging_frequencies(model, flat), hanging_sheet_modes)
    )


def bending_frequencies(model: ClothModel, flat: FloatArray) -> FloatArray:
    """Return ω of the modes that move across the sheet and do not twist it, lowest first [1/s]."""
    free, stiffness, mass = _free_system(model, flat)
    squares, shapes = eigsh(stiffness, 4 * _MODES, diags_array(mass), sigma=0.0)
    order = np.argsort(squares)
    across = np.zeros((len(free), 3))
    across[:, 1] = 1.0
    taking_part = (shapes.T @ (mass * across.ravel())) ** 2 / mass.sum()
    kept = [i for i in order if taking_part[i] > 1e-3]
    return np.sqrt(squares[kept[:_MODES]])


def hanging_frequencies(model: ClothModel, flat: FloatArray) -> FloatArray:
    """Return ω of a hanging sheet's motions out of its plane that are the same over its width [1/s].

    Rayleigh and Ritz: without bending, strips side by side swing each for itself, so the modes are sought among
    polynomials of the length, at rest under the sheet's weight.
    """
    x = equilibrium(model, flat, EquilibriumConfig(exact_below=0.0, tolerance=1e-7)).positions
    free, stiffness, mass = _free_system(model, x)
    down = -flat[free, 1] / _SHEET
    trial = np.zeros((len(free), 3, _POWERS))
    trial[:, 2] = np.polynomial.chebyshev.chebvander(2.0 * down - 1.0, _POWERS - 1) * down[:, None]
    basis = trial.reshape(-1, _POWERS)
    squares = eigh(basis.T @ (stiffness @ basis), basis.T @ (mass[:, None] * basis), eigvals_only=True)
    return np.sqrt(squares[:_MODES])


def _free_system(model: ClothModel, x: FloatArray) -> tuple[NDArray[np.int64], csc_array, FloatArray]:
    """Return the free vertices, and over their coordinates the exact stiffness at x [N/m] and the masses [kg]."""
    free = np.flatnonzero(model.inverse_mass > 0.0)
    rows = (3 * free[:, None] + np.arange(3)).ravel()
    matrix = to_scipy(Stiffness(model).assemble_exact(x)).tocsr()[rows][:, rows]
    return free, csc_array(0.5 * (matrix + matrix.T)), np.repeat(model.mass[free], 3)


def _moving(edges: int) -> RefinementCase:
    """The strip's first mode once more, by watching it swing."""
    one = clamped_strip("shape_operator", "irregular", edges, _RIGIDITY, gravity=0.0)
    exact = float(cantilever_modes(1)[0] * np.sqrt(_RIGIDITY / DENSITY) / LENGTH**2)
    return RefinementCase(len(one.flat), lambda: {"mode_1_share": abs(swing_frequency(one, 60) / exact - 1.0)})


def swing_frequency(one: ClampedStrip, steps: int) -> float:
    """Return ω of the slowest swing of a weightless strip that was pushed [1/s], with this many steps a swing.

    Fitted to the height of the tip, on which fast modes ride that average out. Implicit midpoint swings at
    (2/h) atan(ω h / 2), which is turned back.
    """
    expected = cantilever_modes(1)[0] * np.sqrt(one.rigidity / DENSITY) / LENGTH**2
    h = 2.0 * np.pi / expected / steps
    along = np.clip(one.flat[:, 0] / LENGTH, 0.0, 1.0)
    velocities = np.zeros_like(one.flat)
    velocities[:, 1] = 1e-3 * LENGTH * expected * along**2 * (1.0 - along * (2.0 / 3.0 - along / 6.0))
    method = INTEGRATORS["implicit_midpoint"](one.model)
    state = ClothState(one.flat.copy(), velocities)
    heights = [0.0]
    for _ in range(2 * steps):
        state = method.advance(state, empty_contacts(len(one.flat)), h, 1)
        heights.append(float(state.positions[one.tip, 1].mean()))
    t, y = h * np.arange(len(heights)), np.array(heights)
    best = min(np.linspace(0.9, 1.1, 401), key=lambda share: _left_over(share * expected, t, y))
    found = float(best * expected)
    return 2.0 / h * float(np.tan(0.5 * found * h))


def _left_over(omega: float, t: FloatArray, y: FloatArray) -> float:
    basis = np.column_stack([np.sin(omega * t), np.cos(omega * t)])
    return float(np.linalg.norm(y - basis @ np.linalg.lstsq(basis, y, rcond=None)[0]))
