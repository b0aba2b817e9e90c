"""Fillings against the sphere they were cut from, and triangulations against all there are."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import shapes
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.errors import GarmentError
from vto_pipeline.geometry.remeshing import holes
from vto_pipeline.geometry.remeshing.holes import fill_between, fill_holes, fill_notch
from vto_pipeline.geometry.remeshing.refine import refine
from vto_pipeline.geometry.remeshing.remesh import edge_lengths
from vto_pipeline.geometry.remeshing.repair import RepairConfig, is_manifold, repair
from vto_pipeline.geometry.remeshing.triangulate import triangulate_loop
from vto_pipeline.geometry.topology import (
    boundary_loops,
    boundary_walks,
    component_areas,
    edge_faces,
    edges,
    face_area_vectors,
    face_normals,
    half_edges,
    submesh,
)
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.cpu_threads import limited_threads


def ball_with_hole(subdivisions, angle):
    ball = shapes.sphere(subdivisions, radius=0.15)
    return submesh(ball, shapes.centers(ball)[:, 1] < 0.15 * np.cos(angle))[0]


def test_a_filled_sphere_is_round_and_rounder_the_smaller_the_hole():
    worst = []
    for angle in (0.4, 0.2):
        cut = ball_with_hole(5, angle)
        filled = fill_holes(cut, boundary_walks(cut))
        assert boundary_loops(filled) == []
        assert is_manifold(filled)
        assert_array_equal(filled.vertices[: len(cut.vertices)], cut.vertices)
        assert_array_equal(filled.faces[: len(cut.faces)], cut.faces)
        new = slice(len(cut.faces), None)
        outward = np.einsum("fd,fd->f", face_normals(filled)[new], shapes.centers(filled)[new]) / 0.15
        assert outward.min() > 0.9
        worst.append(np.abs(np.linalg.norm(filled.vertices[len(cut.vertices) :], axis=1) - 0.15).max())
    assert 1e-7 < worst[1] < 1e-4  # a 30 mm hole within 0.1 mm
    assert worst[0] < 3.5e-4  # 0.46 mm with the lengths of the flat filling
    assert worst[0] > 4.0 * worst[1]  # error grows with the fourth power of the hole in theory


def test_a_filling_is_as_fine_as_its_rim():
    cut = ball_with_hole(5, 0.4)
    filled = fill_holes(cut, boundary_walks(cut))
    patch = submesh(filled, np.arange(len(filled.faces)) >= len(cut.faces))[0]
    assert_allclose(np.median(edge_lengths(patch)), np.median(edge_lengths(cut)), rtol=0.2)


def finer_at_the_rim(cut, pieces):
    """The mesh with each edge of its rim in so many pieces, on its chord: its shape stays as it is."""
    vertices, faces = cut.vertices.tolist(), cut.faces.tolist()
    (walk,) = boundary_walks(cut)
    of_edge = {(face[k], face[(k + 1) % 3]): number for number, face in enumerate(faces) for k in range(3)}
    for start, end in half_edges(cut)[walk].tolist():
        number = of_edge[start, end]
        apex = next(corner for corner in faces[number] if corner not in (start, end))
        share = np.arange(1, pieces)[:, None] / pieces
        chain = [start, *range(len(vertices), len(vertices) + pieces - 1), end]
        vertices += (cut.vertices[start] + share * (cut.vertices[end] - cut.vertices[start])).tolist()
        fan = [[a, b, apex] for a, b in itertools.pairwise(chain)]
        faces[number] = fan[0]
        of_edge[end, apex] = len(faces) + len(fan) - 2  # a face with two edges on the rim is cut twice
        faces += fan[1:]
    return TriangleMesh(np.array(vertices), np.array(faces, np.int32))


def test_a_rim_finer_than_the_mesh_takes_half_the_edges_of_the_mesh_and_no_finer():
    """A thinned scan's rims are as fine as the scan was: filled as finely, most of its triangles would be fillings."""
    coarse = ball_with_hole(5, 0.4)
    fine = finer_at_the_rim(coarse, 16)
    assert is_manifold(fine)
    (walk,) = boundary_walks(fine)
    assert len(walk) == 16 * len(boundary_walks(coarse)[0])
    filled = fill_holes(fine, [walk])
    assert is_manifold(filled)
    new = filled.vertices[len(fine.vertices) :]
    cap, edge = 2 * np.pi * 0.15**2 * (1 - np.cos(0.4)), 0.5 * np.median(edge_lengths(fine))
    even = cap / (np.sqrt(3) / 2 * edge**2)  # two triangles for a vertex
    assert even < len(new) < 2.0 * even  # beside the rim they are finer; 35 times as many with edges as short as its
    off = np.abs(np.linalg.norm(new, axis=1) - 0.15).max()
    assert 1e-4 < off < 5e-3  # the slivers beside the rim tell its slope badly; 6 mm when filled as finely


