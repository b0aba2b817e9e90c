"""A web across an armpit of known shape is cut back to where photos do not show the wall through it.

The photos are drawn pixel by pixel from the shape's formula; no mesh is behind them.
"""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.garment.align import PosedPhotos
from vto_pipeline.garment.photographed.backdrop import ALONE, Backdrop, background_of, far_beyond
from vto_pipeline.garment.photographed.carved import BESIDE_RIM, REACH, carve_fillings
from vto_pipeline.garment.subtraction.color_model import usual_colors
from vto_pipeline.geometry.intersections import self_intersections
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_loops
from vto_pipeline.model.camera import CameraSet, Intrinsics
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

STEEP, HALF, LONG, TOP = 1.2, 0.12, 0.05, 0.06
"""The armpit's flanks; half its width, half its length and the height of what is above it [m]."""
SEEN = 0.03
"""Cloth nearer to the crease than this was not seen [m]."""
LENS = Intrinsics(400, 300, 900.0, 900.0, 199.5, 149.5)
PIXEL = 0.8 / 900.0
"""On the armpit [m]."""
PRINT = np.array([[200, 60, 90], [160, 90, 60], [190, 120, 40]], float)
WALL = np.array([[120.0, 130.0, 160.0], [110.0, 120.0, 150.0]])


def inside(points, deep=0.0):
    """Whether points (..., 3) are in arm, flank, and what is above: under a roof whose ridge runs along z."""
    x, y, z = np.moveaxis(points, -1, 0)
    return (np.abs(x) < HALF) & (np.abs(z) < LONG) & (y < TOP) & (y > deep - STEEP * np.abs(x))


def photographs(folder, angles, wall=WALL, shade=1.0, covered=False):
    """Photos along the crease, some degrees aside and from below; covered, they show nothing but cloth.

    The wall's colour is one of those given, by chance.
    """
    folder.mkdir()
    rng = np.random.default_rng(0)
    names, poses = [], []
    column, row = np.meshgrid(np.arange(LENS.width), np.arange(LENS.height))
    for k, (turn, rise) in enumerate(np.radians(angles)):
        away = np.array([np.sin(turn) * np.cos(rise), np.sin(rise), np.cos(turn) * np.cos(rise)])
        eye, ahead = 0.8 * away, -away
        right = np.cross(ahead, [0.0, 1.0, 0.0])
        right /= np.linalg.norm(right)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = np.column_stack([right, np.cross(ahead, right), ahead]), eye
        ray = np.stack([(column - LENS.cx) / LENS.fx, (row - LENS.cy) / LENS.fy, np.ones(column.shape)], -1)
        ray = ray @ pose[:3, :3].T
        hit = np.zeros(column.shape, bool)
        for depth in np.linspace(0.72, 0.88, 65):
            hit |= inside(eye + depth * ray)
        hit |= covered
        cloth, behind = (of[rng.integers(0, len(of), hit.shape)] for of in (PRINT, wall))
        picture = np.where(hit[..., None], cloth, behind)
        dark = np.where(hit & (np.abs(column - LENS.cx) < 30), shade, 1.0)
        picture = np.clip(picture * dark[..., None] + rng.normal(0, 3, picture.shape), 0, 255)
        names.append(f"{k:02}.png")
        poses.append(pose)
        cv2.imwrite(str(folder / names[-1]), picture[..., ::-1].astype(np.uint8))
    cameras = CameraSet(tuple(names), (LENS,) * len(names), np.array(poses))
    return PosedPhotos(tuple(folder / name for name in names), cameras)


ANGLES = [(0.0, -1.5), (5.0, -2.0), (-5.0, -3.0), (180.0, -1.5), (175.0, -3.0), (185.0, -2.0)]


@pytest.fixture(scope="module")
def photos(tmp_path_factory):
    return photographs(tmp_path_factory.mktemp("armpit") / "photos", ANGLES)


