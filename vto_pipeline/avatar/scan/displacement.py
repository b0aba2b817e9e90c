"""The final displacement of the posed body along its normals onto the scan, smooth where the scan has gaps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import splu

from vto_pipeline.avatar.scan.correspondence import Target, geman_mcclure
from vto_pipeline.avatar.scan.misfit_correlation import morans_i
from vto_pipeline.geometry.closest import barycentric, closest_points
from vto_pipeline.geometry.intersections import self_intersections
from vto_pipeline.geometry.smooth import neighbour_mean
from vto_pipeline.geometry.topology import face_area_vectors, vertex_normals
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

_FIRST_REACH_M, _LAST_REACH_M = 0.03, 0.008
_MAX_MOVE_M = 0.01
_HOLD = 1e-4
_NOISE_CORRELATION = 0.05
"""Below this correlation of neighbouring points of the scan, what is left is noise."""
_UNTANGLE_ROUNDS, _SMOOTH_ONLY, _WIDER = 40, 10, 5
_GIVE_BACK = 0.8


def displace(
    target: Target,
    vertices: FloatArray,
    faces: IntArray,
    trust: FloatArray,
    judged: NDArray[np.bool_],
    stiffness: tuple[float, ...],
    rounds: int,
) -> tuple[FloatArray, float]:
    """Return the vertices moved onto the scan, shape (V, 3), and the stiffness at which only noise was left.

    Minimises the distances along the normals, in both directions, plus stiffness times the squared Laplacian of the
    whole displacement. Moving along normals only keeps the vertices from sliding over each other. The stiffness falls
    until only noise is left to follow.

    Args:
        target: The scan.
        vertices: The posed body [m].
        faces: Its faces.
        trust: How much a vertex may follow the scan, 0 to 1, shape (V,): our hands are mittens and follow no fingers.
        judged: Vertices that decide between shape and noise, shape (V,).
        stiffness: Weights of the Laplacian, falling.
        rounds: Solves at each.
    """
    start = vertices
    laplace = _laplacian(TriangleMesh(vertices, faces))
    bend = (laplace.T @ laplace).tocsr()
    reach = _FIRST_REACH_M
    for weight in stiffness:
        for _ in range(rounds):
            vertices = _step(target, start, vertices, faces, trust, laplace, bend, weight, reach)
            reach = max(0.9 * reach, _LAST_REACH_M)
        if _residual_correlation(target, vertices, faces, judged) < _NOISE_CORRELATION:
            break
    return vertices, weight


def _step(
    target: Target,
    start: FloatArray,
    vertices: FloatArray,
    faces: IntArray,
    trust: FloatArray,
    laplace: csr_matrix,
    bend: csr_matrix,
    weight: float,
    reach: float,
) -> FloatArray:
    facing = vertex_normals(TriangleMesh(vertices, faces))
    normals = _smooth_normals(facing, laplace)
    at, toward, pull = target.closest_on_scan(vertices, faces, np.arange(len(vertices)), facing, reach)
    along = (normals * toward).sum(axis=1)
    pull = pull * trust
    back, missing = _from_probes(target, vertices, faces, normals, trust, reach)
    moved = vertices - start
    spread = [diags(normals[:, axis]) for axis in range(3)]
    stiff = spread[0] @ bend @ spread[0] + spread[1] @ bend @ spread[1] + spread[2] @ bend @ spread[2]
    drag = (normals * (bend @ moved)).sum(axis=1)
    system = diags(pull * along**2 + _HOLD) + back.T @ back + weight * stiff
    right = pull * along * ((at - vertices) * toward).sum(axis=1) + back.T @ missing - weight * drag
    height = splu(system.tocsc()).solve(right - _HOLD * (moved * normals).sum(axis=1))
    stepped: FloatArray = vertices + np.clip(height, -_MAX_MOVE_M, _MAX_MOVE_M)[:, None] * normals
    return stepped


def _residual_correlation(target: Target, vertices: FloatArray, faces: IntArray, judged: NDArray[np.bool_]) -> float:
    """Return the correlation of neighbouring residuals at points of the scan near the judged vertices."""
    face, closest, distance = closest_points(target.probes, vertices, faces)
    near = judged[faces[face]].all(axis=1) & (distance < _FIRST_REACH_M)
    points, normals = target.probes[near], target.probe_normals[near]
    return morans_i(points, normals, ((points - closest[near]) * normals).sum(axis=1))


def untangle_displacement(start: FloatArray, vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, int]:
    """Smooth the displacement where faces flipped or pass through each other, then take it back there.

    Args:
        start: Before the displacement [m], shape (V, 3).
        vertices: After it.
        faces: Shape (F, 3).

    Returns:
        The repaired vertices, and how many faces are still bad.
    """
    laplace = _laplacian(TriangleMesh(vertices, faces))
    near = (abs(laplace) > 0).astype(float)
    moved = vertices - start
    before = face_area_vectors(TriangleMesh(start, faces))
    for turn in range(_UNTANGLE_ROUNDS):
        mesh = TriangleMesh(start + moved, faces)
        bad = ((face_area_vectors(mesh) * before).sum(axis=1) < 0).nonzero()[0]
        bad = np.union1d(bad, self_intersections(mesh).ravel())
        if len(bad) == 0:
            break
        touched = np.zeros(len(vertices))
        touched[faces[bad].ravel()] = 1.0
        for _ in range(turn // _WIDER):  # where little did not help, around it too
            touched = np.sign(near @ touched)
        inside = touched > 0
        moved[inside] -= 0.5 * (laplace @ moved)[inside]
        if turn >= _SMOOTH_ONLY:  # smooth already: go back towards the start
            moved[inside] *= _GIVE_BACK
    return start + moved, len(bad)


def _smooth_normals(normals: FloatArray, laplace: csr_matrix) -> FloatArray:
    for _ in range(3):
        normals = normals - 0.3 * (laplace @ normals)
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return normals


def _from_probes(
    target: Target, vertices: FloatArray, faces: IntArray, normals: FloatArray, trust: FloatArray, reach: float
) -> tuple[csr_matrix, FloatArray]:
    """Rows that pull the model's faces to the scan's points, so that no bump is skipped."""
    face, closest, distance = closest_points(target.probes, vertices, faces)
    corners = faces[face]
    shares = barycentric(closest, vertices[corners])
    facing = target.probe_normals
    agree = (np.einsum("nk,nkd->nd", shares, normals[corners]) * facing).sum(axis=1) > 0.5
    ahead = ((target.probes - closest) * facing).sum(axis=1)
    weight = np.sqrt(
        geman_mcclure(distance, reach)
        * target.side_weight(ahead)
        * trust[corners].mean(axis=1)
        * (agree & (distance < 3 * reach))
        * len(vertices)
        / len(face)
    )
    along = np.einsum("nkd,nd->nk", normals[corners], facing) * shares * weight[:, None]
    row = np.repeat(np.arange(len(face)), 3)
    back = csr_matrix((along.ravel(), (row, corners.ravel())), (len(face), len(vertices)))
    return back, weight * ahead


def _laplacian(mesh: TriangleMesh) -> csr_matrix:
    """Vertex minus mean of its neighbours."""
    return (diags(np.ones(len(mesh.vertices))) - neighbour_mean(mesh)).tocsr()