def test_several_holes_are_filled_at_once_and_the_others_stay():
    pipe = shapes.tube(90, 60, wave=0.0)
    middle = shapes.centers(pipe)
    spots = [[0.15, 0.3, 0.0], [-0.15, 0.2, 0.0], [0.0, 0.4, 0.15]]
    drop = np.any([np.linalg.norm(middle - spot, axis=1) < 0.035 for spot in spots], axis=0)
    cut, _ = submesh(pipe, ~drop)
    walks = sorted(boundary_walks(cut), key=len)
    filled = fill_holes(cut, walks[:3])
    assert sorted(map(len, boundary_loops(filled))) == sorted(map(len, walks[3:]))
    new = filled.vertices[len(cut.vertices) :]
    assert_allclose(np.hypot(new[:, 0], new[:, 2]), 0.15, atol=4e-4)  # 70 mm holes in a 150 mm tube


def test_colours_go_on_over_a_filling():
    cut = ball_with_hole(4, 0.3)
    red = TriangleMesh(cut.vertices, cut.faces, np.tile(np.uint8([200, 30, 40]), (len(cut.vertices), 1)))
    filled = fill_holes(red, boundary_walks(red))
    assert_array_equal(filled.colors, np.tile([200, 30, 40], (len(filled.vertices), 1)))


def test_a_bay_is_filled_up_to_its_mouth():
    sheet = shapes.grid(20, 20, 0.01)
    middle = shapes.centers(sheet)
    bay, _ = submesh(sheet, ~((np.abs(middle[:, 0] - 0.1) < 0.03) & (middle[:, 1] > 0.15)))
    (walk,) = boundary_walks(bay)
    start = bay.vertices[bay.faces.reshape(-1)[walk]]  # half-edge 3f+k starts at corner k of face f
    inner = (np.abs(start[:, 0] - 0.1) < 0.0301) & (start[:, 1] > 0.1499)
    first = np.flatnonzero(inner & ~np.roll(inner, 1))[0]
    shore = np.roll(walk, -first)[: inner.sum() - 1]
    mouth = np.column_stack([np.linspace(0.13, 0.07, 7)[1:-1], np.full(5, 0.2), np.zeros(5)])
    filled = fill_notch(bay, shore, mouth)
    (loop,) = boundary_loops(filled)
    assert len(loop) == 80
    area = (
        np.linalg.norm(np.cross(*np.diff(filled.vertices[filled.faces], axis=1).transpose(1, 0, 2)), axis=1).sum() / 2
    )
    assert_allclose(area, 0.04, rtol=1e-9)  # the whole sheet again, flat
    assert np.all(face_normals(filled)[:, 2] > 0.999)