def webbed():
    """The cloth, flat where the armpit was not seen, and which vertices were."""
    x, z = np.meshgrid(np.linspace(-HALF, HALF, 97), np.linspace(-LONG, LONG, 41), indexing="ij")
    at = np.arange(x.size).reshape(x.shape)
    a, b, c, d = at[:-1, :-1].ravel(), at[:-1, 1:].ravel(), at[1:, 1:].ravel(), at[1:, :-1].ravel()
    faces = np.vstack([np.column_stack([a, c, b]), np.column_stack([a, d, c])])  # looking down
    observed = np.abs(x.ravel()) >= SEEN
    height = -STEEP * np.maximum(np.abs(x.ravel()), SEEN)
    sheet = np.column_stack([x.ravel(), height, z.ravel()])
    end = np.array([[0.0, 0.0], [HALF, -STEEP * HALF], [HALF, TOP], [-HALF, TOP], [-HALF, -STEEP * HALF]])
    ends = np.vstack([np.column_stack([end, np.full(5, side)]) for side in (-LONG, LONG)])  # front and back, seen
    fan = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4]])
    faces = np.vstack([faces, len(sheet) + fan, len(sheet) + 5 + fan[:, ::-1]])
    return TriangleMesh(np.vstack([sheet, ends]), faces), np.append(observed, np.ones(10, bool))


