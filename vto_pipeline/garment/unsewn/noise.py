"""The noise of a scanned surface: how much there is, and the surface without it.

Noise is what a vertex is off the mean of its neighbours once more than their means are off theirs: of a smooth surface
that is next to nothing. What it lengthens edges by would make panels too large. So the surface is sought that bends
least among those as far from the scan as the noise is large (Morozov's discrepancy principle, with the thin plate
energy of the cotangent Laplacian). Rows of rim vertices are left out of the energy, so that rims do not shrink.

That would flatten folds as well. So what was smoothed away is smoothed itself, and given back (iterated Tikhonov
regularisation; Engl, Hanke & Neubauer 1996, ch. 5); and what bends more than most of the surface resists bending less
(iterated reweighting; Holland & Welsch 1977).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import csc_matrix, diags, eye
from scipy.sparse.linalg import splu

from vto_pipeline.geometry.laplace import laplacian
from vto_pipeline.geometry.smooth import neighbour_mean
from vto_pipeline.geometry.topology import edge_face_counts, edges, vertex_normals
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

_PASSES = 2  # with the weights of a surface that bends the same everywhere, then with those of what was found
_ROUNDS = 7
_GIVEN_BACK = 2
_REMOVED = 0.8  # of the noise: what is left of it is too smooth to be told from the surface
_MAD = 1.4826  # from the median of the absolute to the standard deviation of a normal distribution


def noise_of(mesh: TriangleMesh) -> float:
    """Return the standard deviation of noise in each direction [m], from what it does along the normals."""
    rough = eye(len(mesh.vertices)) - neighbour_mean(mesh)
    twice = (rough @ rough).tocsr()
    gain = np.sqrt(np.asarray(twice.multiply(twice).sum(axis=1)).ravel())
    off = np.einsum("vd,vd->v", np.asarray(twice @ mesh.vertices), vertex_normals(mesh))
    pair, count = edge_face_counts(mesh)
    near = np.zeros(len(mesh.vertices), np.bool_)
    near[pair[count == 1]] = True
    near[pair[near[pair].any(axis=1)]] = True
    inner = ~near if (~near).any() else np.ones_like(near)
    return float(_MAD * np.median(np.abs(off / gain)[inner]))


def without_noise(mesh: TriangleMesh, noise: float) -> TriangleMesh:
    """Return the smoothest surface within the noise of a scan.

    Args:
        mesh: The scan [m].
        noise: Standard deviation in each direction [m]; only what is across the surface can be told from its shape.
    """
    if noise <= 0.0:
        return mesh
    matrix, area = laplacian(mesh)
    pair, count = edge_face_counts(mesh)
    weight = 1.0 / area
    weight[np.unique(pair[count == 1])] = 0.0
    side = float(np.median(np.linalg.norm(np.diff(mesh.vertices[edges(mesh)], axis=1), axis=2)))
    found = mesh.vertices
    for turn in range(_PASSES):
        if turn > 0:
            bent = np.linalg.norm(matrix @ found, axis=1) / area
            weight = weight / np.hypot(1.0, bent / max(float(np.median(bent)), 1e-12))
        bending = side**2 * csc_matrix(matrix.T @ diags(weight) @ matrix)
        low, high = -3.0, 4.0  # decades of the weight, per square of an edge
        for _ in range(_ROUNDS):
            middle = 0.5 * (low + high)
            found = _smoothed(mesh.vertices, 10.0**middle * bending)
            off = float(np.sqrt(np.mean(np.sum((found - mesh.vertices) ** 2, axis=1))))
            low, high = (middle, high) if off < _REMOVED * noise else (low, middle)
    return replace(mesh, vertices=found)


def _smoothed(places: FloatArray, bending: csc_matrix) -> FloatArray:
    """Return vertices (V, 3) that bend less [m], by this matrix of the energy, shape (V, V)."""
    whole = csc_matrix(eye(len(places)) + bending)
    solver = splu(whole, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    found = np.zeros_like(places)
    for _ in range(1 + _GIVEN_BACK):
        found = found + np.column_stack([solver.solve(left) for left in (places - found).T])
    return found
