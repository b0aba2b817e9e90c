"""A tile of a matrix product, summed in vector registers: the inner kernel of dense elimination.

Left to itself, the compiler keeps no tile in registers, and a loop that reads and writes all it sums runs at a third of
the speed. Here a tall tile takes twelve registers: 6 x 8 sums in registers of four numbers, 12 x 8 in those of eight.
Each loaded number serves six to twelve times, and only the last sums meet the memory (Goto & van de Geijn 2008). Where
there are 32 registers, two such tiles side by side take 24 of them, and what one spreads serves the other, too.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.registry import cpu_target
from numba.extending import intrinsic

COLUMNS = 8
"""How many a tile has."""

_LONG = "+avx512f" in cpu_target.target_context.codegen().magic_tuple()[2]  # what the kernels are compiled for
_LANES = 8 if _LONG else 4  # numbers in a vector; where registers are shorter, the compiler splits it

TALL = 12 if _LONG else 6
"""How many rows the tallest tile has."""

PAIRS = _LONG
"""Whether there are registers for two of the tallest side by side."""

_VECTOR = ir.VectorType(ir.DoubleType(), _LANES)
_CONTRACT = ("contract",)  # a product and a sum in one instruction lose nothing


def _subtract_tile(height: int, width: int = COLUMNS) -> Any:
    """Return a function that subtracts tiles of this many rows and columns."""

    @intrinsic  # type: ignore[misc]
    def subtract(typingctx, above, i, beside, j, count, out, row, column):  # type: ignore[no-untyped-def]
        signature = types.void(above, types.intp, beside, types.intp, types.intp, out, types.intp, types.intp)

        def generate(context, builder, signature, args):  # type: ignore[no-untyped-def]
            left, right, target = (context.make_array(signature.args[k])(context, builder, args[k]) for k in (0, 2, 5))
            place = _places(builder)
            vectors = range(0, width, _LANES)
            sums = {(r, v): cgutils.alloca_once_value(builder, _zero()) for r in range(height) for v in vectors}
            with cgutils.for_range(builder, args[4]) as loop:
                across = [builder.load(place(right, loop.index, args[3], 0, v, _VECTOR), align=8) for v in vectors]
                for r in range(height):
                    one = _spread(builder, builder.load(place(left, loop.index, args[1], 0, r)))
                    for v, many in zip(vectors, across, strict=True):
                        product = builder.fmul(one, many, flags=_CONTRACT)
                        builder.store(builder.fadd(builder.load(sums[r, v]), product, flags=_CONTRACT), sums[r, v])
            for (r, v), total in sums.items():
                at = place(target, args[6], args[7], r, v, _VECTOR)
                builder.store(builder.fsub(builder.load(at, align=8), builder.load(total)), at, align=8)
            return context.get_dummy_value()

        return signature, generate

    return subtract


subtract_tall = _subtract_tile(TALL)
"""Subtract above[:count, i : i + TALL]ᵀ beside[:count, j : j + 8] from out[row : row + TALL, column : column + 8].

Args (above, i, beside, j, count, out, row, column): arrays float64, of two dimensions and in C order; all within them.
"""

subtract_pair = _subtract_tile(TALL, 2 * COLUMNS)
"""The same for two tiles side by side; without PAIRS no faster than one by one."""

subtract_six, subtract_three = _subtract_tile(6), _subtract_tile(3)
"""The same as the tall one for fewer rows."""


def _places(builder: ir.IRBuilder) -> Callable[..., ir.Value]:
    def place(array, row, column, down, right, kind=None):  # type: ignore[no-untyped-def]
        """Return the address of entry (row + down, column + right)."""
        width = cgutils.unpack_tuple(builder, array.shape)[1]
        row = builder.add(row, ir.Constant(row.type, down))
        at = builder.add(builder.mul(row, width), builder.add(column, ir.Constant(column.type, right)))
        address = builder.gep(array.data, [at])
        return address if kind is None else builder.bitcast(address, kind.as_pointer())

    return place


def _zero() -> ir.Constant:
    return ir.Constant(_VECTOR, [0.0] * _LANES)


def _spread(builder: ir.IRBuilder, number: ir.Value) -> ir.Value:
    """Return a vector of the same number throughout."""
    nothing = ir.Constant(_VECTOR, ir.Undefined)
    first = builder.insert_element(nothing, number, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(first, nothing, ir.Constant(ir.VectorType(ir.IntType(32), _LANES), [0] * _LANES))
