"""What a frame of cloth in motion is judged by: beside closed forms of a sheet that is drawn and sheared."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.cloth.judge.strain import cloth_triangles, gradients, warp_weft_strains
from vto_pipeline.cloth.moving.frame_audit import largest_strains, stretch_of_edges
from vto_pipeline.geometry.topology import laid_edge_lengths
from vto_pipeline.model.mesh import TriangleMesh

SIDE = 20  # squares


def sheet() -> TriangleMesh:
    """A square of a metre, upright: its warp is the vertical."""
    ticks = np.linspace(0.0, 1.0, SIDE + 1)
    x, y = np.meshgrid(ticks, ticks, indexing="ij")
    corner = (np.arange(SIDE)[:, None] * (SIDE + 1) + np.arange(SIDE)).reshape(-1)
    right, up = corner + SIDE + 1, corner + 1
    faces = np.concatenate([np.stack([corner, right, right + 1], 1), np.stack([corner, right + 1, up], 1)])
    return TriangleMesh(np.stack([x, y, 0.0 * x], axis=2).reshape(-1, 3), faces.astype(np.int32))


def judged(moved: np.ndarray) -> tuple[float, float, float]:
    mesh = sheet()
    laid = cloth_triangles(mesh.vertices[mesh.faces])
    return largest_strains(warp_weft_strains(gradients(moved, mesh.faces, laid)), laid.area)


@pytest.mark.parametrize("angle", [0.3, -0.7])
def test_a_weave_that_shears_stretches_on_its_bias_and_in_no_thread(angle):
    """The bias of a square whose sides stand at 90 degrees less γ is longer by √(1 + sin γ)."""
    mesh = sheet()
    x, y = mesh.vertices[:, 0], mesh.vertices[:, 1]
    moved = np.stack([x * np.cos(angle), y + x * np.sin(angle), 0.0 * x], axis=1)
    assert_allclose(judged(moved), (0.0, 0.0, np.degrees(abs(angle))), rtol=0, atol=1e-9)
    natural = laid_edge_lengths(mesh, mesh.vertices[mesh.faces])
    found = stretch_of_edges(TriangleMesh(moved, mesh.faces), natural).max()
    assert found == pytest.approx(max(0.0, np.sqrt(1.0 + np.sin(angle)) - 1.0), abs=1e-9)


@pytest.mark.parametrize("along", [0, 1])
def test_threads_are_stretched_as_far_as_the_sheet_is_drawn(along):
    sizes = np.ones(3)
    sizes[along], sizes[1 - along] = 1.2, 0.9
    assert_allclose(judged(sheet().vertices * sizes), (0.2, 0.2, 0.0), rtol=0, atol=1e-9)


@pytest.mark.parametrize(("rows", "below"), [(1, 0.5), (0, 0.1)])
def test_what_less_than_a_hundredth_of_the_cloth_bears_is_told_apart(rows, below):
    """A row of squares is a twentieth of the sheet, and a corner square a four hundredth."""
    moved = sheet().vertices * [1.1, 1.0, 1.0]
    if rows:
        moved[:, 0] += np.where(sheet().vertices[:, 0] > 0.97, 0.4 / SIDE, 0.0)
    else:
        moved[-1, 0] += 0.4 / SIDE
    found = judged(moved)
    assert found[0] == pytest.approx(0.5, abs=1e-9)
    assert found[1] == pytest.approx(below, abs=1e-9)
