"""Grading: measures grow as the standard's table and the rules say, seams still match, darts and grain are kept."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from size_shapes import FOREIGN, foreign, polygon, sewn, skirt, tee, trousers

from vto_pipeline.errors import GarmentError, InputError
from vto_pipeline.garment.pattern.figures import seam_figures
from vto_pipeline.garment.sizes.flat import flat_measurements
from vto_pipeline.garment.sizes.grade import grade
from vto_pipeline.garment.sizes.rules import guess_rules, read_rules
from vto_pipeline.io.patterns.loops import edges_points
from vto_pipeline.model.pattern import Edge, InnerLine

RUN = ("S", "M", "L", "XL", "XXL")
BUST_CM = {"S": 86.0, "M": 94.0, "L": 102.5, "XL": 113.0, "XXL": 125.0}  # middles of EN 13402-3's ranges for women
COUNT = {"S": -1, "M": 0, "L": 1, "XL": 2, "XXL": 3}
NEAR_M = 1e-4  # of what a chart asks for; the bar is 3 mm


def graded(pattern, sizes=RUN, **changes):
    rules = guess_rules(pattern)[0].model_copy(update=changes)
    made, rows = grade(pattern, rules, "M", sizes)
    return {row.size: made.of_size(row.size) for row in rows}, rows


def flat(pattern):
    return {name: one.value for name, one in flat_measurements(pattern, guess_rules(pattern)[0]).items()}


def sides(pattern):
    return np.array([figure.lengths for figure in seam_figures(pattern)])


def panel(pattern, name):
    return next(one for one in pattern.panels if one.name == name)


def crosses(points):
    """Whether a closed polyline meets itself: every segment against every other, by orientation."""
    a, b = points, np.roll(points, -1, axis=0)

    def side(p, q, r):
        return np.sign((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]))

    return any(
        side(a[i], b[i], a[j]) * side(a[i], b[i], b[j]) < 0 and side(a[j], b[j], a[i]) * side(a[j], b[j], b[i]) < 0
        for i in range(len(a))
        for j in range(i + 2, len(a))
    )


@pytest.mark.parametrize("pattern", [tee(), skirt(), trousers()], ids=lambda one: one.name)
def test_measures_grow_by_the_table_of_the_standard_and_the_rules(pattern):
    rules = guess_rules(pattern)[0]
    made, _ = graded(pattern)
    was = flat(pattern)
    for size, one in made.items():
        found = flat(one)
        for name, share in rules.girth_shares.items():
            if name in was:
                step = share * 0.01 * (BUST_CM[size] - BUST_CM["M"]) / 2
                assert found[name] - was[name] == pytest.approx(step, abs=NEAR_M), (size, name)
        for name, step in rules.lengths_mm.items():
            assert found[name] - was[name] == pytest.approx(1e-3 * step * COUNT[size], abs=NEAR_M), (size, name)


@pytest.mark.parametrize("pattern", [tee(), skirt(), trousers()], ids=lambda one: one.name)
def test_both_sides_of_each_seam_stay_as_long_as_each_other(pattern):
    assert_allclose(*sides(pattern).T, rtol=0, atol=1e-12)
    for size, one in graded(pattern)[0].items():
        assert_allclose(*sides(one).T, rtol=0, atol=1e-7, err_msg=size)  # Newton's method ends at 1e-8
    assert max(row.mismatch for row in graded(pattern)[1]) < 1e-7


def test_gathers_keep_their_ratio():
    """A skirt of 120 cm gathered into a waistband of 72: wider by as much for each centimetre of the band."""
    band = [polygon(f"wb_{one}", [(0, 0), (0.36, 0), (0.36, 0.04), (0, 0.04)]) for one in ("front", "back")]
    cloth = [polygon(one, [(0, 0), (0.6, 0), (0.6, 0.5), (0, 0.5)]) for one in ("front", "back")]
    seams = [((one, 2), (f"wb_{one}", 0)) for one in ("front", "back")]
    seams += [((f"{s}front", a), (f"{s}back", b)) for s in ("", "wb_") for a, b in ((1, 3), (3, 1))]
    pattern = replace(skirt(), panels=(*cloth, *band), stitches=sewn(*seams))
    made, rows = graded(pattern)
    for size, one in made.items():
        lengths = sides(one)
        assert_allclose(lengths[:2, 0] / lengths[:2, 1], 0.6 / 0.36, rtol=1e-6, err_msg=size)
    assert flat(made["L"])["waist"] == pytest.approx(0.36 + 0.085 / 2, abs=NEAR_M)
    assert max(row.mismatch for row in rows) < 1e-6


def test_a_mismatch_that_no_grading_can_avoid_is_reported():
    """A size in the file that was drawn wrong: its side seam is 2 cm longer in front than behind."""
    good = replace(skirt(), panels=tuple(replace(one, size="M") for one in skirt().panels))
    wrong = tuple(replace(one, size="L") for one in (skirt(length=0.62).panels[0], skirt().panels[1]))
    made, rows = graded(replace(good, panels=(*good.panels, *wrong)))
    assert [row.made for row in rows] == ["graded", "base", "from the file", "graded", "graded"]
    assert rows[2].mismatch == pytest.approx(0.02, rel=0.01)
    assert_allclose(panel(made["L"], "front").edges[0].points, wrong[0].edges[0].points, rtol=0, atol=0)


def test_darts_are_moved_whole():
    for size, one in graded(skirt())[0].items():
        front, was = panel(one, "front"), panel(skirt(), "front")
        legs = [np.concatenate([p.edges[k].points for k in (3, 4)]) for p in (front, was)]
        moved = legs[0] - legs[1]
        assert_allclose(moved, np.tile(moved[0], (4, 1)), rtol=0, atol=1e-6, err_msg=size)


def test_grain_keeps_its_direction_notches_their_share_and_a_cut_line_its_distance():
    pattern = tee()
    front = pattern.panels[0]
    corners = np.stack([edge.points[0] for edge in front.edges])
    out = np.array([(0.01, -0.01) if x > 0 else (-0.01, -0.01) for x, _ in corners])
    around = corners + np.where(corners[:, 1:] > 0.1, out * [1, -1], out)
    cut = tuple(Edge("polyline", np.stack(pair)) for pair in zip(around, np.roll(around, -1, axis=0), strict=True))
    pocket = InnerLine("internal", (Edge("polyline", np.array([[-0.05, 0.3], [0.05, 0.3]])),))
    drills = np.array([[0.0, 0.3]])
    pattern = replace(pattern, panels=(replace(front, cut=cut, lines=(pocket,), drills=drills), *pattern.panels[1:]))
    for size, one in graded(pattern)[0].items():
        new = panel(one, "front")
        assert_allclose(np.diff(new.grain, axis=0), np.diff(front.grain, axis=0), rtol=0, atol=1e-12)
        side = new.edges[1].points
        assert_allclose(new.notches[0].position, side.mean(axis=0), rtol=0, atol=1e-6, err_msg=size)
        starts = np.stack([edge.points[0] for edge in new.edges])
        assert_allclose(np.stack([e.points[0] for e in new.cut]) - starts, around - corners, rtol=0, atol=2e-3)
        ends = new.lines[0].curves[0].points
        assert ends[0, 0] == pytest.approx(-ends[1, 0], abs=1e-6)  # still in the middle
        assert new.drills[0] == pytest.approx(ends.mean(axis=0), abs=1e-3)
    small, large = (panel(graded(pattern)[0][size], "front").lines[0].curves[0].points for size in ("S", "XXL"))
    assert np.ptp(small[:, 0]) < 0.1 < np.ptp(large[:, 0])


def test_inner_points_move_as_the_outline_does_where_that_is_linear():
    """Mean value coordinates reproduce linear maps: a rectangle twice as wide takes its middle third along."""
    from vto_pipeline.garment.sizes.morph import moved_panel

    box = polygon("box", [(0, 0), (1, 0), (1, 2), (0, 2)])
    inside = np.array([[1 / 3, 0.2], [0.9, 1.7], [0.5, 1.0]])
    wide = moved_panel(replace(box, drills=inside), np.array([[0, 0], [1, 0], [1, 0], [0, 0]], float), "L")
    assert_allclose(wide.drills, inside * [2, 1], rtol=0, atol=1e-12)


def test_what_cannot_be_graded_is_refused_with_its_panel():
    yoke = polygon("back_yoke", [(0, 0), (0.4, 0), (0.4, 0.1), (0, 0.1)])
    seam = sewn((("back_yoke", 0), ("back", 3)))
    pattern = replace(tee(), panels=(*tee().panels, yoke), stitches=(*tee().stitches, *seam))
    with pytest.raises(GarmentError, match="'back_yoke': 0 corners between armhole and side"):
        graded(pattern)
    with pytest.raises(InputError, match="no size 'M'"):
        graded(replace(tee(), panels=tuple(replace(one, size="40") for one in tee().panels)))
    with pytest.raises(InputError, match="'MEDIUM' is not known"):
        graded(tee(), ("MEDIUM",))
    with pytest.raises(GarmentError, match="fold over itself in size S"):
        graded(tee(), ("S",), girth_shares={"chest": 10, "hem": 20})


TEMPLATES = sorted(FOREIGN.rglob("*.json"))


@pytest.mark.real_data
@pytest.mark.skipif(not TEMPLATES, reason="shared data absent")
@pytest.mark.parametrize("path", TEMPLATES, ids=lambda path: path.stem)
def test_templates_of_others_are_graded(path):
    pattern = foreign(json.loads(path.read_text()), path.stem)
    made, rows = graded(pattern, ("S", "XXL"))
    before = sides(pattern)
    for row in rows:
        for name, value in row.asked.items():
            assert row.flat[name].value == pytest.approx(value, abs=NEAR_M), (row.size, name)
        assert_allclose(
            sides(made[row.size])[:, 0] * before[:, 1], sides(made[row.size])[:, 1] * before[:, 0], rtol=1e-5
        )
        assert not any(crosses(edges_points(one.edges, 5e-3)[:-1]) for one in made[row.size].panels), row.size


def test_the_base_comes_back_as_it_was():
    made, (row,) = graded(tee(), ("M",))
    assert row.made == "base"
    for one, was in zip(made["M"].panels, tee().panels, strict=True):
        for edge, before in zip(one.edges, was.edges, strict=True):
            assert (edge.points == before.points).all()
    assert read_rules("top").sex == "female"
