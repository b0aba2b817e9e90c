"""The shirt on the form: an open shell with a neck, a hem and two cuffs.

The shell is the zero level of one function that contains the form with some room to spare, so it can meet neither the
form nor itself. A later, simulated shirt only has to replace `make_hanging_shirt`.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.ndimage import gaussian_filter1d

from vto_pipeline.bench.samples.garments.folds import SLEEVE_FOLDS, TRUNK_FOLDS, fold_height, hem_flutes
from vto_pipeline.bench.samples.solids.body import arm, leg_distance, torso_distance
from vto_pipeline.bench.samples.solids.clip import clip_snapped, compact
from vto_pipeline.bench.samples.solids.form import Form, body_frame, form_distance
from vto_pipeline.bench.samples.solids.primitives import bump, cone, ellipsoid, smooth_cut, smooth_union
from vto_pipeline.bench.samples.solids.surface_nets import Field, zero_surface
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

CELL = 0.006
TIGHT = 0.003  # clearance on the shoulders [m]
TRUNK_RADIUS = 0.15  # of the circle on which the arc of the trunk is measured [m]
SLEEVE_RADIUS = 0.07
HEM, WAIST, TRUNK_TOP = 0.215, 0.44, 0.735  # heights in the form's frame [m]
SLEEVE = 0.235  # from the shoulder joint to the cuff [m]


def make_hanging_shirt(form: Form, cell: float = CELL) -> TriangleMesh:
    """A short-sleeved shirt hanging on the form.

    Args:
        form: What it hangs on.
        cell: About the length of an edge [m].

    Returns:
        One open sheet, normals outward, four boundary loops [m].
    """
    field = _shirt_field(form)
    closed = zero_surface(field, np.array([-0.48, 0.15, -0.28]), np.array([0.48, 0.90, 0.28]), cell)
    below_neck = clip_snapped(closed, neck_distance(closed.vertices))
    above_hem = clip_snapped(below_neck, below_neck.vertices[:, 1] - _hem_height(below_neck.vertices))
    shell = clip_snapped(above_hem, _cuff_distance(form, above_hem.vertices))
    return _largest_piece(shell)


def sleeve_coordinates(form: Form, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Arc around the arm from the top towards the front, distance from the shoulder joint, radius; each (N,) [m]."""
    bones = arm(form.shape)
    left = points * np.where(points[:, :1] < 0.0, [-1.0, 1.0, 1.0], 1.0)
    offset = body_frame(left) - bones.shoulder
    along = offset @ bones.axis
    up = np.array([-bones.axis[1], bones.axis[0], 0.0])
    high, forward = offset @ up, offset[:, 2]
    return SLEEVE_RADIUS * np.arctan2(forward, high), along, np.hypot(high, forward)


def neck_distance(points: FloatArray) -> FloatArray:
    """How far outside the ellipsoid around the neck that cuts the neckline, shape (N,) [m]."""
    return ellipsoid(points, np.array([0.0, 0.885, 0.022]), np.array([0.104, 0.100, 0.100]))


def _hem_height(points: FloatArray) -> FloatArray:
    """A hem a little lower at the back."""
    return HEM + 0.08 * points[:, 2]


def _cuff_distance(form: Form, points: FloatArray) -> FloatArray:
    """Positive on the shoulder's side of the cuffs, and on the trunk."""
    around, along, _ = sleeve_coordinates(form, points)
    return np.maximum(SLEEVE + 0.006 * np.cos(around / SLEEVE_RADIUS) - along, 0.24 - np.abs(points[:, 0]))