@pytest.mark.parametrize(("sides", "wanted"), [((0, 2), 0.0032), ((0, 1, 2), 0.0044), ((0, 1, 2, 3), 0.0056)])
def test_a_sheet_goes_on_between_arcs_of_a_rim(sides, wanted):
    """A hole of 8 by 8 cm; from the middle 4 cm of its sides cloth goes out, up to straight lines between them."""
    sheet = shapes.grid(20, 20, 0.01)
    middle = shapes.centers(sheet)[:, :2] - 0.1
    cut, _ = submesh(sheet, np.abs(middle).max(axis=1) > 0.04)
    walk = min(boundary_walks(cut), key=len)
    halves = half_edges(cut)
    x, y, _ = (cut.vertices[halves[walk]].mean(axis=1) - 0.1).T
    arcs = [walk[np.array(k)] for k in ((x > 0.039) & (abs(y) < 0.02), (y > 0.039) & (abs(x) < 0.02))]
    arcs += [walk[np.array(k)] for k in ((x < -0.039) & (abs(y) < 0.02), (y < -0.039) & (abs(x) < 0.02))]
    assert [len(arc) for arc in arcs] == [4] * 4
    place = {int(half): k for k, half in enumerate(walk)}
    arcs = sorted((arcs[side] for side in sides), key=lambda arc: place[int(arc[0])])
    arcs = [arc if np.all(np.diff([place[int(half)] for half in arc]) == 1) else np.roll(arc, 2) for arc in arcs]
    lines = []
    for arc, before in zip(arcs, [arcs[-1], *arcs[:-1]], strict=True):
        start, end = cut.vertices[[halves[arc[0], 0], halves[before[-1], 1]]]
        lines.append(start + np.linspace(0, 1, 7)[1:-1, None] * (end - start))
    bridged = fill_between(cut, arcs, lines)
    assert is_manifold(bridged)
    assert len(boundary_loops(bridged)) == 1 + len(sides)
    assert_array_equal(bridged.vertices[: len(cut.vertices)], cut.vertices)
    added = face_area_vectors(bridged)[len(cut.faces) :]
    assert_allclose(added[:, 2], np.linalg.norm(added, axis=1), atol=1e-9)  # flat, and the same side up
    assert_allclose(added[:, 2].sum(), wanted, rtol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_a_flat_star_is_covered_just_once(seed):
    """Any overlap or fold of a flat loop's triangles would add to their area."""
    rng = np.random.default_rng(seed)
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    points = rng.uniform(0.2, 1.0, (40, 1)) * np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
    faces = triangulate_loop(points, np.tile([0.0, 0.0, 1.0], (40, 1)), np.zeros((40, 40), dtype=bool))
    twice = np.cross(*np.diff(points[faces], axis=1).transpose(1, 0, 2))[:, 2]
    wanted = np.cross(points, np.roll(points, -1, axis=0))[:, 2].sum()
    assert_allclose(np.abs(twice).sum(), wanted, rtol=1e-12)
    assert twice.min() > 0.0


def triangulations(first, last):
    """All ways to cut the polygon of points first..last into triangles."""
    if last - first < 2:
        return [[]]
    return [
        [*left, (first, middle, last), *right]
        for middle in range(first + 1, last)
        for left in triangulations(first, middle)
        for right in triangulations(middle, last)
    ]


@pytest.mark.parametrize("seed", range(4))
def test_where_folds_are_equal_the_least_area_of_all_is_taken(seed):
    """The rim's faces stand upright on every triangle alike, and no inner fold is as sharp."""
    angle = np.linspace(0.0, 2.0 * np.pi, 10)[:-1]
    height = 0.2 * np.sin(2.0 * angle) + 0.1 * np.random.default_rng(seed).standard_normal(9)
    points = np.column_stack([np.cos(angle), np.sin(angle), height])

    def area(faces):
        a, b, c = points[np.array(faces)].transpose(1, 0, 2)
        return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()

    found = triangulate_loop(points, np.zeros((9, 3)), np.zeros((9, 9), dtype=bool))
    every = [area(faces) for faces in triangulations(0, 8)]
    assert len(every) == 429  # Catalan's number
    assert area(found) == pytest.approx(min(every), rel=1e-12)


def test_a_long_loop_gets_the_same_triangles_on_any_number_of_threads():
    rng = np.random.default_rng(7)
    turn = np.linspace(0, 2 * np.pi, 150, endpoint=False)
    points = rng.uniform(0.5, 1.0, (150, 1)) * np.column_stack([np.cos(turn), np.sin(turn), 0.3 * np.sin(3 * turn)])
    rim, forbidden = np.tile([0.0, 0.0, 1.0], (150, 1)), rng.random((150, 150)) < 0.1
    faces = triangulate_loop(points, rim, forbidden | forbidden.T)
    assert sorted(np.unique(faces)) == list(range(150))
    with limited_threads(1):
        assert_array_equal(triangulate_loop(points, rim, forbidden | forbidden.T), faces)


def test_a_forbidden_chord_is_not_used():
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0.1], [0, 1, 0]])
    rim = np.tile([0.0, 0.0, 1.0], (4, 1))
    for banned, other in (((0, 2), (1, 3)), ((1, 3), (0, 2))):
        forbidden = np.zeros((4, 4), dtype=bool)
        forbidden[banned] = forbidden[banned[::-1]] = True
        for face in triangulate_loop(square, rim, forbidden):
            assert set(other) <= set(face.tolist())


