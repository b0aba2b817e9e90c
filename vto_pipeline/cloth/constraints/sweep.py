"""Loops over constraints of any kind, the same bits for any number of threads.

Blocks of one colour share no vertex, so they run in parallel; a tuple of kinds is unrolled when it is compiled.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, prange
from numba.extending import overload
from numpy.typing import NDArray

from vto_pipeline.cloth.constraints import KINDS
from vto_pipeline.cloth.constraints.kind import Kind

PARALLEL_FROM = 2500  # vertices; under it, starting the threads costs more than they save

_BY_DATA: dict[type, Kind] = {kind.data: kind for kind in KINDS}


def kind_of(data: object) -> Kind:
    """Return the kind of a set of constraints."""
    return _BY_DATA[type(data)]


def _prepare_one(x, data):
    raise NotImplementedError


@overload(_prepare_one)
def _prepare_one_compiled(x, data):
    shared = _BY_DATA[data.instance_class].prepare
    return (lambda x, data: None) if shared is None else lambda x, data: shared(x, data)


@njit(cache=True, error_model="numpy")
def prepare(x, data):
    """Find what the stencils of one kind share at positions x [m], shape (V, 3); see `kind`."""
    _prepare_one(x, data)


def prepare_all(x, constraints):
    """Find what the stencils of each kind share, as `prepare`. From compiled code only."""
    raise NotImplementedError


@overload(prepare_all)
def _prepare_all_compiled(x, constraints):
    if len(constraints) == 0:
        return lambda x, constraints: None

    def unrolled(x, constraints):
        _prepare_one(x, constraints[0])
        prepare_all(x, constraints[1:])

    return unrolled


def multipliers(constraints: tuple[Any, ...]) -> tuple[NDArray[np.float64], ...]:
    """Return λ = 0 for each constraint, shape (N, B) for each kind."""
    return tuple(np.zeros((len(data.vertices), kind_of(data).rows)) for data in constraints)


def _project_one(i, x, start, inverse_mass, data, lambdas, h):
    raise NotImplementedError


@overload(_project_one, inline="always")
def _project_one_compiled(i, x, start, inverse_mass, data, lambdas, h):
    project_stencil = _BY_DATA[data.instance_class].project
    return lambda i, x, start, inverse_mass, data, lambdas, h: project_stencil(
        i, x, start, inverse_mass, data, lambdas, h
    )


def force_one(i, x, data, forces):
    """Add the forces of one stencil of any kind [N] and return its energy [J]. From compiled code only."""
    raise NotImplementedError


@overload(force_one)
def _force_one_compiled(i, x, data, forces):
    force = _BY_DATA[data.instance_class].force
    return lambda i, x, data, forces: force(i, x, data, forces)


def linearise_one(i, x, data, values, gradients, compliance):
    """Linearise one stencil of any kind; see `kind`. From compiled code only."""
    raise NotImplementedError


@overload(linearise_one)
def _linearise_one_compiled(i, x, data, values, gradients, compliance):
    linearise = _BY_DATA[data.instance_class].linearise
    return lambda i, x, data, values, gradients, compliance: linearise(i, x, data, values, gradients, compliance)


def _geometric_one(i, x, data, blocks):
    raise NotImplementedError


@overload(_geometric_one)
def _geometric_one_compiled(i, x, data, blocks):
    geometric = _BY_DATA[data.instance_class].geometric
    if geometric is None:
        return lambda i, x, data, blocks: None
    return lambda i, x, data, blocks: geometric(i, x, data, blocks)


def rows_of(data):
    """Return B, a constant of the kind. From compiled code only."""
    raise NotImplementedError


@overload(rows_of)
def _rows_compiled(data):
    rows = _BY_DATA[data.instance_class].rows
    return lambda data: rows


@njit(cache=True, error_model="numpy")
def _project_block(x, start, inverse_mass, data, lambdas, h, block):
    for i in range(data.starts[block], data.starts[block + 1]):
        _project_one(i, x, start, inverse_mass, data, lambdas, h)


@njit(cache=True, error_model="numpy", parallel=True)
def _project_colour(x, start, inverse_mass, data, lambdas, h, first, last):
    for block in prange(first, last):
        _project_block(x, start, inverse_mass, data, lambdas, h, block)


@njit(cache=True, error_model="numpy")
def _project_kind(x, start, inverse_mass, data, lambdas, h, threaded):
    for colour in range(len(data.colours) - 1):
        first, last = data.colours[colour], data.colours[colour + 1]
        if threaded and last - first > 1:
            _project_colour(x, start, inverse_mass, data, lambdas, h, first, last)
        else:
            for block in range(first, last):
                _project_block(x, start, inverse_mass, data, lambdas, h, block)


def project(x, start, inverse_mass, constraints, lambdas, h, threaded):
    """Sweep once over all constraints, in place. From compiled code only.

    Args:
        x: Positions [m], shape (V, 3).
        start: Positions at the start of the step [m], shape (V, 3).
        inverse_mass: [1/kg], shape (V,); zero holds a vertex.
        constraints: The data of each kind.
        lambdas: Multipliers so far in this step, shape (N, B) for each kind.
        h: Step [s].
        threaded: Whether the blocks of a colour run in parallel.
    """
    raise NotImplementedError


@overload(project)
def _project_compiled(x, start, inverse_mass, constraints, lambdas, h, threaded):
    if len(constraints) == 0:
        return lambda x, start, inverse_mass, constraints, lambdas, h, threaded: None

    def unrolled(x, start, inverse_mass, constraints, lambdas, h, threaded):
        _project_kind(x, start, inverse_mass, constraints[0], lambdas[0], h, threaded)
        project(x, start, inverse_mass, constraints[1:], lambdas[1:], h, threaded)

    return unrolled


@njit(cache=True, error_model="numpy")
def _force_block(x, data, forces, block):
    energy = 0.0
    for i in range(data.starts[block], data.starts[block + 1]):
        energy += force_one(i, x, data, forces)
    return energy


@njit(cache=True, error_model="numpy", parallel=True)
def _force_colour(x, data, forces, energies, first, last):
    for block in prange(first, last):
        energies[block] = _force_block(x, data, forces, block)


@njit(cache=True, error_model="numpy")
def _force_kind(x, data, forces):
    energies = np.empty(len(data.starts) - 1)
    for colour in range(len(data.colours) - 1):
        first, last = data.colours[colour], data.colours[colour + 1]
        if len(x) >= PARALLEL_FROM and last - first > 1:
            _force_colour(x, data, forces, energies, first, last)
        else:
            for block in range(first, last):
                energies[block] = _force_block(x, data, forces, block)
    total = 0.0
    for block in range(len(energies)):
        total += energies[block]
    return total


def add_forces(x, constraints, forces):  # type: ignore[no-untyped-def]
    """Add the internal forces [N] at positions x [m], both (V, 3), and return the elastic energy [J]."""
    energy = 0.0
    for data in constraints:
        prepare(x, data)
        energy += _force_kind(x, data, forces)
    return energy


@njit(cache=True, error_model="numpy")
def _damp_block(x, v, data, forces, block):
    rows, corners = rows_of(data), data.vertices.shape[1]
    values, gradients = np.empty(rows), np.empty((rows, corners, 3))
    compliance, rate = np.empty((rows, rows)), np.empty((rows, 1))
    for i in range(data.starts[block], data.starts[block + 1]):
        linearise_one(i, x, data, values, gradients, compliance)
        for b in range(rows):
            rate[b, 0] = 0.0
            for s in range(corners):
                for k in range(3):
                    rate[b, 0] += gradients[b, s, k] * v[data.vertices[i, s], k]
        solve_compliance(compliance, rate)
        for s in range(corners):
            for k in range(3):
                pull = 0.0
                for b in range(rows):
                    pull += gradients[b, s, k] * rate[b, 0]
                forces[data.vertices[i, s], k] -= data.damping * pull


@njit(cache=True, error_model="numpy", parallel=True)
def _damp_colour(x, v, data, forces, first, last):
    for block in prange(first, last):
        _damp_block(x, v, data, forces, block)


@njit(cache=True, error_model="numpy")
def _damp_kind(x, v, data, forces):
    for colour in range(len(data.colours) - 1):
        first, last = data.colours[colour], data.colours[colour + 1]
        if len(x) >= PARALLEL_FROM and last - first > 1:
            _damp_colour(x, v, data, forces, first, last)
        else:
            for block in range(first, last):
                _damp_block(x, v, data, forces, block)


def add_damping_forces(x, v, constraints, forces):  # type: ignore[no-untyped-def]
    """Add -β K v [N] with the material stiffness K = ∇Cᵀ α⁻¹ ∇C and each kind's damping β [s].

    Args:
        x: Positions [m], shape (V, 3).
        v: Velocities [m/s], shape (V, 3).
        constraints: The data of each kind.
        forces: [N], shape (V, 3), changed in place.
    """
    for data in constraints:
        rates = kind_of(data).prepare_rates
        if data.damping > 0.0 and rates is not None:
            rates(x, v, data, False)
            drag = np.zeros_like(forces)
            _force_kind(x, data, drag)
            forces += data.damping * drag
        elif data.damping > 0.0:
            _damp_kind(x, v, data, forces)


def has_lacking(constraints: tuple[Any, ...]) -> bool:
    """Return whether the matrices of some kinds stand for what joins more vertices than a stencil has."""
    return any(kind_of(data).prepare_rates is not None for data in constraints)


def add_lacking(x, v, constraints, h, out):  # type: ignore[no-untyped-def]
    """Add what the matrix of a step of h [s] at positions x lacks of the slope of its forces, times v, to out [N].

    Args:
        x: Positions [m], shape (V, 3).
        v: Moves [m], shape (V, 3).
        constraints: The data of each kind.
        h: Step [s], for damping.
        out: Shape (V, 3), changed in place.
    """
    for data in constraints:
        rates = kind_of(data).prepare_rates
        if rates is not None:
            rates(x, v, data, True)
            found = np.zeros_like(out)
            _force_kind(x, data, found)
            out -= (1.0 + data.damping / h) * found


def linearised(x: NDArray[np.float64], data: Any) -> tuple[NDArray[np.float64], ...]:
    """Return C, ∇C and α of one kind at positions x, shapes (N, B), (N, B, S, 3) and (N, B, B); see `kind`."""
    prepare(x, data)
    found: tuple[NDArray[np.float64], ...] = _linearised(x, data)
    return found


@njit(cache=True, error_model="numpy", parallel=True)
def _linearised(x, data):
    count, rows, corners = len(data.vertices), rows_of(data), data.vertices.shape[1]
    values, gradients = np.empty((count, rows)), np.empty((count, rows, corners, 3))
    compliance = np.empty((count, rows, rows))
    for i in prange(count):
        linearise_one(np.int64(i), x, data, values[i], gradients[i], compliance[i])
    return values, gradients, compliance


@njit(cache=True, error_model="numpy")
def solve_compliance(compliance, right):
    """Solve α s = right in place, for a symmetric positive definite α, shape (B, B), which is overwritten.

    Args:
        compliance: Shape (B, B).
        right: Right-hand sides, shape (B, M).
    """
    rows = len(compliance)
    for j in range(rows):
        for i in range(j + 1, rows):
            factor = compliance[i, j] / compliance[j, j]
            for k in range(j, rows):
                compliance[i, k] -= factor * compliance[j, k]
            for k in range(right.shape[1]):
                right[i, k] -= factor * right[j, k]
    for j in range(rows - 1, -1, -1):
        for k in range(right.shape[1]):
            for i in range(j + 1, rows):
                right[j, k] -= compliance[j, i] * right[i, k]
            right[j, k] /= compliance[j, j]


@njit(cache=True, error_model="numpy")
def stiffness_scratch(data):
    """Return working memory for `stiffness_one`. From compiled code only."""
    rows, corners = rows_of(data), data.vertices.shape[1]
    return np.empty(rows), np.empty((rows, corners, 3)), np.empty((rows, rows)), np.empty((rows, 3 * corners))


def stiffness_one(i, x, data, material, stress, blocks, scratch):
    """Write the stiffness of one stencil of any kind into blocks, shape (S, S, 3, 3). From compiled code only.

    Args:
        i: Which stencil.
        x: Positions [m], shape (V, 3).
        data: The kind's data.
        material: Factor of ∇Cᵀ α⁻¹ ∇C.
        stress: Factor of what stress adds.
        blocks: Changed in place.
        scratch: See `stiffness_scratch`.
    """
    raise NotImplementedError


@overload(stiffness_one)
def _stiffness_one_compiled(i, x, data, material, stress, blocks, scratch):
    stiffness = _BY_DATA[data.instance_class].stiffness
    if stiffness is not None:
        return lambda i, x, data, material, stress, blocks, scratch: stiffness(i, x, data, material, stress, blocks)
    return _general_stiffness


def exact_one(i, x, data, material, blocks):
    """Write the exact stiffness of one stencil of a kind that has it; see `kind`. From compiled code only."""
    raise NotImplementedError


@overload(exact_one)
def _exact_one_compiled(i, x, data, material, blocks):
    exact = _BY_DATA[data.instance_class].exact
    if exact is None:
        return lambda i, x, data, material, blocks: None
    return lambda i, x, data, material, blocks: exact(i, x, data, material, blocks)


def _general_stiffness(i, x, data, material, stress, blocks, scratch):
    values, gradients, compliance, weighted = scratch
    linearise_one(i, x, data, values, gradients, compliance)
    blocks[:] = 0.0
    _geometric_one(i, x, data, blocks)
    rows, corners, _ = gradients.shape
    for row in range(rows):
        for a in range(corners):
            for k in range(3):
                weighted[row, 3 * a + k] = gradients[row, a, k]
    solve_compliance(compliance, weighted)
    for a in range(corners):
        for b in range(corners):
            for k in range(3):
                for m in range(3):
                    pull = 0.0
                    for row in range(rows):
                        pull += gradients[row, a, k] * weighted[row, 3 * b + m]
                    blocks[a, b, k, m] = material * pull + stress * blocks[a, b, k, m]