def _shirt_field(form: Form) -> Field:
    """Signed distance whose zero level is the shirt, closed where its openings will be cut."""
    trunk_radius = _hanging_trunk(form)
    bones = arm(form.shape)

    def trunk(points: FloatArray) -> FloatArray:
        turn = np.arctan2(points[:, 0], points[:, 2])
        height = points[:, 1]
        radius = trunk_radius(np.stack([turn, np.clip(height, 0.0, 0.9)], axis=1))
        radius += fold_height(TRUNK_FOLDS, TRUNK_RADIUS * turn, height, 2.0 * np.pi * TRUNK_RADIUS)
        radius += hem_flutes(turn, (WAIST + 0.02 - height) / (WAIST + 0.02 - HEM))
        tube = np.hypot(points[:, 0], points[:, 2]) - radius
        return smooth_cut(tube, height - TRUNK_TOP, 0.06)

    def sleeve(points: FloatArray) -> FloatArray:
        around, along, _ = sleeve_coordinates(form, points)
        left = body_frame(points * np.where(points[:, :1] < 0.0, [-1.0, 1.0, 1.0], 1.0))
        sag = np.array([0.0, -0.010, 0.0])
        tube = cone(left, bones.shoulder + 0.4 * sag, bones.shoulder + 0.30 * bones.axis + 1.4 * sag, (0.056, 0.066))
        side = np.where(points[:, 0] < 0.0, -1.0, 1.0)
        ridges = fold_height(SLEEVE_FOLDS, side * around, along, 2.0 * np.pi * SLEEVE_RADIUS)
        return tube - ridges

    def shirt(points: FloatArray) -> FloatArray:
        loose = smooth_union(trunk(points), sleeve(points), 0.035)
        return smooth_union(form_distance(points) - TIGHT, loose, 0.012)

    return shirt


def _hanging_trunk(form: Form) -> RegularGridInterpolator:
    """Radius of the trunk of the shirt over angle and height: cloth hangs from the bust, shoulder blades and hips."""
    turns = np.linspace(-np.pi, np.pi, 361)
    heights = np.linspace(0.0, 0.9, 181)
    skin = _trunk_radius(form, turns, heights)
    clearance = np.interp(heights, [HEM, WAIST, 0.60, 0.70], [0.020, 0.016, 0.006, TIGHT])
    clear = skin + clearance
    hanging = clear.copy()
    fall = 0.16 * (heights[1] - heights[0])
    for row in range(len(heights) - 2, -1, -1):
        hanging[:, row] = np.maximum(clear[:, row], hanging[:, row + 1] - fall)
    smooth = gaussian_filter1d(gaussian_filter1d(hanging, 4.0, axis=0, mode="wrap"), 4.0, axis=1)
    return RegularGridInterpolator((turns, heights), np.maximum(smooth, skin + 0.006), method="linear")


def _trunk_radius(form: Form, turns: FloatArray, heights: FloatArray) -> FloatArray:
    """Radius of trunk and thighs by bisection, shape (turns, heights) [m]."""
    turn, height = np.meshgrid(turns, heights, indexing="ij")
    low, high = np.full(turn.size, 0.02), np.full(turn.size, 0.30)
    for _ in range(20):
        middle = 0.5 * (low + high)
        points = np.stack([middle * np.sin(turn.ravel()), height.ravel(), middle * np.cos(turn.ravel())], axis=1)
        on_body = body_frame(points)
        body = smooth_union(torso_distance(form.shape, on_body), leg_distance(form.shape, on_body), 0.09)
        for x, y, z, lift, spread in form.shape.bumps:
            body = body - bump(on_body, np.array([x, y, z]) * form.shape.stature, lift, spread)
        low, high = np.where(body < 0.0, middle, low), np.where(body < 0.0, high, middle)
    return middle.reshape(turn.shape)


def _largest_piece(mesh: TriangleMesh) -> TriangleMesh:
    """The connected piece with the most triangles."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    first, second = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    links = coo_matrix((np.ones(len(first)), (first, second)), shape=(len(mesh.vertices),) * 2)
    _, piece = connected_components(links, directed=False)
    of_face = piece[mesh.faces[:, 0]]
    return compact(mesh.vertices, mesh.faces[of_face == np.bincount(of_face).argmax()])
