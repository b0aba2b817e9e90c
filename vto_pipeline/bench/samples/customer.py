"""The customer: a body clearly larger than the form, measured on its own mesh."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from vto_pipeline.bench.samples.solids.body import HEIGHTS, LEVELS, BodyShape, arm, body_distance
from vto_pipeline.bench.samples.solids.surface_nets import zero_surface
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Measurements
from vto_pipeline.model.mesh import TriangleMesh

SHAPE = BodyShape(
    stature=1.64,
    widths=(0.178, 0.188, 0.174, 0.152, 0.148, 0.152, 0.150, 0.134),
    fronts=(0.094, 0.108, 0.116, 0.110, 0.108, 0.106, 0.092, 0.072),
    backs=(0.100, 0.104, 0.094, 0.090, 0.098, 0.106, 0.106, 0.096),
    bust=0.020,
    limb=1.05,
    shoulder=0.166,
    arm_angle=np.deg2rad(46.0),
    bumps=(
        (0.060, 0.560, 0.065, 0.006, 0.050),
        (-0.060, 0.540, -0.050, 0.005, 0.050),
        (0.030, 0.780, 0.04, 0.003, 0.03),
    ),
)
CELL = 0.0105
STEP = 0.002  # between the levels tried for a smallest girth or a farthest point [m]


def make_customer() -> TriangleMesh:
    """The customer's body in A-pose, feet on y = 0, facing +Z."""
    low, high = np.array([-0.75, -0.04, -0.25]), np.array([0.75, SHAPE.stature + 0.04, 0.27])
    mesh = zero_surface(lambda points: body_distance(SHAPE, points), low, high, CELL)
    return TriangleMesh(mesh.vertices - [0.0, mesh.vertices[:, 1].min(), 0.0], mesh.faces)


def measure_truth(mesh: TriangleMesh) -> Measurements:
    """Tape measurements by plane sections; a taut tape is the convex hull of the section.

    Bust at the level of the farthest point of the bust, waist where the trunk is thinnest, hip at the level of the
    farthest point of the seat, upper arm half-way from shoulder joint to elbow, across the arm.
    """
    level = dict(zip(LEVELS, HEIGHTS * SHAPE.stature, strict=True))
    up = np.array([0.0, 1.0, 0.0])
    middle = np.abs(mesh.vertices[:, 0]) < 0.15

    def farthest(below: str, above: str, side: float) -> float:
        band = middle & (mesh.vertices[:, 1] > level[below]) & (mesh.vertices[:, 1] < level[above])
        candidates = mesh.vertices[band]
        return float(candidates[(side * candidates[:, 2]).argmax(), 1])

    def trunk_girth(height: float) -> float:
        return _girth(mesh, np.array([0.0, height, 0.0]), up)

    bones = arm(SHAPE)
    waists = [trunk_girth(height) for height in np.arange(level["belly"], level["ribs"], STEP)]
    values = {
        "stature": float(np.ptp(mesh.vertices[:, 1])),
        "bust_girth": trunk_girth(farthest("ribs", "chest", 1.0)),
        "waist_girth": min(waists),
        "hip_girth": trunk_girth(farthest("crotch", "belly", -1.0)),
        "upper_arm_girth": _girth(mesh, 0.5 * (bones.shoulder + bones.elbow), bones.axis),
    }
    return Measurements({name: round(value, 3) for name, value in values.items()}, sex="female")


def _girth(mesh: TriangleMesh, point: FloatArray, normal: FloatArray) -> float:
    """Hull perimeter of the section's loop that is nearest to `point` [m]."""
    import trimesh

    section = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).section(normal, point)
    assert section is not None  # the plane passes through the body
    loop = min(section.discrete, key=lambda path: np.linalg.norm(path.mean(axis=0) - point))
    across = np.linalg.svd(np.eye(3) - np.outer(normal, normal))[0][:, :2]
    flat = loop @ across
    return float(ConvexHull(flat).area)  # in the plane, SciPy's area is the perimeter
