"""Tiles of a product against NumPy's."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from vto_pipeline.numerics.linear.product_tile import COLUMNS, TALL, subtract_six, subtract_tall, subtract_three


@njit
def tall(above, i, beside, j, count, out, row, column):  # type: ignore[no-untyped-def]
    subtract_tall(above, i, beside, j, count, out, row, column)


@njit
def six(above, i, beside, j, count, out, row, column):  # type: ignore[no-untyped-def]
    subtract_six(above, i, beside, j, count, out, row, column)


@njit
def three(above, i, beside, j, count, out, row, column):  # type: ignore[no-untyped-def]
    subtract_three(above, i, beside, j, count, out, row, column)


@pytest.mark.parametrize(("subtract", "height"), [(tall, TALL), (six, 6), (three, 3)])
@pytest.mark.parametrize("count", [0, 1, 7, 40])
def test_a_tile_and_nothing_else_is_subtracted(subtract, height: int, count: int) -> None:  # type: ignore[no-untyped-def]
    rng = np.random.default_rng(count)
    above, beside, out = rng.standard_normal((40, 31)), rng.standard_normal((40, 23)), rng.standard_normal((15, 17))
    i, j, row, column = 31 - height, 5, 15 - height, 17 - COLUMNS  # both end where the arrays end
    wanted = out.copy()
    wanted[row : row + height, column:] -= above[:count, i:].T @ beside[:count, j : j + COLUMNS]
    subtract(above, i, beside, j, count, out, row, column)
    np.testing.assert_allclose(out, wanted, rtol=0, atol=1e-13)  # rounding of 40 products of size 1
