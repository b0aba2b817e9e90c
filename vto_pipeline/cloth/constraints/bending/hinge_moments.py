"""The curvature energy of `shape_operator` over its hinges, ½ (θ - θ₀)ᵀ M (θ - θ₀), as most methods take it.

M = Σ A Wᵀ D W over the triangles couples each hinge with those about it, and never changes. So the moment of a hinge is
a row of M times the angles, found once for all (`prepare`), and the forces are those of plain hinges.

The stiffness ∇θᵀ M ∇θ joins vertices that are three triangles apart, and takes six times as long to factor as that of
plain hinges. In its place stands ∇θᵀ W ∇θ, with the sums of a row's absolute values in W's diagonal. As M is never more
than those sums (Gershgorin), no direction is stiffer than that, on any mesh; on grids and irregular meshes none has
less than a sixth of it. So Newton's method with it contracts, and comes to rest where the forces of the true energy are
zero. A single iteration a step is stable: a stand-in p of a stiffness a takes a stiff motion on by the roots of
z² - 2 (1 - a/p) z + (1 - a/p), which stay within the unit circle up to a/p = 4/3. So does a method that goes from hinge
to hinge: until its next sweep, a moment changes with its own angle only, and such a sweep damps by W.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray
from scipy.sparse import csr_array

from vto_pipeline.cloth.constraints.bending.hinge import (
    add_moment,
    apply_hinge_multiplier,
    hinge_angle_change,
    hinge_angle_gradients,
    hinge_mobility,
    write_hinge_stiffness,
)
from vto_pipeline.cloth.constraints.bending.shape_operator import HINGES, ShapeOperator, rigidity
from vto_pipeline.cloth.constraints.kind import Kind
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.linear.coloured_blocks import blocks
from vto_pipeline.numerics.mechanics.bending import dihedral
from vto_pipeline.numerics.mechanics.xpbd_row import multiplier_step
from vto_pipeline.numerics.vector import dot, load, store_at

_PARALLEL_FROM = 7500  # hinges; under it, starting the threads costs more than they save


class HingeMoments(NamedTuple):
    """Hinges whose moments depend on each other, in the order in which they are solved.

    Args:
        vertices: Ends of the hinge, then the wings, shape (H, 4).
        first, others, coupling: M by rows, its columns and values [N·m], shapes (H + 1,), (N,) and (N,).
        rest: θ₀ [rad], shape (H,).
        compliance: W⁻¹ [1/(N·m)], shape (H,).
        bent, moment: θ - θ₀ [rad] and M (θ - θ₀) [N·m] as `prepare` found them, shape (H,); overwritten.
        damping: Rayleigh's β [s].
        starts, colours: See `numerics.blocks.Blocks`.
    """

    vertices: NDArray[np.int32]
    first: NDArray[np.int32]
    others: NDArray[np.int32]
    coupling: NDArray[np.float64]
    rest: NDArray[np.float64]
    compliance: NDArray[np.float64]
    bent: NDArray[np.float64]
    moment: NDArray[np.float64]
    damping: float
    starts: NDArray[np.int64]
    colours: NDArray[np.int64]


def by_hinges(constraints: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return the same constraints, with curvatures of triangles by their hinges."""
    return tuple(hinge_moments(data) if isinstance(data, ShapeOperator) else data for data in constraints)


