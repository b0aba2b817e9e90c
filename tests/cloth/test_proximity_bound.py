"""The proof that cloth stays out of its own reach: no counter-example by ipctk, and not refused without need."""

import ipctk
import numpy as np
import pytest
from cloth_scenes import sheet, tube
from moving_sheets import crumple, judge, ramp

from vto_pipeline.cloth.collision.self_collision.pieces import surface_components
from vto_pipeline.cloth.collision.self_collision.proximity_bound import prove_separation


def proven(faces, start, end, thickness):
    return prove_separation(surface_components(faces, len(start)), start, end, np.full(len(start), 0.5 * thickness))


def comes_near(faces, points, thickness):
    """Whether ipctk finds features nearer than the thickness that share no vertex, or that cross."""
    surface, points = judge(faces, points), np.asfortranarray(points)
    found = ipctk.NormalCollisions()
    found.build(surface, points, thickness)
    return len(found) > 0 or ipctk.has_intersections(surface, points)


def slit(opening):
    """A flat sheet cut from the rim to its middle, the far lip turned away by so much of its length."""
    mesh = sheet(9, 9, 1.0, 1.0, upright=False)
    points, faces = mesh.vertices, mesh.faces
    cut = np.flatnonzero((np.abs(points[:, 2] - 0.5) < 1e-9) & (points[:, 0] < 0.49))
    twin = np.arange(len(points), dtype=np.int32)
    twin[cut] = len(points) + np.arange(len(cut))
    beyond = points[faces].mean(axis=1)[:, 2] > 0.5
    turned = points[cut] + np.outer(0.5 - points[cut, 0], [0.0, 0.0, opening])
    return np.vstack([points, turned]), np.where(beyond[:, None], twin[faces], faces).astype(np.int32)


def holed(faces, points, rng):
    """The faces without those in a random disc: a hole, or a cut from the rim."""
    away = np.linalg.norm(points[faces].mean(axis=1)[:, [0, 2]] - rng.uniform(-1, 1, 2), axis=1)
    return np.ascontiguousarray(faces[away > rng.uniform(0, 0.4)])


def random_step(seed):
    """Faces, the begin and end of a step of a piece that may wind, close, fold, be cut or holed, and a thickness."""
    rng = np.random.default_rng(seed)
    kind = ("ring", "slit", "ramp", "sheet")[seed % 4]
    thickness = rng.choice([1e-4, 0.01, 0.03])
    if kind == "ring":  # its ends come together, side by side or one over the other
        shape = int(rng.integers(12, 24)), 2, rng.uniform(0.2, 0.7), 1.0, rng.choice([0.0, 0.02]), 0.0
        (start, faces), (end, _) = (ramp(turns, *shape) for turns in rng.uniform(0.93, 1.02, 2))
    elif kind == "slit":
        (start, faces), (end, _) = (slit(opening) for opening in rng.uniform(-0.03, 0.25, 2))
    elif kind == "ramp":
        turns = rng.uniform(0.6, 2.2)
        shape = rng.uniform(0.1, 0.8), 1.0, rng.choice([0.0, 0.02, 0.2]), rng.choice([0.0, 0.03, 0.1])
        start, faces = ramp(turns, int(16 * turns), 3, *shape)
        end = crumple(start, rng.choice([0.01, 0.1]), seed + 1)
    else:
        mesh = sheet(9, 9, 1.0, 1.0, upright=False)
        faces = holed(mesh.faces, mesh.vertices, rng)
        start = crumple(mesh.vertices, rng.choice([0.03, 0.1, 0.3]), seed)
        end = crumple(start, rng.choice([0.01, 0.1, 0.3]), seed + 1)
    noise = rng.choice([0.0, 0.005, 0.02])
    return faces, *(x + noise * rng.normal(size=x.shape) for x in (start, end)), thickness


def test_no_counter_example():
    certain = wrong = 0
    for seed in range(400):
        faces, start, end, thickness = random_step(seed)
        if not proven(faces, start, end, thickness).out:
            continue
        certain += 1
        wrong += any(comes_near(faces, start + t * (end - start), thickness) for t in np.linspace(0, 1, 5))
    assert wrong == 0
    assert 40 < certain < 300  # the proof holds for many of them, and not for all


def test_two_sheets_that_change_places_across_a_slit():
    """Both show one side and have simple rims far apart; yet on the way about an end of the slit they must cross."""
    big, small = (sheet(n, n, side, side, upright=False) for n, side in ((13, 1.2), (9, 0.8)))
    points = np.vstack([big.vertices, small.vertices + np.array([0.2, 0.05, 0.2])])
    at = 13 * 6 + np.arange(3, 10)  # the middle row
    under = len(big.vertices) + 9 * 4 + np.arange(1, 8)
    swap = np.arange(len(points), dtype=np.int32)
    swap[at[1:-1]], swap[under[1:-1]] = under[1:-1], at[1:-1]
    faces = np.vstack([big.faces, small.faces + len(big.vertices)])
    beyond = points[faces].mean(axis=1)[:, 2] > 0.6
    faces = np.where(beyond[:, None], swap[faces], faces)
    faces[faces == under[0]], faces[faces == under[-1]] = at[0], at[-1]
    faces = faces.astype(np.int32)
    assert comes_near(faces, points, 1e-4)
    found = proven(faces, points, points, 1e-4)
    assert not found.out
    assert "around" in found.why


@pytest.mark.parametrize("turns", [0.9, 1.1, 2.0])
@pytest.mark.parametrize("rise", [0.001, 0.1])
def test_a_ramp_shows_one_side_everywhere_and_yet_covers_itself(turns, rise):
    points, faces = ramp(turns, 40, 5, 0.5, 1.0, rise, 0.0)
    assert proven(faces, points, points, 1e-4).out == (turns < 1.0)


