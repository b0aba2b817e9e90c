"""State of internal friction and plasticity: the sliders.

A model is constant and a state varies, so a state carries the sliders and each method works on its own copy of the
model: `with_own_sliders` once, `restore_sliders` before the first step, `slip` at the end of each, `copy_sliders` after
the last.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from numba import njit, prange
from numba.extending import overload

from vto_pipeline.cloth.constraints import KINDS
from vto_pipeline.cloth.constraints.sweep import kind_of
from vto_pipeline.cloth.model.build import ClothModel
from vto_pipeline.model.arrays import FloatArray

_BY_DATA = {kind.data: kind for kind in KINDS}


def with_own_sliders(model: ClothModel) -> ClothModel:
    """Return the same cloth with sliders of its own."""
    mine = tuple(data._replace(slider=data.slider.copy()) if kind_of(data).slip else data for data in model.constraints)
    return replace(model, constraints=mine)


def restore_sliders(model: ClothModel, sliders: Sequence[FloatArray]) -> None:
    """Set the sliders of a model to those of a state; at the start, to rest."""
    kept = _sliders(model)
    for k, mine in enumerate(kept):
        mine[:] = sliders[k] if len(sliders) == len(kept) else 0.0


def copy_sliders(model: ClothModel) -> tuple[FloatArray, ...]:
    """Return the sliders of a model, for a state."""
    return tuple(slider.copy() for slider in _sliders(model))


def _sliders(model: ClothModel) -> list[FloatArray]:
    return [data.slider for data in model.constraints if kind_of(data).slip]


def _slip_one(i, x, data):  # type: ignore[no-untyped-def]
    raise NotImplementedError


@overload(_slip_one)
def _slip_one_compiled(i, x, data):  # type: ignore[no-untyped-def]
    slip_stencil = _BY_DATA[data.instance_class].slip
    assert slip_stencil is not None
    return lambda i, x, data: slip_stencil(i, x, data)


@njit(cache=True, error_model="numpy", parallel=True)
def _slip_kind(x, data):  # type: ignore[no-untyped-def]
    for i in prange(len(data.vertices)):
        _slip_one(i, x, data)


def slip(x: FloatArray, constraints: tuple[Any, ...]) -> None:
    """Let the sliders of all constraints slip, at the end positions of a step [m], shape (V, 3)."""
    for data in constraints:
        if kind_of(data).slip:
            _slip_kind(x, data)


@overload(slip)
def _slip_compiled(x, constraints):  # type: ignore[no-untyped-def]
    if len(constraints) == 0:
        return lambda x, constraints: None
    if _BY_DATA[constraints[0].instance_class].slip is None:
        return lambda x, constraints: slip(x, constraints[1:])

    def unrolled(x, constraints):  # type: ignore[no-untyped-def]
        _slip_kind(x, constraints[0])
        slip(x, constraints[1:])

    return unrolled
