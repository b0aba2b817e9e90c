"""Every integrator at every step size: energy, phase and spin against closed forms, and a sheet that swings.

* `oscillator`: one mass on a linear spring. Its characteristic root is measured: energy_ratio per period is 1 where
  nothing is gained or lost, phase_error_deg is per period, root_error is the distance to the closed form.
* `dumbbell`: two masses that turn once a second about each other on a spring of 1e4 N/m. spin_error is the change of
  angular momentum, an invariant, as a share; root_error the distance to what the method keeps of it in closed form,
  where there is one.
* `sheet`: cloth hung by one edge falls from the horizontal, without damping. energy_drift is the change of mechanical
  energy as a share of m g L; distance_mm to the same motion in small steps of fourth order.

A method beyond its limit of stability is "diverged" there; explicit Euler always is, in the end.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from vto_pipeline.bench.bench import Measured, Row, Value, Watch
from vto_pipeline.bench.cloth.closed_forms import ROOTS, implicit_dumbbell
from vto_pipeline.bench.cloth.scenes import SIDE, grid, isotropic_sheet
from vto_pipeline.bench.timing import timed
from vto_pipeline.cloth.collision.contacts import empty_contacts
from vto_pipeline.cloth.constraints.points.spring import springs
from vto_pipeline.cloth.integrators import INTEGRATORS
from vto_pipeline.cloth.integrators.system import ForceSystem
from vto_pipeline.cloth.model.build import ClothModel, ClothState, at_rest, build_cloth, model_of
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.units import GRAVITY

KEEP_SPIN = ("symplectic_euler", "verlet", "leapfrog", "implicit_midpoint")
IMPLICIT_EULER = ("backward_euler_newton", "ncg")
SETTLED = 40
"""Steps after which the second root of a two-step method has died out."""

_EXACT = 1e-13  # tolerance where a closed form is checked
_TURN = 2.0 * np.pi  # [rad/s]
_SOFT = 100.0  # [N/m], so that explicit methods have their place


def rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """Measure every integrator at every step size."""
    seconds = 1.0 if quick else 10.0
    swing = Swing(5, 0.2) if quick else Swing(9, 0.5)
    for name in INTEGRATORS:
        for h_omega in (0.1, 0.5, 1.9, 5.0) if quick else (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 1.5, 1.9, 2.5, 5.0, 10.0):
            yield watch.row("oscillator", name, {"h_omega": h_omega}, 2, partial(_oscillator, name, h_omega))
        for steps in (240, 1000) if quick else (60, 120, 240, 500, 1000, 2000):
            settings: dict[str, Value] = {"h": 1.0 / steps, "simulated_s": seconds}
            yield watch.row("dumbbell", name, settings, 2, partial(_dumbbell, name, 1.0 / steps, seconds))
        for steps in (50, 1000, 5000) if quick else (60, 120, 250, 500, 1000, 2000, 4000, 8000):
            settings = {"h": 1.0 / steps, "simulated_s": swing.seconds}
            yield watch.row("sheet", name, settings, len(swing.start), partial(_sheet, name, swing, 1.0 / steps))


def oscillator(omega: float, *, mass: float = 1.0, damping: float = 0.0) -> ClothModel:
    """Return a mass on a spring whose other end is held at the origin; without rest length it is linear in space.

    Args:
        omega: Its frequency [1/s].
        mass: [kg].
        damping: Rayleigh's β [s].
    """
    ends = np.array([[0.0, 0, 0], [1, 0, 0]])
    spring = springs([[0, 1]], ends, 1.0 / (mass * omega**2), rest=0.0, damping=damping)
    return model_of((spring,), np.array([1.0, mass]), pinned=[0], gravity=(0.0, 0.0, 0.0))


def dumbbell(stiffness: float = 1e4) -> tuple[ClothModel, ClothState]:
    """Return two masses of 1 kg on a spring of 1 m, turning about each other at the length where it bears them."""
    length = 1.0 / (1.0 - _TURN**2 / (2.0 * stiffness))
    at = np.array([[-0.5 * length, 0, 0], [0.5 * length, 0, 0]])
    model = model_of((springs([[0, 1]], at, 1.0 / stiffness, rest=1.0),), np.ones(2), gravity=(0.0, 0.0, 0.0))
    return model, ClothState(at, _TURN * np.cross([0.0, 0.0, 1.0], at))


def spin(model: ClothModel, state: ClothState) -> FloatArray:
    """Return the angular momentum about the origin [kg m²/s], shape (3,)."""
    moments = np.cross(state.positions, model.mass[:, None] * state.velocities)
    return np.asarray(moments.sum(axis=0))


def dominant_root(x: FloatArray) -> complex:
    """Return the larger root of the recurrence of second order that four successive displacements obey, shape (4,)."""
    x = x / np.abs(x).max()
    if abs(x[1] * x[1] - x[0] * x[2]) < 1e-12 * x[1] * x[1]:  # one root is all that is left
        return complex(x[3] / x[2])
    trace, product = np.linalg.solve([[x[1], -x[0]], [x[2], -x[1]]], x[2:])
    return complex(max(np.roots([1.0, -trace, product]), key=abs))


def measured_root(name: str, h_omega: float) -> complex:
    """Return an integrator's characteristic root on an undamped oscillator, measured on its motion."""
    method = INTEGRATORS[name](oscillator(1.0), tolerance=_EXACT)
    state = ClothState(np.array([[0.0, 0, 0], [0.6, 0, 0.8]]), np.zeros((2, 3)))
    state = method.advance(state, empty_contacts(2), h_omega, SETTLED)
    found = []
    for _ in range(4):
        found.append(state.positions[1, 0])
        state = method.advance(state, empty_contacts(2), h_omega, 1)
    return dominant_root(np.array(found))


