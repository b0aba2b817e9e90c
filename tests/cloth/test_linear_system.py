"""The systems of implicit steps: by elimination, or by cycles where that is too dear, against SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from block_sheets import links, sheet, whole
from scipy.sparse.linalg import spsolve

from vto_pipeline.cloth.implicit_step import linear_system
from vto_pipeline.cloth.implicit_step.linear_system import LinearSystem

COUNT = 12
NOBODY = np.zeros(COUNT * COUNT, np.bool_)


def solved(rng: np.random.Generator, linked: int, tolerance: float, *, exactly: bool, system=None):  # type: ignore[no-untyped-def]
    """Return the solution of a random system, and that of SciPy."""
    matrix = sheet(COUNT, rng)
    system = system or LinearSystem(matrix, NOBODY)
    system.blocks[:] = matrix.blocks
    vertices, weights, between = links(linked, COUNT * COUNT, rng)
    system.couple(vertices, weights)[:] = between
    right = rng.standard_normal((COUNT * COUNT, 3))
    x = np.zeros_like(right)
    system.solve(right, x, right, tolerance, exactly=exactly)
    wanted = spsolve(whole(matrix, vertices, weights, between).tocsc(), right.ravel())
    return x, wanted.reshape(-1, 3), system


@pytest.mark.parametrize("linked", [0, 10])
def test_exactly(linked: int) -> None:
    x, wanted, _ = solved(np.random.default_rng(linked), linked, 0.5, exactly=True)
    np.testing.assert_allclose(x, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())  # rounding


@pytest.mark.parametrize("linked", [0, 10])
def test_roughly(linked: int) -> None:
    x, wanted, _ = solved(np.random.default_rng(linked), linked, 1e-3, exactly=False)
    assert 1e-9 < np.abs(x - wanted).max() / np.abs(wanted).max() < 1e-2  # cycles, to about what was asked


def test_what_is_too_dear_is_not_eliminated(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(linear_system, "_MOST", 1.0)
    x, wanted, _ = solved(np.random.default_rng(7), 10, 1e-6, exactly=True)
    assert 1e-12 < np.abs(x - wanted).max() / np.abs(wanted).max() < 1e-5


def test_links_come_and_go() -> None:
    rng, system = np.random.default_rng(8), None
    for linked in (0, 5, 60, 5, 0):
        x, wanted, system = solved(rng, linked, 1e-6, exactly=True, system=system)
        np.testing.assert_allclose(x, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())  # rounding
