"""Pieces by a plan: trousers and a skirt of known measures from one drawn leg and one drawn half, by others' SVG."""

from __future__ import annotations

import ipctk
import numpy as np
import pytest
import yaml
from size_shapes import polygon

from vto_pipeline.errors import InputError
from vto_pipeline.garment.pattern.embed import in_shape
from vto_pipeline.garment.pattern.figures import seam_figures
from vto_pipeline.garment.pattern.planned import planned
from vto_pipeline.garment.pattern.sew import SewConfig, sew
from vto_pipeline.geometry.topology import boundary_loops
from vto_pipeline.io.patterns.loops import edges_area
from vto_pipeline.io.patterns.read import read_pattern
from vto_pipeline.io.patterns.sewing_plan import SewingPlan, read_sewing_plan
from vto_pipeline.model.job import Job
from vto_pipeline.model.pattern import Edge, InnerLine, Notch, Pattern

# mm, y down as in SVG: a leg's hem, inseam, crotch, waist and outseam; and half a skirt, its fold on the left
LEG = [(0, 1000), (220, 1000), (240, 950), (240, 250), (180, 220), (180, 0), (-20, 0), (-20, 250)]
HALF = [(0, 600), (350, 600), (312.5, 450), (200, 0), (0, 0)]
LEG_M2 = 5e-7 * sum(a * d - b * c for (a, b), (c, d) in zip(LEG[1:] + LEG[:1], LEG, strict=True))


def drawn(tmp_path):
    """Both as a drawing program writes them."""
    paths = [
        f'<path id="{name}" d="M{" L".join(f"{x + shift},{y}" for x, y in corners)} Z"/>'
        for name, corners, shift in (("leg", LEG, 100), ("half", HALF, 900))
    ]
    head = 'xmlns="http://www.w3.org/2000/svg" width="2000mm" height="1100mm" viewBox="0 0 2000 1100"'
    (tmp_path / "d.svg").write_text(f"<svg {head}>{''.join(paths)}</svg>")
    return read_pattern(tmp_path / "d.svg")


def plan(tmp_path, panels, seams):
    (tmp_path / "p.yaml").write_text(yaml.safe_dump({"schema": 1, "panels": panels, "seams": seams}, sort_keys=False))
    return read_sewing_plan(tmp_path / "p.yaml")


def numbered(pattern, name, corners, start, end):
    """The number of a drawn panel's edge by its ends: corners as listed, mm from the panel's own left and top."""
    (panel,) = (one for one in pattern.panels if one.name == name)
    points = 1e3 * np.array([edge.points[[0, -1]] for edge in panel.edges])
    low, high = points.reshape(-1, 2).min(axis=0), points.reshape(-1, 2).max(axis=0)
    left = min(x for x, _ in corners)
    wanted = np.array([(corners[k][0] - left + low[0], high[1] - corners[k][1]) for k in (start, end)])
    off = np.abs(np.sort(points, axis=1) - np.sort(wanted, axis=0)).max(axis=(1, 2))
    (number,) = np.flatnonzero(off < 0.1)
    return int(number)


def openings(pattern):
    job = Job()
    mesh = in_shape(sew(pattern, SewConfig(edge_mm=30.0), job), job)
    return mesh, boundary_loops(mesh)


def test_a_half_cut_on_the_fold_makes_a_skirt(tmp_path):
    pattern = drawn(tmp_path)
    fold, low, high = (numbered(pattern, "half", HALF, *ends) for ends in ((4, 0), (1, 2), (2, 3)))
    place = {"of": "half", "fold": fold, "at_m": [0.0, 0.7]}
    up, down = [f" {low}", f" {high}"], [f" {high} mirrored", f" {low} mirrored"]
    seams = [
        {"first": ["front" + one for one in up], "second": ["back" + one for one in reversed(down)]},
        {"first": ["front" + one for one in down], "second": ["back" + one for one in reversed(up)]},
    ]
    made = planned(pattern, plan(tmp_path, {"front": place, "back": place}, seams), Job())
    assert [edges_area(one.edges) for one in made.panels] == pytest.approx([2 * 0.6 * 0.275] * 2)
    assert max(abs(seam.mismatch) for seam in seam_figures(made)) < 1e-9
    mesh, loops = openings(made)
    cloth = ipctk.CollisionMesh(mesh.vertices, ipctk.edges(mesh.faces), mesh.faces)
    assert not ipctk.has_intersections(cloth, np.asfortranarray(mesh.vertices))
    ends = [(mesh.vertices[loop], mesh.vertices[np.roll(loop, 1)]) for loop in loops]
    rims = sorted(float(np.linalg.norm(a - b, axis=1).sum()) for a, b in ends)
    assert rims == pytest.approx([0.8, 1.4], rel=0.02)  # waist and hem
    front, back = made.panels
    assert front.placement.rotation[:, 2] == pytest.approx([0.0, 0.0, 1.0])  # by its name
    assert back.placement.rotation[:, 2] == pytest.approx([0.0, 0.0, -1.0])


