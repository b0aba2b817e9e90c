"""Where and when a garment gets tight in a motion, on cloth that is drawn out by known shares."""

import numpy as np
import pytest
from assess_shapes import tube
from numpy.testing import assert_allclose

from vto_pipeline.assess.motion import assess_motion, peaks, verdict
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.motion import ClothMotion

LIMIT, STEP_S = 0.05, 0.04
BODY = tube(0.10, 0.10, 0.0, 1.2, rings=121)
CLOTH = tube(0.105, 0.105, 0.2, 0.9, rings=71)
PARTS = np.where(BODY.vertices[:, 1] > 0.5, "upper", "lower")
DRAWN = (0.01, 0.02, 0.11, 0.03)  # share by which what is above 0.5 m is drawn out in each frame


def motion() -> ClothMotion:
    frames = []
    for share in DRAWN:
        there = CLOTH.vertices.copy()
        above = there[:, 1] > 0.5
        there[above, 1] = 0.5 + (1.0 + share) * (there[above, 1] - 0.5)
        frames.append(there)
    return ClothMotion(np.stack(frames), CLOTH.faces, STEP_S)


def test_the_most_and_its_time_are_found():
    done: list[float] = []
    job = Job(lambda share, text: done.append(share))
    report, maps = assess_motion(motion(), CLOTH.vertices, [BODY] * 4, PARTS, LIMIT, job)
    upper, lower = report["parts"]["upper"], report["parts"]["lower"]
    assert upper["most"] == pytest.approx(0.11, abs=1e-6)
    assert upper["begin"] == pytest.approx(0.01, abs=1e-6)
    assert upper["at_s"] == pytest.approx(2 * STEP_S)
    assert lower["most"] == pytest.approx(0.0, abs=1e-6)
    assert [frame["time_s"] for frame in report["frames"]] == pytest.approx([0.0, 0.04, 0.08, 0.12])
    assert report["frames"][1]["parts"]["upper"]["p95"] == pytest.approx(0.02, abs=1e-6)
    inside = CLOTH.vertices[:, 1] > 0.52
    assert_allclose(maps["stretch"][inside], 1.11, atol=1e-6)
    assert_allclose(maps["at_s"][inside], 0.08)
    assert_allclose(maps["stretch"][CLOTH.vertices[:, 1] < 0.48], 1.0, atol=1e-6)
    assert report["verdict"] == "in motion: tight at the upper at 0.1 s (stretched by 11%, 1% at the begin)"
    assert done == pytest.approx([0.0, 0.25, 0.5, 0.75])


@pytest.mark.parametrize(
    ("begin", "most", "said"),
    [
        (0.0, 0.04, "in motion: comfortable"),
        (0.08, 0.085, "in motion: no tighter than at its begin"),
        (0.02, 0.30, "in motion: tight at the waist at 1.5 s (stretched by 30%, 2% at the begin)"),
    ],
)
def test_what_is_said(begin, most, said):
    assert verdict({"waist": {"begin": begin, "most": most, "at_s": 1.5}}, LIMIT) == said


def test_a_part_that_cloth_reaches_later_began_unstretched():
    frames = [{"time_s": 0.0, "parts": {}}, {"time_s": 0.5, "parts": {"neck": {"p95": 0.2}}}]
    assert peaks(frames) == {"neck": {"begin": 0.0, "most": 0.2, "at_s": 0.5}}


def test_cloth_moves_with_the_body_it_lies_on():
    """The body goes along by 0.4 m: each part keeps its cloth."""
    frames = np.stack([CLOTH.vertices, np.add(CLOTH.vertices, [0.0, 0.4, 0.0])])
    bodies = [BODY, TriangleMesh(np.add(BODY.vertices, [0.0, 0.4, 0.0]), BODY.faces)]
    report, _ = assess_motion(ClothMotion(frames, CLOTH.faces, 1.0), CLOTH.vertices, bodies, PARTS, LIMIT, Job())
    first, second = (frame["parts"] for frame in report["frames"])
    assert second["lower"]["area_share"] == pytest.approx(first["lower"]["area_share"], abs=0.02)