def test_a_loop_that_allows_no_chord_is_refused():
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    with pytest.raises(GarmentError, match="cannot be filled"):
        triangulate_loop(square, np.zeros((4, 3)), np.ones((4, 4), dtype=bool))


@pytest.mark.parametrize(
    ("teeth", "count"), [(3.0, 2000), *(pytest.param(teeth, 4000, marks=pytest.mark.slow) for teeth in (3.0, 60.0))]
)
def test_a_ragged_flat_loop_of_thousands_of_points_is_covered_just_once(teeth, count):
    rng = np.random.default_rng(3)
    turn = np.linspace(0, 2 * np.pi, count, endpoint=False)
    reach = 1.0 + 0.3 * np.sign(np.sin(teeth * turn)) + rng.uniform(-0.002, 0.002, count)
    points = reach[:, None] * np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
    flat, forbidden = np.tile([0.0, 0.0, 1.0], (count, 1)), np.zeros((count, count), dtype=bool)
    faces = triangulate_loop(points, flat, forbidden)
    twice = np.cross(*np.diff(points[faces], axis=1).transpose(1, 0, 2))[:, 2]
    wanted = np.cross(points, np.roll(points, -1, axis=0))[:, 2].sum()
    assert len(faces) == count - 2
    assert_allclose(np.abs(twice).sum(), wanted, rtol=1e-12)
    ears = np.sort(faces[np.ptp(faces, axis=1) == 2][:10], axis=1)[:, [0, 2]]  # chords that it likes are taken now
    forbidden[ears[:, 0], ears[:, 1]] = forbidden[ears[:, 1], ears[:, 0]] = True
    faces = triangulate_loop(points, flat, forbidden)
    assert len(faces) == count - 2
    assert not forbidden[faces, np.roll(faces, -1, axis=1)].any()


def test_a_loop_too_long_to_be_held_is_refused():
    nothing = np.zeros((0, 0), dtype=bool)
    with pytest.raises(GarmentError, match="10001 edges"):
        triangulate_loop(np.zeros((10_001, 3)), np.zeros((10_001, 3)), nothing)


def ragged_cap(subdivisions):
    """A ball of 150 mm and a hole in it of about 55 mm whose rim is ragged."""
    ball = shapes.sphere(subdivisions, radius=0.15)
    middle, rng = shapes.centers(ball), np.random.default_rng(0)
    turn = np.arctan2(middle[:, 0], middle[:, 2])
    rim = sum(0.05 * np.sin(k * turn + rng.uniform(0, 6)) for k in (3, 7, 13, 29, 61)) + rng.normal(0, 0.01, len(turn))
    kept = submesh(ball, np.arccos(middle[:, 1] / 0.15) > 0.35 + rim)[0]
    piece, size = component_areas(kept)
    return repair(submesh(kept, piece == np.argmax(size))[0], RepairConfig(weld_mm=0.0), Job())


def test_a_ragged_hole_takes_triangles_by_its_area_and_they_are_even():
    cut = ragged_cap(7)
    (walk,) = [walk for walk in boundary_walks(cut) if len(walk) > 400]
    filled = fill_holes(cut, [walk])
    assert is_manifold(filled)
    patch, source = submesh(filled, np.arange(len(filled.faces)) >= len(cut.faces))
    edge = np.linalg.norm(np.diff(cut.vertices[half_edges(cut)[walk, 0]], axis=0), axis=1).mean()
    even = np.linalg.norm(face_area_vectors(patch), axis=1).sum() / (np.sqrt(3) / 4 * edge**2)
    assert 0.8 * even < len(patch.faces) < 1.5 * even
    side = np.roll(patch.vertices[patch.faces], -1, axis=1) - patch.vertices[patch.faces]
    side = side[np.linalg.norm(side, axis=2).min(axis=1) > 0.0]  # where the rim touches itself, points coincide
    side /= np.linalg.norm(side, axis=2, keepdims=True)
    least = np.degrees(np.arccos(-np.einsum("fkd,fkd->fk", side, np.roll(side, 1, axis=1)).max(axis=1)))
    assert np.percentile(least, 5) > 25.0  # the smallest angle of a triangle; 60 at best
    new = filled.vertices[source[source >= len(cut.vertices)]]
    assert np.abs(np.linalg.norm(new, axis=1) - 0.15).max() < 5e-4


