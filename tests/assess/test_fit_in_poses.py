"""Stretch by part of the body, sliding along it, and what is said of them."""

import numpy as np
import pytest
from assess_shapes import tube
from scipy.spatial.transform import Rotation

from vto_pipeline.assess.poses import openings_slide, stretch_by_part, verdict
from vto_pipeline.model.mesh import TriangleMesh

LIMIT = 0.05
BODY = tube(0.10, 0.10, 0.0, 1.0, rings=101)
PARTS = np.where(BODY.vertices[:, 1] > 0.5, "upper", "lower")
CLOTH = tube(0.105, 0.105, 0.2, 0.9, rings=71)


def test_each_part_has_the_stretch_of_the_cloth_over_it():
    """The upper half is drawn out along the axis by a tenth of its length at rest, the lower half not at all."""
    rest = CLOTH.vertices.copy()
    above = rest[:, 1] > 0.5
    rest[above, 1] = 0.5 + (rest[above, 1] - 0.5) / 1.1
    found = stretch_by_part(CLOTH, rest, BODY, PARTS, LIMIT)
    assert set(found) == {"upper", "lower"}
    assert found["upper"]["p95"] == pytest.approx(0.1, abs=1e-6)
    assert found["upper"]["share_over_limit"] > 0.97
    assert found["lower"]["p95"] == pytest.approx(0.0, abs=1e-6)
    assert found["lower"]["share_over_limit"] < 0.03
    areas = {"upper": 0.4 / 1.1, "lower": 0.3}
    for part, share in areas.items():
        assert found[part]["area_share"] == pytest.approx(share / sum(areas.values()), abs=0.02)


def test_a_part_under_hardly_any_cloth_is_no_zone():
    parts = np.where(BODY.vertices[:, 1] > 0.885, "rim", "rest")
    assert set(stretch_by_part(CLOTH, CLOTH.vertices, BODY, parts, LIMIT)) == {"rest"}


@pytest.mark.parametrize("way", [0.03, -0.05])
def test_openings_slide_by_what_the_cloth_moved_on_the_body_whose_own_motion_does_not_count(way):
    turn = Rotation.from_rotvec([0.4, -0.3, 1.1]).as_matrix()
    moved = TriangleMesh(BODY.vertices @ turn.T + (0.2, 0.5, -0.1), BODY.faces)
    along = CLOTH.vertices + np.array([0.0, way, 0.0])
    after = TriangleMesh(along @ turn.T + (0.2, 0.5, -0.1), CLOTH.faces)
    found = openings_slide(CLOTH, BODY, after, moved)
    assert [one["height_m"] for one in found] == pytest.approx([0.9, 0.2])
    assert [one["slides_m"] for one in found] == pytest.approx([abs(way)] * 2, abs=2e-4)
    still = TriangleMesh(CLOTH.vertices @ turn.T + (0.2, 0.5, -0.1), CLOTH.faces)
    assert max(one["slides_m"] for one in openings_slide(CLOTH, BODY, still, moved)) < 2e-4


def p95(**parts):
    return {name: {"p95": value} for name, value in parts.items()}


@pytest.mark.parametrize(
    ("standing", "posed", "slides", "said"),
    [
        (p95(seat=0.02), p95(seat=0.08), [0.0, 0.0], "arms up: tight at the seat (stretched by 8%, 2% before)"),
        (p95(seat=0.02), p95(seat=0.04), [0.0, 0.063], "arms up: comfortable; the bottom slides by 6 cm"),
        (p95(seat=0.02), p95(seat=0.04), [0.02, 0.0], "arms up: comfortable; the top slides by 2 cm"),
        (p95(seat=0.09), p95(seat=0.095), [0.0], "arms up: no tighter than before"),
        ({}, p95(thigh=0.06), [0.0], "arms up: tight at the thigh (stretched by 6%, 0% before)"),
        (
            p95(a=0.0, b=0.0),
            p95(a=0.07, b=0.12),
            [],
            "arms up: tight at the b (stretched by 12%, 0% before); tight at the a (stretched by 7%, 0% before)",
        ),
    ],
)
def test_what_is_said(standing, posed, slides, said):
    ordered = [{"height_m": 1.0 - 0.1 * k, "slides_m": way} for k, way in enumerate(slides)]
    assert verdict("arms_up", standing, posed, ordered, LIMIT) == said
