"""The interface of a kind of constraint; everything else about constraints is written once for all kinds.

Four compiled functions of one stencil i, at positions x [m], shape (V, 3):

* `project(i, x, start, inverse_mass, data, multipliers, h)`: one step of Gauss-Seidel on x and λ, in place: XPBD with
  its damping, Macklin, Müller & Chentanez 2016, eq. 26.
* `force(i, x, data, forces)`: add the forces [N] and return the energy [J].
* `linearise(i, x, data, values, gradients, compliance)`: fill C, shape (B,), ∇C, shape (B, S, 3), and the compliance α,
  shape (B, B), such that the force is -∇Cᵀ α⁻¹ C. For a linear material the energy is ½ Cᵀ α⁻¹ C; for any other, α
  is the inverse of the tangent stiffness, and C what gives the stress.
* `geometric(i, x, data, blocks)`: add to the stiffness, shape (S, S, 3, 3), what stress contributes, as far as it is
  positive semidefinite. None when that is nothing.

And where the general way to the stiffness, ∇Cᵀ α⁻¹ ∇C + geometric, is too slow, a fifth:

* `stiffness(i, x, data, material, stress, blocks)`: write material ∇Cᵀ α⁻¹ ∇C + stress geometric into blocks.

For the stiffness with all that stress adds, a sixth; where there is none, it is made of differences of the forces:

* `exact(i, x, data, material, blocks)`: write -∂f/∂x + (material - 1) ∇Cᵀ α⁻¹ ∇C into blocks.

For kinds whose stencils share what is found for all of them at once, in arrays of their data that are overwritten:

* `prepare(x, data)`: find it at positions x. Called once before `force`, `linearise` or `stiffness` are for each, and
  before each sweep of `project`.
* `prepare_rates(x, v, data, lacking)`: find it such that `force` gives -S v, with the slope S of unstressed
  forces and velocities v; or what ∇Cᵀ α⁻¹ ∇C, which stands for S in matrices, lacks of it.

And for kinds that remember, whose data have a `slider`, shape (N, ...):

* `slip(i, x, data)`: at the end of a step, let the slider of stencil i give way; see `cloth.model.internal_friction`.

All are compiled with `forceinline`, as the formulas in `numerics` are: a call hands over the descriptors of all arrays,
some eighty words, which costs more than the arithmetic (bending: 50 ns a hinge in place of 130).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Kind:
    """A kind of constraint.

    Args:
        data: Its NamedTuple of arrays, with at least `vertices` (N, S), `damping` [s], `starts` and `colours` (see
            `numerics.blocks.Blocks`).
        rows: Scalar constraints per stencil, B.
        project, force, linearise, geometric, stiffness, slip, exact, prepare, prepare_rates: See above.
    """

    data: type
    rows: int
    project: Callable[..., None]
    force: Callable[..., float]
    linearise: Callable[..., None]
    geometric: Callable[..., None] | None = None
    stiffness: Callable[..., None] | None = None
    slip: Callable[..., None] | None = None
    exact: Callable[..., None] | None = None
    prepare: Callable[..., None] | None = None
    prepare_rates: Callable[..., None] | None = None