def test_a_slit_with_thousands_of_edges_is_filled_as_the_surface_around_it_runs():
    radius, size = 0.15, 0.0005
    sheet = shapes.grid(1600, 12, size)
    middle = shapes.centers(sheet)
    slit = (np.abs(middle[:, 0] - 800 * size) < 780 * size) & (np.abs(middle[:, 1] - 6 * size) < 2 * size)
    flat, _ = submesh(sheet, ~slit)
    x, y, _ = flat.vertices.T
    bent = TriangleMesh(np.column_stack([radius * np.sin(y / radius), x, radius * np.cos(y / radius)]), flat.faces)
    walk = next(w for w in boundary_walks(bent) if 3000 < len(w) < 3200)
    filled = fill_holes(bent, [walk])
    assert is_manifold(filled)
    assert len(filled.faces) - len(bent.faces) < 1.5 * 4 * 1560 * 4 / np.sqrt(3)
    new = filled.vertices[len(bent.vertices) :]
    assert_allclose(np.hypot(new[:, 0], new[:, 2]), radius, rtol=0, atol=2e-6)  # 3 um of sagitta across the slit


def test_a_very_large_hole_is_filled_with_longer_edges_inside(monkeypatch):
    monkeypatch.setattr(holes, "MOST_FACES", 3000)
    turn = np.linspace(0, 2 * np.pi, 800, endpoint=False)
    ring = np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
    i, j = np.arange(800), np.roll(np.arange(800), -1)
    faces = np.vstack([np.column_stack([i, 800 + i, 800 + j]), np.column_stack([i, 800 + j, j])]).astype(np.int32)
    band = TriangleMesh(np.vstack([0.1 * ring, 0.1008 * ring]), faces)
    inner = next(w for w in boundary_walks(band) if half_edges(band)[w, 0].max() < 800)
    filled = fill_holes(band, [inner])
    assert 3000 < len(filled.faces) - len(band.faces) < 3000 + 10 * 800  # 118,000 as fine as the rim
    assert_allclose(np.linalg.norm(face_area_vectors(filled), axis=1).sum(), np.pi * 0.1008**2, rtol=1e-4)


def test_refinement_leaves_area_rim_and_taken_chords():
    turn = np.linspace(0, 2 * np.pi, 30, endpoint=False)
    points = (1.0 + 0.3 * np.sin(3 * turn))[:, None] * np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
    flat = np.tile([0.0, 0.0, 1.0], (30, 1))
    patch = TriangleMesh(points, triangulate_loop(points, flat, np.zeros((30, 30), dtype=bool)))
    chords = np.abs(np.subtract.outer(np.arange(30), np.arange(30)))
    free = refine(patch, 5.0, np.zeros((30, 30), dtype=bool))  # longer than all: only flipped
    assert len(free.vertices) == 30
    fan = {tuple(pair) for pair in edges(free).tolist()} - {tuple(pair) for pair in edges(patch).tolist()}
    assert fan  # some edges are better flipped
    kept = refine(patch, 5.0, (chords > 1) & (chords < 29))
    assert_array_equal(edges(kept), edges(patch))
    fine = refine(patch, 0.1, np.zeros((30, 30), dtype=bool))
    pair = edges(fine)
    inner = edge_faces(fine)[:, 1] >= 0
    length = np.linalg.norm(fine.vertices[pair[:, 0]] - fine.vertices[pair[:, 1]], axis=1)
    assert np.percentile(length[inner], 95) < 1.5 * 0.1
    assert_array_equal(fine.vertices[:30], points)
    assert_array_equal(np.sort(boundary_loops(fine)[0]), np.arange(30))
    assert_allclose(face_area_vectors(fine)[:, 2].sum(), face_area_vectors(patch)[:, 2].sum(), rtol=1e-12)
    assert face_area_vectors(fine)[:, 2].min() > 0.0
