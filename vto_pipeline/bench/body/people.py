"""People whose true body is known: drawn from the population, posed at random, scanned with errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.avatar.measuring.population import population
from vto_pipeline.avatar.model.fit import Fit, posed_vertices
from vto_pipeline.avatar.model.pose import pose_avatar
from vto_pipeline.avatar.model.shape import shape_space
from vto_pipeline.avatar.model.stance import stance
from vto_pipeline.avatar.scan.bind_pose import to_bind_pose
from vto_pipeline.avatar.template.template import JOINT_KINDS
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar, Measurements
from vto_pipeline.model.mesh import PointCloud, TriangleMesh

ASKED = ("stature", "chest_girth", "waist_girth", "hip_girth")
"""What a tape is put to; the population says the rest."""

_SPREAD_RAD = {
    "spine": 0.05,
    "chest": 0.05,
    "neck": 0.08,
    "head": 0.08,
    "clavicle": 0.05,
    "shoulder": 0.20,
    "elbow": 0.25,
    "hip": 0.06,
    "knee": 0.08,
}
"""How differently people stand who were asked to stand in an A-pose."""
_HOLE_M = (0.03, 0.08)


def random_measurements(sex: str, seed: int) -> Measurements:
    """Return all measurements of a random person of the population (ANSUR II)."""
    people = population(sex)
    values = np.random.default_rng(seed).multivariate_normal(people.mean, people.covariance)
    return Measurements(dict(zip(people.names, values.tolist(), strict=True)), sex=sex)


def random_body(sex: str, seed: int) -> Avatar:
    """Return a random body of our own shape space, in a random stance, facing anywhere."""
    known = random_measurements(sex, seed)
    body = fit_measurements(Measurements({name: known.values[name] for name in ASKED}, sex=sex))
    rng = np.random.default_rng(seed)
    pose = np.array([rng.normal(0.0, _SPREAD_RAD.get(kind, 0.0), 3) for kind in JOINT_KINDS])
    pose[0] = [0.0, rng.uniform(-np.pi, np.pi), 0.0]
    return pose_avatar(body, pose, np.array([rng.normal(0.0, 0.3), 0.0, rng.normal(0.0, 0.3)]))


def as_standing(body: Avatar) -> Avatar:
    """Return a person of ours in the bind pose that a scan of them gets: the posture their own, the arms put aside."""
    space = shape_space(body.sex)
    parameters = np.array([body.parameters[name] for name in space.names])
    fit = Fit(parameters, body.pose, np.zeros(3), parameters)
    # the space's own skeleton hangs a little lower than the body's, whose soles are on the floor
    fit = replace(fit, translation=(body.vertices - posed_vertices(space, fit)).mean(axis=0))
    return to_bind_pose(space, fit, stance(space, fit), body.vertices, body.vertices)[0]


def first_hits(mesh: TriangleMesh, rays: FloatArray) -> FloatArray:
    """Return where rays first meet a mesh, in lengths of their direction; infinite where they do not.

    Args:
        mesh: [m].
        rays: Origin and direction, shape (..., 6).
    """
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene()
    corners, faces = mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32)
    scene.add_triangles(o3d.core.Tensor.from_numpy(corners), o3d.core.Tensor.from_numpy(faces))
    hit: FloatArray = scene.cast_rays(o3d.core.Tensor.from_numpy(rays.astype(np.float32)))["t_hit"].numpy()
    return hit


def poor_scan(
    body: Avatar, seed: int, *, count: int = 20_000, noise: float = 0.002, outliers: float = 0.05, holes: float = 0.10
) -> PointCloud:
    """Return a poor scan.

    Args:
        body: The truth.
        seed: Of noise, outliers and holes.
        count: Points.
        noise: Standard deviation in each direction [m].
        outliers: Share of points that lie anywhere around the body.
        holes: Share of the surface without points, in round patches.
    """
    rng = np.random.default_rng(seed)
    kept = count - round(outliers * count)
    points, _, _ = sample_surface(body.mesh, round(1.1 * kept / (1.0 - holes)), seed)
    seen = np.ones(len(points), dtype=bool)
    while (~seen).mean() < holes:
        center = points[rng.integers(len(points))]
        seen &= np.linalg.norm(points - center, axis=1) > rng.uniform(*_HOLE_M)
    on_body = points[rng.permutation(np.flatnonzero(seen))[:kept]]
    low, high = points.min(axis=0) - 0.1, points.max(axis=0) + 0.1
    anywhere = rng.uniform(low, high, (count - len(on_body), 3))
    scanned: FloatArray = np.concatenate([on_body + rng.normal(0.0, noise, on_body.shape), anywhere])
    return PointCloud(scanned)
