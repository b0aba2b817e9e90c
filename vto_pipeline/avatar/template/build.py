"""Build the template: fit the grid to each sex's surface, assign vertices to limbs, write the data file.

Run as `python -m vto_pipeline.avatar.template.build`; writes template.npz.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix, diags
from scipy.sparse.linalg import spsolve

from vto_pipeline.avatar.template.body_plan import FEMALE, MALE, BodyPlan, interpolated_plan
from vto_pipeline.avatar.template.grid import Grid, lay_out
from vto_pipeline.avatar.template.implicit import gradient, signed_field, smoothstep
from vto_pipeline.avatar.template.template import mirror_indices
from vto_pipeline.model.arrays import FloatArray

_ROUNDS = 150
_STEP = 0.5
_MAX_MOVE_M = 0.01
_SEAM_REACH_M = 0.035
_SEAM_ROUNDS = 30
_UNDO = -0.53
"""The second of two steps, outwards: smoothing alone shrinks what it smooths (Taubin 1995), here the seat."""


def build_template(path: Path) -> None:
    """Write the template's data file.

    Args:
        path: The .npz to write: both sexes' vertices, faces, memberships, rows.
    """
    grid, male = fit_grid(MALE)
    _, female = fit_grid(FEMALE)
    mirror, quads = np.array(grid.on_mirror), np.array(grid.quads)
    mean = (male + female) / 2
    faces = _split(quads, mean, mirror)
    data: dict[str, NDArray[Any]] = {
        "male": male.astype(np.float32),
        "female": female.astype(np.float32),
        "faces": faces.astype(np.int32),
        "mirror": mirror,
        **{limb: _membership(grid, mean, limb).astype(np.float32) for limb in ("arm", "clavicle", "leg")},
        **{f"row_{name}": row.astype(np.int32) for name, row in grid.rows.items()},
    }
    np.savez_compressed(path, allow_pickle=False, **data)


def fit_grid(plan: BodyPlan) -> tuple[Grid, FloatArray]:
    """Spread the grid's vertices evenly and pull them onto the surface; each stays in its row's plane."""
    grid = lay_out(plan)
    points = np.array(grid.points)
    planes = np.array(grid.planes)
    mirror = np.array(grid.on_mirror)
    smooth = _neighbour_mean(np.array(grid.quads), mirror)
    for _ in range(_ROUNDS):
        slope = gradient(plan, points)
        slope -= _along(planes, slope)
        normal = slope / (np.linalg.norm(slope, axis=1, keepdims=True) + 1e-12)
        move = _STEP * (smooth @ points - points)
        move -= _along(planes, move)
        points = _project(plan, points + move - _along(normal, move), planes, mirror)
    for _ in range(8):
        points = _project(plan, points, planes, mirror)
    # where trunk and legs were laid out apart, no edge may show
    seam = points[np.concatenate([grid.rows["crotch"], grid.rows["seam"]])]
    near = np.linalg.norm(points[:, None] - seam, axis=2).min(axis=1)
    share = np.exp(-((near / _SEAM_REACH_M) ** 2))[:, None]
    for _ in range(_SEAM_ROUNDS):
        for strength in (_STEP, _UNDO):
            move = strength * share * (smooth @ points - points)
            points = points + move - _along(planes, move)
            points[mirror, 0] = 0.0
    return grid, points


def _along(direction: FloatArray, move: FloatArray) -> FloatArray:
    return direction * (move * direction).sum(axis=1, keepdims=True)


def _project(plan: BodyPlan, points: FloatArray, planes: FloatArray, mirror: NDArray[np.bool_]) -> FloatArray:
    """Move points one Newton step onto the surface, each within its plane."""
    slope = gradient(plan, points)
    slope -= _along(planes, slope)
    slope[mirror, 0] = 0.0
    step = signed_field(plan, points)[:, None] * slope / ((slope**2).sum(axis=1, keepdims=True) + 0.05)
    size = np.linalg.norm(step, axis=1, keepdims=True)
    points = points - step * np.minimum(1.0, _MAX_MOVE_M / (size + 1e-12))
    points[mirror, 0] = 0.0
    points[~mirror, 0] = np.maximum(points[~mirror, 0], 0.002)
    return points


def _adjacency(quads: NDArray[np.int64], mirror: NDArray[np.bool_]) -> csr_matrix:
    """Vertices adjacent by a quad's side; neighbours off the median plane count twice for those on it."""
    count = len(mirror)
    start, end = quads.ravel(), np.roll(quads, -1, axis=1).ravel()
    row, column = np.concatenate([start, end]), np.concatenate([end, start])
    adjacent = csr_matrix(coo_matrix((np.ones(len(row)), (row, column)), (count, count))).tocoo()
    adjacent.data[:] = np.where(mirror[adjacent.row] & ~mirror[adjacent.col], 2.0, 1.0)
    return csr_matrix(adjacent)


def _neighbour_mean(quads: NDArray[np.int64], mirror: NDArray[np.bool_]) -> csr_matrix:
    adjacent = _adjacency(quads, mirror)
    return csr_matrix(diags(1 / np.asarray(adjacent.sum(axis=1)).ravel()) @ adjacent)


def _split(quads: NDArray[np.int64], points: FloatArray, mirror: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Split the quads by their shorter diagonal, turn them outwards, and mirror them; shape (F, 3)."""
    import igl

    a, b, c, d = (points[quads[:, i]] for i in range(4))
    short = np.linalg.norm(a - c, axis=1) <= np.linalg.norm(b - d, axis=1)
    first = np.where(short[:, None], quads[:, [0, 1, 2]], quads[:, [0, 1, 3]])
    second = np.where(short[:, None], quads[:, [0, 2, 3]], quads[:, [1, 2, 3]])
    half = np.asarray(igl.bfs_orient(np.concatenate([first, second]).astype(np.int64))[0])
    corners = points[half]
    if np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) < 0:
        half = half[:, ::-1]
    return np.concatenate([half, mirror_indices(mirror)[half][:, ::-1]])


def _membership(grid: Grid, points: FloatArray, limb: str) -> FloatArray:
    """How much each half-body vertex belongs to a limb, 0 to 1: harmonic on the grid between its root and its rest."""
    plan = interpolated_plan(0.5)
    level, shoulder = plan.levels, plan.shoulder
    x, y, _ = points.T
    numbers = np.arange(len(points))
    outer = numbers >= grid.rows["arm"][0]
    if limb == "leg":
        one = (y < level["thigh"] + 0.001) & (numbers >= grid.rows["crotch"].min()) & ~outer
        zero = (y > level["high_hip"]) | outer
    else:
        one = numbers >= grid.rows["upper_arm"].min() - (2 if limb == "arm" else 6) * 28
        inner, below = (0.055, 0.05) if limb == "arm" else (0.13, 0.10)
        zero = ((x < shoulder[0] - inner) | (y < level["axilla"] - below)) & ~outer
    fixed = one | zero
    adjacent = _adjacency(np.array(grid.quads), np.array(grid.on_mirror))
    laplace = csr_matrix(diags(np.asarray(adjacent.sum(axis=1)).ravel()) - adjacent)
    value = one.astype(float)
    value[~fixed] = spsolve(laplace[~fixed][:, ~fixed].tocsc(), -laplace[~fixed][:, fixed] @ value[fixed])
    return smoothstep(value)


if __name__ == "__main__":
    build_template(Path(__file__).with_name("template.npz"))