def _oscillator(name: str, h_omega: float) -> Measured:
    root = measured_root(name, h_omega)
    period = 2.0 * np.pi / h_omega  # in steps
    method, start = INTEGRATORS[name](oscillator(1.0)), ClothState(np.array([[0.0, 0, 0], [1, 0, 0]]), np.zeros((2, 3)))
    steps = round(10.0 * period)  # what a run of ten periods takes
    _, timing = timed(lambda: method.advance(start, empty_contacts(2), h_omega, steps))
    exact = ROOTS[name](1j * h_omega)
    errors: dict[str, Value] = {
        "energy_ratio": abs(root) ** (2.0 * period),
        "phase_error_deg": abs(abs(np.angle(root)) / h_omega - 1.0) * 360.0,
        "root_error": min(abs(root - exact), abs(root - exact.conjugate())) / abs(exact),
    }
    return timing, errors


def _dumbbell(name: str, h: float, seconds: float) -> Measured:
    model, start = dumbbell()
    method = INTEGRATORS[name](model, tolerance=_EXACT)
    method.advance(start, empty_contacts(2), h, 2)
    steps = round(seconds / h)
    end, timing = timed(lambda: method.advance(start, empty_contacts(2), h, steps))
    left = spin(model, end)[2] / spin(model, start)[2]
    if not (np.isfinite(end.positions).all() and np.abs(end.positions).max() < 1e3):
        return timing, {"spin_error": "diverged"}
    errors: dict[str, Value] = {"spin_error": abs(left - 1.0)}
    if name in KEEP_SPIN:
        errors["root_error"] = abs(left - 1.0)
    elif name in IMPLICIT_EULER:
        r, u = (tuple(np.diff(both, axis=0)[0, :2]) for both in (start.positions, start.velocities))
        (x, y), (vx, vy) = implicit_dumbbell(r, u, 1.0, 2e4, h, steps)
        errors["root_error"] = abs(left - (x * vy - y * vx) / (r[0] * u[1] - r[1] * u[0]))
    return timing, errors


@dataclass(frozen=True)
class Swing:
    """A sheet of N x N vertices, held by one edge, about to fall from the horizontal.

    Args:
        count: N.
        seconds: How long it swings [s].
    """

    count: int
    seconds: float

    @cached_property
    def start(self) -> FloatArray:
        """Flat [m], shape (N², 3)."""
        across, along, _ = grid(self.count)
        return np.column_stack([across, np.zeros(len(along)), along])

    @cached_property
    def model(self) -> ClothModel:
        """The sheet."""
        faces = grid(self.count)[2]
        held = tuple(range(self.count))
        return build_cloth(
            TriangleMesh(self.start, faces), RestShape(self.start), isotropic_sheet(_SOFT, bending=1e-4), pinned=held
        )

    @cached_property
    def reference(self) -> FloatArray:
        """Where it is in the end [m], by fourth-order steps of 20 µs, shape (N², 3)."""
        method, steps = INTEGRATORS["rk4"](self.model), round(self.seconds / 2e-5)
        return method.advance(
            at_rest(self.start), empty_contacts(len(self.start)), self.seconds / steps, steps
        ).positions

    def energy(self, state: ClothState) -> float:
        """Return the mechanical energy as a share of m g L."""
        system = ForceSystem(self.model)
        moving = 0.5 * float(np.vdot(system.mass * state.velocities, state.velocities))
        return (system.potential(state.positions)[0] + moving) / (float(self.model.mass.sum()) * GRAVITY * SIDE)


def _sheet(name: str, swing: Swing, h: float) -> Measured:
    method, free = INTEGRATORS[name](swing.model), empty_contacts(len(swing.start))
    start, steps = at_rest(swing.start), round(swing.seconds / h)
    end, timing = timed(lambda: method.advance(start, free, h, steps), warm=lambda: method.advance(start, free, h, 2))
    if not (np.isfinite(end.positions).all() and np.abs(end.positions).max() < 1e3):
        return timing, {"energy_drift": "diverged", "distance_mm": "diverged"}
    away = 1e3 * np.linalg.norm(end.positions - swing.reference, axis=1)
    errors: dict[str, Value] = {
        "energy_drift": abs(swing.energy(end) - swing.energy(start)),
        "distance_mm": float(np.sqrt(np.mean(away**2))),
    }
    return timing, errors


TRADE = "no integrator is a default here; the default method is measured against all in solvers"