def test_one_leg_cut_four_times_two_of_them_mirrored_makes_trousers(tmp_path):
    pattern = drawn(tmp_path)

    def edge(start, end):
        return numbered(pattern, "leg", LEG, start, end)

    inner, crotch, outer = [edge(1, 2), edge(2, 3)], [edge(3, 4), edge(4, 5)], [edge(6, 7), edge(7, 0)]
    panels = {
        "left_front": {"of": "leg", "stands": "front", "mirrored": True, "at_m": [0.13, 0.6]},
        "right_front": {"of": "leg", "stands": "front", "at_m": [-0.13, 0.6]},
        "left_back": {"of": "leg", "stands": "back", "at_m": [-0.13, 0.6]},
        "right_back": {"of": "leg", "stands": "back", "mirrored": True, "at_m": [0.13, 0.6]},
    }

    def seam(first, second, edges):
        return {"first": [f"{first} {k}" for k in edges], "second": [f"{second} {k}" for k in edges]}

    seams = [
        seam("right_front", "left_front", crotch),
        seam("left_back", "right_back", crotch),
        *(seam("right_front", "right_back", edges) for edges in (inner, outer)),
        *(seam("left_back", "left_front", edges) for edges in (inner, outer)),
    ]
    made = planned(pattern, plan(tmp_path, panels, seams), job := Job())
    assert [edges_area(one.edges) for one in made.panels] == pytest.approx([LEG_M2] * 4)
    assert len(openings(made)[1]) == 3
    assert job.notes == ["panels that the plan does not name, left out: half"]
    left, right = (
        np.array([e.points[0] for e in one.edges]) @ one.placement.rotation[:, :2].T + one.placement.translation
        for one in made.panels[:2]
    )
    assert sorted(map(tuple, np.round(left * [-1, 1, 1], 9))) == sorted(map(tuple, np.round(right, 9)))
    middle = 0.5 * (left.min(axis=0) + left.max(axis=0))
    assert middle == pytest.approx([0.13, 0.6, 0.15])


def test_a_piece_is_turned_as_it_is_seen(tmp_path):
    upright = planned(drawn(tmp_path), plan(tmp_path, {"back": {"of": "half", "at_m": [0.2, 1.0]}}, []), Job())
    turned = {"back": {"of": "half", "at_m": [0.2, 1.0], "turned_deg": 90.0, "away_m": 0.3}}
    (panel,) = planned(drawn(tmp_path), plan(tmp_path, turned, []), Job()).panels
    seen = []
    for one in (*upright.panels, panel):
        points = (
            np.array([e.points[0] for e in one.edges]) @ one.placement.rotation[:, :2].T + one.placement.translation
        )
        seen.append(points * [-1.0, 1.0, -1.0])  # from behind
    (x, y), (u, v) = ((points - [0.2, 1.0, 0.0])[:, :2].T for points in seen)
    assert np.stack([u, v]) == pytest.approx(np.stack([-y, x]))  # a quarter turn anticlockwise about its middle
    assert [points[:, 2] for points in seen] == [pytest.approx([0.15] * 5), pytest.approx([0.3] * 5)]


@pytest.mark.parametrize(
    ("panels", "seam", "said"),
    [
        ({"front": {"at_m": [0, 1]}}, None, "panels.front: no panel 'front'; there are half, leg"),
        ({"sleeve": {"of": "leg", "at_m": [0, 1]}}, None, "panels.sleeve: its name has none of front, back"),
        ({"front": {"of": "leg", "fold": 9, "at_m": [0, 1]}}, None, "panels.front.fold: no edge 9; the panel has 8"),
        ({"front": {"of": "leg", "fold": 3, "at_m": [0, 1]}}, None, "or the panel lies on both sides"),
        ({"front": {"of": "leg", "at_m": [0, 1]}}, "front 8", "'front 8': front has no such edge; there are 0, 1, 2"),
        ({"front": {"of": "leg", "at_m": [0, 1]}}, "front 1 mirrored", "front has no such edge"),
        ({"front": {"of": "leg", "at_m": [0, 1]}}, "back 1", "'back 1'; expected a piece and the number"),
    ],
)
def test_what_a_plan_gets_wrong_is_named(tmp_path, panels, seam, said):
    seams = [] if seam is None else [{"first": ["front 0"], "second": [seam]}]
    with pytest.raises(InputError) as refused:
        planned(drawn(tmp_path), plan(tmp_path, panels, seams), Job())
    assert said in refused.value.problem


def test_what_is_in_a_panel_is_turned_over_with_it():
    square = np.array([[0.0, 0.0], [0.4, 0.0], [0.4, 0.5], [0.0, 0.6]])
    pocket = Edge("polyline", np.array([[0.1, 0.1], [0.2, 0.15]]))
    panel = polygon(
        "front",
        square,
        grain=np.array([[0.3, 0.1], [0.2, 0.5]]),
        notches=(Notch(np.array([0.4, 0.2]), np.deg2rad(170.0)),),
        lines=(InnerLine("internal", (pocket,)),),
        drills=np.array([[0.1, 0.3]]),
        cut=polygon("cut", square * 1.1 - 0.01).edges,
    )
    wanted = SewingPlan.model_validate({"schema": 1, "panels": {"front": {"mirrored": True, "at_m": [0, 1]}}})
    (other,) = planned(Pattern("x", (panel,)), wanted, Job()).panels
    over = np.array([-1.0, 1.0])
    assert other.grain == pytest.approx(panel.grain * over)
    assert other.notches[0].position == pytest.approx([-0.4, 0.2])
    assert np.rad2deg(other.notches[0].angle) % 360.0 == pytest.approx(10.0)  # from the outline inwards, as before
    assert other.lines[0].curves[0].points == pytest.approx(pocket.points * over)
    assert other.drills == pytest.approx(panel.drills * over)
    assert edges_area(other.edges) == pytest.approx(0.22)
    assert edges_area(other.cut) == pytest.approx(0.22 * 1.1**2)