def bone():
    """Of the mannequin, well above the cloth."""
    corner = np.array([[x, y, z] for x in (-0.0187, 0.0187) for y in (0.02, 0.04) for z in (-0.0287, 0.0287)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return TriangleMesh(corner, np.array([face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]))


def carved(photos, form=None, least=0.001):
    mesh, observed = webbed()
    form = bone() if form is None else form
    job = Job()
    return mesh, observed, carve_fillings(mesh, observed, form, photos, SurfaceDistance(form), least, job), job


def off(mesh):
    """How far below the true cloth vertices are, square to its flank [m]."""
    x, y, _ = mesh.vertices.T
    return (-STEEP * np.abs(x) - y) / np.hypot(1.0, STEEP)


@pytest.mark.parametrize("shade", [1.0, 0.45])
def test_a_web_is_cut_back_to_the_crease(tmp_path, shade):
    """Also where the cloth lies in a shadow in which none was seen."""
    mesh, observed, found, job = carved(photographs(tmp_path / "photos", ANGLES, shade=shade))
    assert off(mesh)[~observed].max() > 0.02
    left = off(found)[~observed]
    inner = np.abs(mesh.vertices[~observed, 2]) < LONG - BESIDE_RIM  # the rest is beside a border
    assert np.percentile(left[inner], 95) < 4.0 * PIXEL
    assert np.percentile(left[inner], 50) < 1.0 * PIXEL
    assert left.min() > -2.0 * PIXEL
    rim = np.concatenate(boundary_loops(mesh))
    assert_array_equal(found.vertices[observed], mesh.vertices[observed])
    assert_array_equal(found.vertices[rim], mesh.vertices[rim])
    assert_array_equal(found.faces, mesh.faces)
    assert len(self_intersections(found)) <= len(self_intersections(mesh))  # the ends touch the sheet
    assert job.metrics["carving_photos"] == len(ANGLES)
    went = np.linalg.norm(found.vertices - mesh.vertices, axis=1) > 0.0
    assert 0.3 * went.sum() < job.metrics["carved_vertices"] <= went.sum()  # the others followed
    assert 15.0 < job.metrics["carved_p95_mm"] <= 1e3 * REACH


def test_the_same_bits_on_one_core(photos, monkeypatch):
    _, _, found, _ = carved(photos)
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    assert carved(photos)[2].vertices.tobytes() == found.vertices.tobytes()


def test_what_is_right_stays(photos):
    """Cloth where it truly is hides no wall."""
    mesh, observed = webbed()
    right = mesh.vertices.copy()
    right[~observed, 1] = -STEEP * np.abs(right[~observed, 0])
    right = TriangleMesh(right, mesh.faces)
    found = carve_fillings(right, observed, bone(), photos, SurfaceDistance(bone()), 0.001, Job())
    assert np.linalg.norm(found.vertices - right.vertices, axis=1).max() < 1.5 * PIXEL


def test_nothing_comes_nearer_to_the_mannequin_than_it_may(photos):
    form = TriangleMesh(bone().vertices - [0.0, 0.0353, 0.0], bone().faces)  # from 15 mm below the crease up
    _, observed, found, _ = carved(photos, form, 0.003)
    corners = np.unique(found.faces[~observed[found.faces].all(axis=1)])
    away = SurfaceDistance(form).signed(found.vertices[corners]).distance
    assert 0.003 - 1e-5 < away.min() < 0.005


def test_a_wall_of_the_cloths_colours_changes_nothing(tmp_path):
    mesh, _, found, job = carved(photographs(tmp_path / "photos", ANGLES, wall=PRINT))
    assert found is mesh
    assert [what for what, _ in job.left_out] == ["fillings cut back"]


def test_cloth_before_the_wall_changes_nothing(tmp_path):
    """The web is real: it shows in every photo."""
    mesh, _, found, job = carved(photographs(tmp_path / "photos", ANGLES, covered=True))
    assert_array_equal(found.vertices, mesh.vertices)
    assert job.metrics.get("carved_vertices", 0) == 0


def test_one_photo_alone_is_held_to_be_off():
    """Backgrounds below a level line, seen from the front: how far below it a point lies, in closed form."""
    row = np.arange(LENS.height, dtype=np.float32)[:, None]

    def below(line):
        beyond = np.broadcast_to(row - np.float32(line), (LENS.height, LENS.width))
        return Backdrop(beyond, LENS, np.eye(4))

    points = np.array([[0.0, y, 0.9] for y in (-0.02, 0.0, 0.004, 0.02)] + [[0.0, 0.0, -0.9], [9.0, 0.0, 0.9]])
    at = LENS.cy + LENS.fy * points[:4, 1] / 0.9
    one, other = 140.0, 155.0
    metres = 0.9 / LENS.fx
    assert_allclose(far_beyond(points, [below(one)])[:4], (at - one) * metres - ALONE, atol=1e-7)
    both = np.maximum((at - other) * metres, (at - one) * metres - ALONE)
    for pair in ([below(one), below(other)], [below(other), below(one)]):
        assert_allclose(far_beyond(points, pair)[:4], both, atol=1e-7)
    assert (far_beyond(points, [below(one), below(other)])[4:] == -np.inf).all()


def test_background_must_hang_together():
    """Wall to the left, cloth to the right, and a filling between: what shows the wall there, and reaches it."""
    rng = np.random.default_rng(0)
    column, row = np.meshgrid(np.arange(90), np.arange(80))
    cloth, whole = column >= 60, column >= 30
    bay = (column < 45) & (row > 20) & (row < 30)
    patch = (np.abs(column - 45) < 6) & (np.abs(row - 55) < 6)
    shows = ~whole | bay | patch
    colors = np.where(shows[..., None], WALL[0], PRINT[rng.integers(0, 3, shows.shape)])
    picture = np.clip(colors + rng.normal(0, 3, colors.shape), 0, 255).astype(np.uint8)
    found = background_of(picture, cloth, np.zeros_like(cloth), whole)
    inner = cv2.erode((whole & bay).astype(np.uint8), np.ones((3, 3))) > 0  # a pixel of a border may go either way
    assert found[~whole].all()
    assert found[inner].all()
    assert not found[patch].any()
    outside = cv2.dilate((~whole | bay).astype(np.uint8), np.ones((3, 3))) == 0
    assert not found[outside].any()
    assert background_of(picture, cloth, whole & ~cloth, whole) is None  # the mannequin hides all that is asked


def test_a_colour_that_neither_has_is_of_neither():
    wall, cloth = np.full((400, 3), 128), np.full((400, 3), [200, 60, 90])
    rng = np.random.default_rng(0)
    known = np.clip(np.vstack([wall, cloth]) + rng.normal(0, 4, (800, 3)), 0, 255)
    asked = [[128, 128, 128], [200, 60, 90], [20, 220, 20], [70, 20, 30], [104, 104, 104]]
    colors = np.vstack([known, asked]).astype(np.uint8)  # the last: a wall in a shadow that none of it lies in
    kind = np.repeat([0, 1, 2], [400, 400, 5])
    usual = usual_colors(colors, kind == 0, kind == 1, 40, 5.0, 1.0)
    assert_array_equal(usual[-5:], [True, False, False, False, False])
    assert 0.9 < usual[:400].mean() <= 1.0
    assert not usual[400:800].any()


def test_no_way_is_longer_than_its_reach(photos):
    mesh, observed, found, _ = carved(photos)
    assert np.linalg.norm(found.vertices - mesh.vertices, axis=1).max() <= REACH + 1e-9
    assert observed.sum() > 0
