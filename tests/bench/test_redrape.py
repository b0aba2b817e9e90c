"""Patterns put on again: how far two surfaces are apart, in closed form, and which runs are refused."""

from __future__ import annotations

import json

import numpy as np
import pytest

from vto_pipeline.bench.unsewn.redrape import _given, apart
from vto_pipeline.errors import InputError
from vto_pipeline.model.mesh import TriangleMesh


def sheet(width: float, height: float, cells: tuple[int, int], z: float = 0.0) -> TriangleMesh:
    """A rectangle from the origin, at one height z [m]."""
    across, up = cells
    x, y = np.meshgrid(np.linspace(0.0, width, across + 1), np.linspace(0.0, height, up + 1))
    a = (np.arange(up)[:, None] * (across + 1) + np.arange(across)).ravel()
    b, c, d = a + 1, a + across + 2, a + across + 1
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]).astype(np.int32)
    return TriangleMesh(np.stack([x.ravel(), y.ravel(), np.full(x.size, z)], axis=1), faces)


@pytest.mark.parametrize("cells", [(7, 5), (40, 3)])
def test_parallel_sheets_are_as_far_apart_as_they_are(cells):
    """Whatever the triangles, all of one sheet is as far from the other."""
    assert apart(sheet(0.4, 0.3, (10, 10)), sheet(0.4, 0.3, cells, 0.004)) == pytest.approx((0.004, 0.004), rel=1e-9)


def test_cloth_that_the_other_lacks_counts():
    """A strip of width w beyond the edge is w/2 away on average, the rest not at all. Either order says the same.

    Of the two ways, only the one from the larger sheet sees it, so the mean is half of w/2 times the strip's share.
    """
    width, strip = 0.4, 0.1
    small, large = sheet(width, 0.2, (40, 20)), sheet(width + strip, 0.2, (100, 40))
    mean, p95 = apart(small, large)
    assert mean == pytest.approx(0.5 * 0.5 * strip * strip / (width + strip), rel=1e-3)
    assert p95 == pytest.approx(0.5 * strip, abs=0.006)  # 5 % of both is half of the strip; a cell is 5 mm
    assert apart(large, small) == pytest.approx((mean, p95), rel=1e-9)


def test_fine_triangles_count_no_more_than_their_area():
    """Half of a sheet in many more triangles, that half raised: the mean is that of the areas."""
    left, right = sheet(0.2, 0.2, (4, 4)), sheet(0.2, 0.2, (40, 40), 0.01)
    both = TriangleMesh(
        np.concatenate([left.vertices, right.vertices + np.array([5.0, 0.0, 0.0])]),
        np.concatenate([left.faces, right.faces + len(left.vertices)]),
    )
    level = TriangleMesh(both.vertices * [1.0, 1.0, 0.0], both.faces)
    assert apart(both, level)[0] == pytest.approx(0.005, rel=1e-9)


def test_a_run_says_what_it_was_given(tmp_path):
    given = {"a": {"key": "garment.pattern", "path": "g.json"}, "b": {"key": "body.mesh", "path": "b.ply"}}
    (tmp_path / "run.json").write_text(json.dumps({"given": given}))
    with pytest.raises(InputError, match="not given a file of its fabric"):
        _given(tmp_path)
    given["c"] = {"key": "fabric", "value": "denim"}
    (tmp_path / "run.json").write_text(json.dumps({"given": given}))
    assert _given(tmp_path) == {"garment": "g.json", "body": "b.ply", "fabric": "denim"}
