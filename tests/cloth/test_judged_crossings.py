"""The judge's test of which triangles cross: by hand, by ipctk, in rationals, and against the solver's own."""

import ast
import time
from fractions import Fraction
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from cloth_scenes import ball, sheet
from ipc_judge import self_crosses
from numpy.testing import assert_array_equal
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

import vto_pipeline
from vto_pipeline.cloth.judge import crossings as judge
from vto_pipeline.cloth.judge.audit import audit
from vto_pipeline.cloth.judge.crossings import crossings_between, self_crossings
from vto_pipeline.geometry import intersections
from vto_pipeline.geometry.intersections import intersecting_faces, self_intersections
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh

PACKAGE = Path(vto_pipeline.__file__).parent


def both(one, other):
    return TriangleMesh(
        np.vstack([one.vertices, other.vertices]), np.vstack([one.faces, other.faces + len(one.vertices)])
    )


FLOOR = [[0, 0, 0], [4, 0, 0], [0, 4, 0]]
CASES = {
    "pierced in the middle": ([[1, 1, -1], [1, 1, 1], [2, 1, 2]], True),
    "beside": ([[5, 5, -1], [5, 5, 1], [6, 5, 2]], False),
    "above, by a hair": ([[1, 1, 1e-300], [2, 1, 1], [1, 2, 1]], False),
    "through, by a hair": ([[1, 1, -1e-300], [2, 1, 1], [1, 2, 1]], True),
    "touching with a corner": ([[1, 1, 0], [2, 1, 1], [1, 2, 1]], True),
    "touching at a corner": ([[0, 0, 0], [-1, -1, 1], [-1, 0, 1]], True),
    "edge on edge": ([[1, 0, 0], [3, 0, 0], [2, -1, 1]], True),
    "in one plane, inside": ([[1, 1, 0], [1.5, 1, 0], [1, 1.5, 0]], True),
    "in one plane, around": ([[-9, -9, 0], [30, -9, 0], [-9, 30, 0]], True),
    "in one plane, across": ([[-1, 1, 0], [5, 1, 0], [5, 1.5, 0]], True),
    "in one plane, apart": ([[5, 5, 0], [6, 5, 0], [5, 6, 0]], False),
    "in planes a hair apart": ([[1, 1, 1e-300], [1.5, 1, 1e-300], [1, 1.5, 1e-300]], False),
    "crossing the plane outside": ([[3, 3, -1], [3, 3, 1], [4, 4, 1]], False),
    "a line through it": ([[1, 1, -1], [1, 1, 1], [1, 1, 2]], True),
    "a line beside it": ([[3, 3, -1], [3, 3, 1], [3, 3, 2]], False),
    "a point in it": ([[1, 1, 0], [1, 1, 0], [1, 1, 0]], True),
    "a point over it": ([[1, 1, 1], [1, 1, 1], [1, 1, 1]], False),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("turn", range(3))
def test_two_triangles_by_hand(case, turn):
    corners, meet = CASES[case]
    floor, other = TriangleMesh(FLOOR, [[0, 1, 2]]), TriangleMesh(np.roll(corners, turn, axis=0), [[0, 1, 2]])
    assert len(crossings_between(floor, other)) == meet
    assert len(crossings_between(other, floor)) == meet
    assert len(self_crossings(both(floor, other))) == meet


@pytest.mark.parametrize(("hair", "meet"), [(1e-300, False), (0.0, True), (-1e-300, True)])
def test_in_one_plane_a_hair_beyond_a_slanting_edge(hair, meet):
    """No float sees such a gap, and only the direction across that edge shows it."""
    slanting = TriangleMesh([[-3, -1, 0], [3, 1, 0], [1, -5, 0]], [[0, 1, 2]])
    above = TriangleMesh([[0, hair, 0], [-1, 5, 0], [1, 5, 0]], [[0, 1, 2]])
    assert len(crossings_between(slanting, above)) == len(crossings_between(above, slanting)) == meet


def common_point(one, two):
    """Whether convex hulls have a point in common, by linear programming in its own arithmetic."""
    count = len(one), len(two)
    sums = np.zeros((2, sum(count)))
    sums[0, : count[0]], sums[1, count[0] :] = 1.0, 1.0
    equal = np.vstack([np.hstack([one.T, -two.T]), sums])
    return linprog(np.zeros(sum(count)), A_eq=equal, b_eq=[0, 0, 0, 1, 1], method="highs").status == 0


@pytest.mark.parametrize("seed", range(3))
def test_triangles_on_a_lattice_by_linear_programming(seed):
    """Corners among 27 points: every way of touching, of lying in one plane, on one line, in one point."""
    rng, found = np.random.default_rng(seed), []
    for _ in range(150):
        one, two = rng.integers(0, 3, (2, 3, 3)).astype(float)
        meshes = [TriangleMesh(corners, [[0, 1, 2]]) for corners in (one, two)]
        found.append(len(crossings_between(*meshes)) == 1)
        assert found[-1] == common_point(one, two), (one, two)
    assert 20 < sum(found) < 130


def test_a_random_soup_is_that_of_the_other_test():
    rng = np.random.default_rng(0)
    vertices = (rng.random((300, 1, 3)) + 0.1 * rng.normal(size=(300, 3, 3))).reshape(-1, 3)
    soup = TriangleMesh(vertices, np.arange(900).reshape(-1, 3))
    found = self_crossings(soup)
    assert 100 < len(found) < 10000
    assert_array_equal(found, self_intersections(soup))
    one, other = (TriangleMesh(vertices, soup.faces[part]) for part in (slice(0, 100), slice(100, 300)))
    assert_array_equal(crossings_between(one, other), intersecting_faces(one, other))


@pytest.mark.parametrize("seed", range(10))
def test_whether_a_crumpled_sheet_crosses_itself_as_ipctk_says(seed):
    """Neighbours that share a vertex included; the steeper the waves the likelier."""
    flat = sheet(15, 15, 1.0, 1.0)
    rng = np.random.default_rng(seed)
    waves = np.sin(flat.vertices @ rng.normal(size=(3, 3)) * 6 + rng.normal(size=3)) * rng.uniform(0.03, 0.3)
    mesh = TriangleMesh(flat.vertices + waves, flat.faces)
    assert (len(self_crossings(mesh)) > 0) == self_crosses(mesh)
    assert_array_equal(self_crossings(mesh), self_intersections(mesh))


@pytest.mark.parametrize("seed", range(10))
def test_whether_two_balls_meet_as_ipctk_says(seed):
    one, rng = ball(1.0, levels=3), np.random.default_rng(seed)
    turned = Rotation.random(random_state=seed).apply(one.vertices.copy())
    way = rng.normal(size=3)
    other = TriangleMesh(turned + 2.0 * (1.0 + rng.uniform(-0.02, 0.005)) * way / np.linalg.norm(way), one.faces)
    assert (len(crossings_between(one, other)) > 0) == self_crosses(both(one, other))


@pytest.mark.parametrize("turn", [(0, 0, 0), (0.3, 0.5, 0.7)])
def test_a_flat_sheet_does_not_cross_itself(turn):
    flat = sheet(25, 25, 1.0, 1.0)
    turned = TriangleMesh(Rotation.from_euler("xyz", turn).apply(flat.vertices.copy()), flat.faces)
    assert len(self_crossings(turned)) == 0


def test_faces_that_share_a_vertex_may_pass_through_each_other():
    vertices = np.array([[0, 0, 0], [2, 0, 0], [0, 2, 0], [1, 0.3, -1], [1, 0.4, 1]], float)
    for turn in range(3):
        faces = [[0, 1, 2], np.roll([0, 3, 4], turn)]
        assert_array_equal(self_crossings(TriangleMesh(vertices, faces)), [[0, 1]])
    away = np.vstack([vertices[:3], [[-1, -1, -1], [-1, -1, 1]]])
    assert len(self_crossings(TriangleMesh(away, faces))) == 0


@pytest.mark.parametrize("seed", range(5))
def test_what_floats_are_sure_of_is_so_in_rationals(seed):
    """Nearly flat, nearly touching pairs far from the origin: where floats answer they are right."""
    rng = np.random.default_rng(seed)
    one = rng.normal(size=(100, 3, 3)) * [1, 1, 1e-13] + 1e3
    two = one[:, [1, 2, 0]] + rng.normal(size=(100, 3, 3)) * rng.choice([1e-16, 1e-13, 1e-9, 1.0], (100, 1, 1))
    sure = judge._by_floats(one, two)
    assert 5 < (sure != 0).sum() < 100
    for k in np.flatnonzero(sure):
        assert judge._apart(one[k], two[k]) == (sure[k] < 0)


def test_whole_numbers_are_the_points_without_rounding():
    points = np.random.default_rng(0).normal(size=(50, 3)) * 10.0 ** np.arange(-25, 25)[:, None]
    points[3] = [0.0, -1e-300, 5e-324]
    whole = judge._in_whole_numbers(points)
    times = Fraction(whole[40][0]) / Fraction(points[40][0])
    assert [[Fraction(part) for part in point] for point in whole] == [
        [times * Fraction(part) for part in point] for point in points.tolist()
    ]


def test_a_shell_laid_on_its_own_faces_is_decided_in_seconds():
    """Floating point decides nothing there. Faces of a convex body meet where they share a vertex, and nowhere else."""
    shell = ball(1.0, levels=1)
    corners = [set(face) for face in shell.faces.tolist()]
    shared = [[a, b] for a, one in enumerate(corners) for b, other in enumerate(corners) if one & other]
    began = time.process_time()
    assert_array_equal(crossings_between(shell, shell), shared)
    assert time.process_time() - began < 0.02 * len(shared)


def test_the_judge_is_not_taken_in_by_the_solvers_test(monkeypatch):
    """With the solver's test blind to everything, crossings with the body and with itself are counted as before."""
    cloth, tangled, body = sheet(9, 9, 1.0, 1.0), sheet(9, 9, 1.0, 1.0), ball(0.3, levels=2)
    tangled = TriangleMesh(tangled.vertices * [1, 0.02, 1] + np.sin(9 * tangled.vertices[:, [1, 2, 0]]), tangled.faces)
    mesh = both(cloth, tangled)

    def judged():
        found = audit(mesh, RestShape(mesh.vertices), body, settled=True, energy=0.0, residual=0.0)
        return found["body_intersections"], found["self_intersections"]

    seen = judged()
    assert min(seen) > 0
    monkeypatch.setattr(intersections, "_triangles_meet", lambda vertices, faces, pairs: np.zeros(len(pairs), np.bool_))
    assert len(self_intersections(mesh)) == 0
    assert judged() == seen


def test_no_module_that_judges_asks_the_solvers_test():
    judges = [PACKAGE / "cloth" / "outfit" / "audit.py", PACKAGE / "bench" / "demo.py"]
    judges += (PACKAGE / "cloth" / "judge").glob("*.py")
    for path in judges:
        names = [node.module for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.ImportFrom)]
        assert not [name for name in names if name.endswith((".intersections", ".predicates", ".bvh", ".bvh_pairs"))]
    assert len(judges) > 8


def test_pairs_of_boxes_are_all_of_them():
    rng = np.random.default_rng(1)
    corners = rng.random((200, 1, 3)) + rng.uniform(0, 0.5, (200, 1, 1)) * rng.random((200, 3, 3))
    low, high = corners.min(axis=1), corners.max(axis=1)
    pairs = [(i, j) for i, j in combinations(range(200), 2) if (low[i] <= high[j]).all() and (low[j] <= high[i]).all()]
    assert sorted(map(tuple, judge._overlapping(corners, 200).tolist())) == pairs
    mixed = [(i, j) for i, j in pairs if (i < 70) != (j < 70)]
    assert sorted(map(tuple, judge._overlapping(corners, 70).tolist())) == mixed
    assert len(mixed) > 50
