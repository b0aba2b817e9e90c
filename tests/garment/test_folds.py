"""Seams that a file has folded: which they are, and that the cloth stays folded without stretch."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vto_pipeline.bench.samples.patterns.pieces import mirrored, piece, sewn
from vto_pipeline.garment.pattern.embed import in_shape
from vto_pipeline.garment.pattern.folds import folds, inside_out
from vto_pipeline.garment.pattern.sew import SewConfig, Sewn, sew
from vto_pipeline.geometry.topology import laid_edge_lengths, opposite_half_edges
from vto_pipeline.io.patterns.read import read_pattern
from vto_pipeline.model.job import Job

FOREIGN = Path(__file__).parents[3] / "shared" / "data" / "patterns" / "garment_pattern_generator"
WIDE, HIGH, FOLD = 0.2, 0.05, 1.0  # m: of a strip, and the height that the next one is folded over at


def strip(low: float) -> list[tuple[float, float]]:
    """Return a strip's corners; its edges: lower, right, upper, left."""
    return [(0.0, low), (WIDE, low), (WIDE, low + HIGH), (0.0, low + HIGH)]


def stand_and_fall() -> Sewn:
    """Return a strip, and one that is folded down over it, 2 cm before it."""
    stand = piece("stand", "front", 0.10, strip(FOLD - HIGH))
    fall = piece("fall", "front", 0.12, strip(FOLD), over=FOLD)
    return sew(sewn("s", 1.72, [stand, fall], [([("stand", 2)], [("fall", 0)])]), SewConfig(edge_mm=10.0), Job())


def test_a_folded_strip_hangs_down_before_the_other_without_stretch():
    cloth = stand_and_fall()
    mesh = in_shape(cloth, Job())
    lengths = laid_edge_lengths(mesh, mesh.vertices[mesh.faces]) / laid_edge_lengths(mesh, mesh.texture)
    assert np.abs(lengths - 1.0).max() < 0.01  # paper that is folded is not stretched
    of = [mesh.vertices[np.unique(mesh.faces[cloth.panel == k])] for k in (0, 1)]
    top = of[0][:, 1].max()
    assert of[1][:, 1].max() == pytest.approx(top, abs=2e-3)  # the fold is the highest of both
    assert top - of[1][:, 1].min() > 0.9 * HIGH  # it hangs: its other edge is nearly its height below
    stand, fall = (one[one[:, 1] < top - 0.8 * HIGH] for one in of)
    assert 0.005 < fall[:, 2].min() - stand[:, 2].max() < 0.04  # m: before the stand all along, about as it was laid


def test_panels_right_side_to_right_side_are_folded_and_those_wrong_side_to_wrong_side_are_not():
    cloth = stand_and_fall()
    twin = opposite_half_edges(cloth.mesh)
    found = folds(cloth.mesh, cloth.frames, twin)
    assert found.sum() == 2 * round(WIDE / 0.01)  # both halves of each edge along the seam
    turned = inside_out(found, twin)
    assert sorted(float(turned[cloth.panel == k].mean()) for k in (0, 1)) == [0.0, 1.0]  # one of them, all over
    front, back = piece("front", "front", 0.1, strip(0.9)), piece("back", "back", 0.1, mirrored(strip(0.9)))
    tube = sew(sewn("t", 1.72, [front, back], [([("front", 2)], [("back", 1)])]), SewConfig(edge_mm=10.0), Job())
    assert not folds(tube.mesh, tube.frames, opposite_half_edges(tube.mesh)).any()


def test_every_second_fold_turns_the_cloth_back():
    twin = np.full((5, 3), -1)  # five triangles in a row; the cloth is folded after the second and after the fourth
    for k in range(4):
        twin[k, 1], twin[k + 1, 0] = 3 * (k + 1), 3 * k + 1
    folded = np.zeros((5, 3), np.bool_)
    for k in (1, 3):
        folded[k, 1] = folded[k + 1, 0] = True
    assert inside_out(folded.ravel(), twin.ravel()).tolist() == [False, False, True, True, False]
    assert not inside_out(np.zeros(15, np.bool_), twin.ravel()).any()


@pytest.mark.real_data
@pytest.mark.skipif(not FOREIGN.exists(), reason="shared data absent")
@pytest.mark.parametrize("name", ["basic tee/jacket_hood", "combos/jumpsuit", "skirts/skirt_8_panels"])
def test_garments_by_others_are_not_folded_at_their_seams(name):
    cloth = sew(read_pattern(FOREIGN / f"{name}.json"), SewConfig(edge_mm=40.0), Job())
    assert not folds(cloth.mesh, cloth.frames, opposite_half_edges(cloth.mesh)).any()