def test_a_coil_on_the_floor_is_flat_and_yet_near_itself():
    points, faces = ramp(2.5, 90, 2, 0.5, 0.6, 0.0, 0.02)  # 126 mm further out with each turn, 100 mm wide
    assert proven(faces, points, points, 0.02).out
    found = proven(faces, points, points, 0.03)
    assert not found.out
    assert "rim" in found.why


def test_the_gap_of_a_ring_is_measured():
    points, faces = ramp(0.99, 20, 2, 0.5, 1.0, 0.0, 0.0)
    gap = 2 * 0.5 * np.sin(0.01 * np.pi)  # between the inner corners of the two ends
    assert proven(faces, points, points, 0.9 * gap).out
    assert not proven(faces, points, points, 1.01 * gap).out


def test_a_swing_is_free_until_a_panel_stands_too_steep():
    """A flat panel turned by an angle: its altitudes in the projection of the whole shrink with the cosine."""
    mesh = sheet(3, 9, 0.2, 0.8, upright=False)
    edge, thickness = 0.1, 0.02
    steepest = np.arccos(2 * thickness / np.sqrt(edge**2 - 4 * thickness**2))  # legs e and e cos
    for share, out in ((0.98, True), (1.02, False)):
        bent = mesh.vertices.copy()
        z = np.abs(bent[:, 2] - 0.4)
        bent[:, 1], bent[:, 2] = -z * np.sin(share * steepest), (bent[:, 2] - 0.4) * np.cos(share * steepest)
        assert proven(mesh.faces, bent, bent, thickness).out == out  # a roof: its mean normal is plumb


def test_a_step_is_judged_between_its_ends():
    """A sheet that is turned inside out on straight ways is flat and open at both ends, and a line between them."""
    mesh = sheet(5, 5, 1.0, 1.0, upright=False)
    other = mesh.vertices * [-1.0, 1.0, -1.0] + [1.0, 0.0, 1.0]  # half a turn in its plane: both ends show one side
    assert proven(mesh.faces, mesh.vertices, mesh.vertices, 1e-3).out
    assert proven(mesh.faces, other, other, 1e-3).out
    assert not proven(mesh.faces, mesh.vertices, other, 1e-3).out
    angle = np.radians(170)  # on straight ways it shrinks to a twelfth
    turned = mesh.vertices @ np.array(
        [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    )
    assert "folds" in proven(mesh.faces, mesh.vertices, turned, 0.02).why
    assert proven(mesh.faces, turned, turned, 0.02).out


@pytest.mark.parametrize("speed", [0.0, 5.0])
def test_a_flat_hanging_cloth_is_free(speed):
    mesh = sheet(32, 32, 1.0, 1.0)
    swing = mesh.vertices + np.outer(mesh.vertices[:, 1] ** 2, [0.0, 0.0, 0.3])
    end = swing + speed / 60 * np.outer(mesh.vertices[:, 1], [0.0, 0.1, 1.0])
    assert proven(mesh.faces, swing, end, 1e-3).out
    assert proven(mesh.faces, swing + 1e4, end + 1e4, 1e-3).out
    assert proven(mesh.faces, mesh.vertices, 1.5 * mesh.vertices, 1e-3).out  # edges in line, whose boxes overlap


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("folded", "folds"),
        ("closed", "folds"),
        ("notch", "notch"),
        ("near pieces", "pieces"),
        ("fin", "edge"),
        ("pinched", "vertex"),
        ("finer than thick", "folds"),
    ],
)
def test_why_not(name, why):
    mesh = sheet(9, 9, 1.0, 1.0, upright=False)
    points, faces, thickness = mesh.vertices.copy(), mesh.faces, 1e-3
    if name == "folded":
        points = np.column_stack([np.sin(4 * points[:, 0]), np.cos(4 * points[:, 0]), points[:, 2]]) / 4
    elif name == "closed":
        faces = tube(0.3, 1.0, 27, 3).faces
        points = tube(0.3, 1.0, 27, 3).vertices
    elif name == "notch":
        points, faces = slit(0.15)
    elif name == "near pieces":
        points, faces = (
            np.vstack([points, points + np.array([0.0, 1e-4, 0.0])]),
            np.vstack([faces, faces + len(points)]),
        )
    elif name == "fin":
        points, faces = np.vstack([points, [[0.5, 1.0, 0.5]]]), np.vstack([faces, [[*faces[60][:2], len(points)]]])
    elif name == "pinched":
        points = np.vstack([points, points[:2] - [0.2, 0.0, 0.2]])
        faces = np.vstack([faces, [[0, len(points) - 2, len(points) - 1]]])
    else:
        thickness = 0.1
    found = proven(faces.astype(np.int32), points, points, thickness)
    assert not found.out
    assert why in found.why


def test_pieces_apart_and_a_hole():
    mesh = sheet(9, 9, 1.0, 1.0, upright=False)
    ring = mesh.faces[np.linalg.norm(mesh.vertices[mesh.faces].mean(axis=1)[:, [0, 2]] - 0.5, axis=1) > 0.2]
    points = np.vstack([mesh.vertices, mesh.vertices + np.array([0.0, 0.01, 0.0])])
    faces = np.ascontiguousarray(np.vstack([ring, mesh.faces + len(mesh.vertices)]))
    assert len(surface_components(faces, len(points)).piece_of_loop) == 3
    assert proven(faces, points, points, 0.009).out
    assert not proven(faces, points, points, 0.011).out