def hinge_moments(triangles: ShapeOperator) -> HingeMoments:
    """Return the hinges of these triangles, with their energy."""
    stencils = triangles.vertices[:, HINGES].reshape(-1, 4)
    (used,) = np.nonzero((triangles.weights != 0.0).any(axis=1).reshape(-1))
    ends = np.sort(stencils[used, :2], axis=1).astype(np.int64)
    most = int(stencils.max(initial=0)) + 1
    _, one, hinge = np.unique(ends[:, 0] * most + ends[:, 1], return_index=True, return_inverse=True)
    vertices = stencils[used[one]]
    order, starts, colours = blocks(vertices, _along_triangles(triangles.vertices, most))
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order))
    column = np.repeat(place[hinge.reshape(-1)], 3)
    row = (3 * (used // len(HINGES))[:, None] + np.arange(3)).reshape(-1)

    def by_triangle(values: FloatArray) -> Any:
        given = values.transpose(0, 2, 1).reshape(-1, 3)[used].reshape(-1)
        return csr_array((given, (row, column)), (3 * len(values), len(vertices)))

    stiffness = triangles.area[:, None, None] * rigidity(triangles.compliance)
    matrix = (by_triangle(triangles.weights).T @ by_triangle(stiffness @ triangles.weights)).tocsr()
    matrix.sort_indices()
    count = len(vertices)
    return HingeMoments(
        np.ascontiguousarray(vertices[order]),
        matrix.indptr.astype(np.int32),
        matrix.indices.astype(np.int32),
        matrix.data,
        triangles.rest.reshape(-1)[used[one]][order],
        1.0 / abs(matrix).sum(axis=1),
        np.empty(count),
        np.empty(count),
        triangles.damping,
        starts,
        colours,
    )


def _along_triangles(stencils: NDArray[np.int32], count: int) -> FloatArray:
    """Return a place for each of so many vertices, shape (V, 3), such that those of near triangles are near."""
    places = np.zeros((count, 3))
    np.maximum.at(places[:, 0], stencils, np.arange(len(stencils))[:, None])
    return places


@njit(cache=True, error_model="numpy")
def _prepare(x, data):
    if len(data.vertices) >= _PARALLEL_FROM:
        _bend_threaded(x, data)
        _sum_moments_threaded(data)
    else:
        for i in range(len(data.vertices)):
            _bend(i, x, data)
        for i in range(len(data.vertices)):
            _sum_moment(i, data)


@njit(cache=True, error_model="numpy")
def _prepare_rates(x, v, data, lacking):
    for i in range(len(data.vertices)):
        _, slopes = hinge_angle_gradients(i, x, data)
        rate = 0.0
        for s in range(4):
            rate += dot(slopes[s], load(v, data.vertices[i, s]))
        data.bent[i] = rate
    _sum_moments_threaded(data)
    if lacking:
        for i in range(len(data.vertices)):
            data.moment[i] -= data.bent[i] / data.compliance[i]


# apart from the sums: two loops over the same range are fused, and sums would meet what is not bent yet
@njit(cache=True, error_model="numpy", parallel=True)
def _bend_threaded(x, data):
    for i in prange(len(data.vertices)):
        _bend(np.int64(i), x, data)


@njit(cache=True, error_model="numpy", parallel=True)
def _sum_moments_threaded(data):
    for i in prange(len(data.vertices)):
        _sum_moment(np.int64(i), data)


@njit(cache=True, error_model="numpy")
def _bend(i, x, data):
    a, b, c, d = data.vertices[i, 0], data.vertices[i, 1], data.vertices[i, 2], data.vertices[i, 3]
    data.bent[i] = dihedral(load(x, a), load(x, b), load(x, c), load(x, d))[0] - data.rest[i]


@njit(cache=True, error_model="numpy")
def _sum_moment(i, data):
    found = 0.0
    for k in range(data.first[i], data.first[i + 1]):
        found += data.coupling[k] * data.bent[data.others[k]]
    data.moment[i] = found


@njit(cache=True, error_model="numpy", forceinline=True)
def _force(i, x, data, forces):
    _, slopes = hinge_angle_gradients(i, x, data)
    add_moment(i, data, slopes, -data.moment[i], forces)
    return 0.5 * data.moment[i] * data.bent[i]


@njit(cache=True, error_model="numpy", forceinline=True)
def _linearise(i, x, data, values, gradients, compliance):
    _, slopes = hinge_angle_gradients(i, x, data)
    compliance[0, 0] = data.compliance[i]
    values[0] = data.moment[i] * data.compliance[i]
    for s in range(4):
        store_at(gradients, 0, s, slopes[s])


@njit(cache=True, error_model="numpy", forceinline=True)
def _project(i, x, start, inverse_mass, data, multipliers, h):
    angle, slopes = hinge_angle_gradients(i, x, data)
    weight = hinge_mobility(i, inverse_mass, data, slopes)
    if weight == 0.0:
        return
    change = hinge_angle_change(i, x, start, data, slopes) if data.damping > 0.0 else 0.0
    soft, viscous = data.compliance[i] / (h * h), data.damping / h
    excess = angle - data.rest[i] - data.bent[i] + data.moment[i] * data.compliance[i]
    shift = multiplier_step(excess, weight, soft, multipliers[i, 0], change, viscous)
    multipliers[i, 0] += shift
    apply_hinge_multiplier(i, x, inverse_mass, data, slopes, shift)


@njit(cache=True, error_model="numpy", forceinline=True)
def _exact(i, x, data, material, blocks):
    _, slopes = hinge_angle_gradients(i, x, data)
    write_hinge_stiffness(i, x, data, slopes, material / data.compliance[i], data.moment[i], blocks)


KIND = Kind(HingeMoments, 1, _project, _force, _linearise, exact=_exact, prepare=_prepare, prepare_rates=_prepare_rates)
